"""What a finger learns of friction is never from readings that are not trusted."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from finger_bench import FULL, MS, Image, Parse, Wrench, make_finger, read_force

from slipd.finger.finger import Finger
from slipd.finger.finger_state import FingerState
from slipd.finger.freshness import PROMPT, Arrival
from slipd.types.samples import TactileSample, WrenchSample

CARRIED_MORE = 6.0
"""Tangential force on 10 N of grip, N: above the stated μ of 0.5."""


class Held:
    """A finger that holds with 10 N, read at 100 Hz with an image each time."""

    def __init__(self, finger: Finger, wrench: Wrench, image: Image) -> None:
        self.finger, self._wrench, self._image = finger, wrench, image
        self.t_ns = 100_000_000_000
        self._rng = np.random.default_rng(1)
        self.state = finger.state

    def tare(self) -> None:
        self.finger.begin_tare(self.t_ns, 0.01, "someone")
        for _ in range(20):
            self.t_ns += MS
            self.state = read_force(self.finger, self._wrench(self.t_ns, 0.0))
        assert self.finger.tare.current.id > 0

    def hold(
        self,
        pull_n: float = CARRIED_MORE,
        seconds: float = 0.4,
        *,
        status: tuple[str, ...] = (),
        image_status: tuple[str, ...] = (),
        counts: np.ndarray | None = FULL,
        arrival: Arrival = PROMPT,
    ) -> FingerState:
        for _ in range(round(100 * seconds)):
            self.t_ns += 10 * MS
            if counts is not None:
                noisy = np.minimum(counts + self._rng.integers(0, 2, counts.shape), 255)
                shown = self._image(self.t_ns, noisy)
                self.finger.update_image(TactileSample(self.t_ns, None, shown.values, image_status))
            sample: WrenchSample = self._wrench(self.t_ns, 10.0, (pull_n, 0.0), status=status)
            for _batch in self.finger.decide((sample,), (self.t_ns,), arrival):
                pass
            self.state = self.finger.state
        return self.state

    @property
    def mu(self) -> float | None:
        return self.finger.friction.state.mu


@pytest.fixture
def make_held(left: str, parse: Parse, wrench: Wrench, image: Image) -> Callable[..., Held]:
    """Make a tared finger of a config, by default with μ 0.5."""

    def make(text: str = left) -> Held:
        held = Held(make_finger(text, parse), wrench, image)
        held.tare()
        return held

    return make


@pytest.fixture
def held(make_held: Callable[..., Held]) -> Held:
    return make_held()


def test_a_load_above_the_stated_friction_that_is_held_raises_it(held: Held) -> None:
    held.hold()
    assert held.mu == pytest.approx(0.6, rel=0.05)


@pytest.mark.parametrize(
    "untrusted",
    [
        {"status": ("overload",)},
        {"status": ("invalid",)},
        {"image_status": ("invalid",)},
        {"counts": None},
        {"arrival": Arrival(waited_ns=MS)},
    ],
    ids=["overload", "invalid", "image invalid", "no image", "stall"],
)
def test_readings_that_are_not_trusted_raise_nothing(held: Held, untrusted: dict[str, object]) -> None:
    held.hold(1.0)
    held.hold(seconds=0.1, counts=None)  # the image before is too old by then
    held.hold(**untrusted)  # type: ignore[arg-type]
    assert held.mu == 0.5


def test_a_sensor_without_a_known_zero_raises_nothing(left: str, parse: Parse, wrench: Wrench, image: Image) -> None:
    held = Held(make_finger(left, parse, zeros=False), wrench, image)
    held.hold()
    assert held.mu == 0.5
    held.finger.note_motion(held.t_ns + 300 * MS, ("external",))
    held.hold(8.0)
    assert held.mu <= 0.5, "a slip lowers it, at most"


def test_force_readings_that_repeat_raise_nothing(left: str, parse: Parse, wrench: Wrench, image: Image) -> None:
    """A sensor that hangs at the peak of a load holds it for ever."""
    held = Held(make_finger(left.replace("stuck_after = 0\n", "stuck_after = 1000\n"), parse), wrench, image)
    held.tare()
    held.hold()
    assert held.mu == 0.5


def test_a_short_shock_when_another_process_reports_motion_does_not_raise_friction(held: Held) -> None:
    held.hold(2.0)
    held.finger.note_motion(held.t_ns + 300 * MS, ("external",))
    held.hold(9.0, 0.01)
    held.hold(2.0)
    assert held.mu <= 0.5
