"""Drive one finger by hand: single force readings, presses, and a finger with noise on everything."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

import numpy as np
from fixture_types import Parse
from known_zeros import known_finger
from nanoseconds import MS, T0

from slipd.config import Levels
from slipd.finger.finger import Finger
from slipd.finger.finger_state import FingerState
from slipd.finger.freshness import PROMPT, Arrival, Read
from slipd.fusion import torque_limit
from slipd.fusion.friction_learning import learn
from slipd.fusion.rows import READING, TOUCHING, new_rows
from slipd.publish.stream_health import finger_conditions
from slipd.types.arrays import Array
from slipd.types.samples import TactileSample, WrenchSample
from slipd_client.messages import Health

FULL = np.full((4, 4), 100)
EMPTY = np.zeros((4, 4))

Press = Callable[..., FingerState]


def make_finger(text: str, parse: Parse, name: str = "left", *, zeros: bool = True) -> Finger:
    """Return a finger of a config in TOML, with the default levels; ``zeros``: those of its sensors are known."""
    make = known_finger if zeros else Finger
    return make(name, parse(text).finger[name], Levels())


def read_force(
    finger: Finger, sample: WrenchSample, acquired_ns: int | None = None, arrival: Arrival = PROMPT
) -> FingerState:
    """Return the state of a finger after a reading, acquired when it was received unless ``acquired_ns`` differs."""
    list(finger.decide(Read((sample,), (sample.t_ns if acquired_ns is None else acquired_ns,), arrival)))
    return finger.state


def verdict(state: FingerState) -> tuple[str, tuple[str, ...]]:
    """Return level and reasons."""
    return state.verdict.level, state.verdict.reasons


def teach(finger: Finger, q: float, *, slips: bool = False) -> None:
    """Let the grasp carry the required friction q for 0.3 s, and then slip."""
    rows = new_rows(READING, 61)
    rows["phase"], rows["t_s"] = TOUCHING, T0 * 1e-9 + 0.005 * np.arange(61)
    rows["assessment"]["required_friction"] = rows["contact"]["friction_ratio"] = q
    rows["assessment"]["peak_required"] = rows["assessment"]["plateau_required"] = math.nan
    rows["assessment"]["slips"][-1] = slips
    learn(rows, finger.friction.learning, 0.0, 0)
    finger.friction.begin_step([round(rows["t_s"][-1] * 1e9) + 20 * MS], 0)


def limit_nm(finger: Finger, normal_n: float) -> float:
    """Largest spin that friction carries on the whole pad, evenly pressed."""
    x, y = finger.image.x, finger.image.y
    return torque_limit(x, y, np.full(16, normal_n / 16), 0.5, (0.0, 0.0), (0.0, 0.0)).torque_nm


def pull(press: Press, forces: Iterable[float], normals: Iterable[float] | None = None) -> list[str]:
    """Levels of readings 10 ms apart."""
    forces = list(forces)
    return [
        press(normal, (force, 0.0)).verdict.level
        for force, normal in zip(forces, normals or [10.0] * len(forces), strict=True)
    ]


def taxel_faults(finger: Finger) -> dict[str, list[int]]:
    """Return the masked taxels of the pad by kind of fault, without the kinds that do not occur."""
    return {kind: taxels for kind, taxels in finger.image.taxel_health.report().items() if taxels}


class NoisyFinger:
    """A finger that is pressed and pulled, and seen by its pad, with noise on everything."""

    def __init__(self, finger: Finger) -> None:
        self.finger = finger
        self.t_ns = T0
        self.rng = np.random.default_rng(1)
        self.state = finger.state

    def read(self, normal_n: float, pull_n: float = 0.0, *, at_m: tuple[float, float] = (0.0, 0.0)) -> FingerState:
        """Hand over a force reading 1 ms after the one before."""
        force = np.array((pull_n, 0.0, -normal_n)) + self.rng.normal(0.0, 0.002, 3)
        return self.send(force, np.cross((*at_m, 0.0), force))

    def send(self, force: Array, torque: Array) -> FingerState:
        """Hand over a force reading without noise."""
        self.t_ns += MS
        self.state = read_force(self.finger, WrenchSample(self.t_ns, None, force, torque))
        return self.state

    def look(self, normal_n: float, spoil: Callable[[Array], None] = lambda _: None) -> None:
        """Hand over an image of an even pressure; ``spoil`` changes its counts."""
        counts = np.round(100 * normal_n / 16 + self.rng.normal(0.0, 1.0, 16))
        spoil(counts)
        self.finger.update_image(TactileSample(self.t_ns, None, counts))

    def hold(
        self, seconds: float, spoil: Callable[[Array], None] = lambda _: None, **contact: tuple[float, float]
    ) -> None:
        """Press with 8 N that swing by a quarter: force at 100 Hz, an image every 20 ms."""
        for k in range(round(seconds * 100)):
            normal_n = 8.0 + 2.0 * math.sin(0.1 * k)
            self.t_ns += 9 * MS
            self.read(normal_n, 0.8, **contact)
            if k % 2 == 0:
                self.look(normal_n, spoil)
        self.read(8.0, 0.8, **contact)

    @property
    def verdict(self) -> tuple[str, tuple[str, ...]]:
        """Level and reasons of the newest reading."""
        return verdict(self.state)

    def conditions(self, stream: str) -> list[tuple[Health, str]]:
        """Health of the stream "wrench" or "pad"."""
        return finger_conditions(self.finger, stream, self.t_ns)
