"""Runs of the daemon as lists of events, made offline: the demo's scene, a gripper trial, and walks of the load.

The same events in the same order give the same decisions, so a run can be measured again with another solver in place.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from bench import traffic
from numpy.typing import NDArray
from sim.test_story import BEGIN_S, READY_S, TARE_S, Story

from slipd import config
from slipd.devices import bota
from slipd.fusion import utilisations
from slipd.pipeline.engine import Engine
from slipd.pipeline.events import Bytes, Event, LinkUp, Tick
from slipd.recording.grips import import_trial
from slipd.recording.reader import open_recording
from slipd.sim.contact import Pad, pad_wrench
from slipd.sim.operator import Plan
from slipd.sim.rig import LINES, Rig
from slipd.sim.scene import Scene

Array = NDArray[np.float64]

TRIALS = Path(__file__).parents[1] / "data" / "grips"
DEMO_S, QUICK_DEMO_S = 16.0, 3.0
WALK_S, QUICK_WALK_S = 2.5, 0.7
FREE_S = 0.4
"""The walks begin without contact: a pad of charge needs to know its zero."""

WALKS = {"walk of 1 s": 1.0, "walk of 30 ms": 0.03, "load anew each reading": 0.0}
"""How long the load of a walk remembers where it was, s."""

NEAR, SPREAD = 0.775, 0.08
"""Utilisation of the walks: between the thresholds of caution and warning, and past both ends of them."""

NO_SLIPS = "[finger.left.slip]\narmed_at = 10.0\n"
"""A walk falls as steeply as a slip, and slips told would hide the levels."""

BOOT = "b"
"""The run that the story's requests are meant for."""

TURN, TILT, RADIUS_M = 1.5, 0.8, 0.01
"""Spread of the direction of the force, and of how much of the load is spin on this arm, rad and m."""


@dataclass(frozen=True)
class Run:
    """What entered the engine: its config, and each event with its time, ns."""

    name: str
    settings: config.Config
    events: list[tuple[int, Event]]

    def engine(self, kind: type[Engine] = Engine) -> Engine:
        """One that has seen nothing yet."""
        return kind(self.settings, boot=BOOT, wall_minus_monotonic_ns=0)


def all_runs(*, quick: bool = False) -> Iterator[Run]:
    """The demo, the trials of the test data, the walks."""
    yield demo(QUICK_DEMO_S if quick else DEMO_S)
    for folder in sorted(path for path in TRIALS.iterdir() if path.is_dir()):
        yield trial(folder)
    for seed, (name, memory_s) in enumerate(WALKS.items()):
        yield walk(name, memory_s, QUICK_WALK_S if quick else WALK_S, seed)


class _Heard(Story):
    """The demo's story, with every event kept."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.events: list[tuple[int, Event]] = []

    def feed(self, event: Event) -> object:
        self.events.append((self.now_ns, event))
        return super().feed(event)


def demo(until_s: float) -> Run:
    """The demo's scene, its warnings heeded, up to ``until_s`` of the scene."""
    plan, settings = Plan(), config.load(config.shipped("demo.toml"))
    rig = Rig(Scene(), seed=11)
    story = _Heard(rig, Engine(settings, boot=BOOT, wall_minus_monotonic_ns=0))
    for line in LINES:
        rig.opened(line, 0)
        story.feed(LinkUp(line.replace("-", "."), line))
    story.until(READY_S - BEGIN_S)
    for finger in settings.finger:
        story.ask("tare", finger=finger, seconds=TARE_S)
    story.until(0.0)
    story.ask("lease.acquire", ttl_ms=plan.lease_ms)
    story.ask("gripper.activate")
    story.until(plan.close_s)
    story.ask("gripper.close", force_n=plan.force_n, speed_mps=plan.speed_mps)
    story.until(until_s, heed=True)
    return Run("demo", settings, story.events)


def trial(folder: Path) -> Run:
    """A gripper trial with two pads of three-axis taxels."""
    text = config.shipped("grips.toml").read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "trial.mcap"
        import_trial(folder, path, text)
        events = list(open_recording(path).events())
    return Run(f"trial {folder.name}", config.parse(text, "grips.toml"), events)


def walk(name: str, memory_s: float, seconds: float, seed: int) -> Run:
    """One finger at 1 kHz whose load wanders about the thresholds, in size, direction and share of spin."""
    count, warm_up_s = round(seconds * traffic.WRENCH_HZ), FREE_S
    rng = np.random.default_rng(seed)
    normal_n = traffic.grip(count, traffic.WRENCH_HZ, warm_up_s)
    scans = traffic.pad_scans(
        traffic.grip(round(seconds * traffic.PAD_HZ), traffic.PAD_HZ, warm_up_s), traffic.PATCH, seed
    )
    frames = _frames(normal_n, _loads(normal_n, memory_s, rng), rng)
    events: list[tuple[int, Event]] = [(0, LinkUp("left.wrench", "a")), (0, LinkUp("left.pad", "b"))]
    events += [(_at(n, traffic.WRENCH_HZ), Bytes("left.wrench", frame)) for n, frame in enumerate(frames)]
    events += [(_at(n, traffic.PAD_HZ) + 250_000, Bytes("left.pad", scan)) for n, scan in enumerate(scans)]
    events += [(_at(n, 100), Tick()) for n in range(1, round(seconds * 100))]
    text = traffic.config_text({"left.wrench": "a", "left.pad": "b"}, {}) + NO_SLIPS
    return Run(name, config.parse(text, "walk.toml"), sorted(events, key=lambda timed: timed[0]))


def _at(number: int, rate_hz: int) -> int:
    return (number + 1) * 1_000_000_000 // rate_hz


def _loads(normal_n: Array, memory_s: float, rng: np.random.Generator) -> Array:
    """Force (2) and spin of each reading, shape (n, 3), N and N·m."""
    size, turn, tilt = (_wander(normal_n.size, memory_s, rng) for _ in range(3))
    turn, tilt = TURN * turn, math.pi / 4 + TILT * tilt
    unit = np.stack((np.cos(tilt) * np.cos(turn), np.cos(tilt) * np.sin(turn), RADIUS_M * np.sin(tilt)), axis=1)
    pad = Pad()
    shares = pad.shares(traffic.PATCH)
    images = np.tile(shares / shares.sum(), (normal_n.size, 1))
    centre = np.array(traffic.PATCH.centre_m)
    used = utilisations(*pad.centres(), images, traffic.MU, unit[:, :2], unit[:, 2], centre)
    return unit * ((NEAR + SPREAD * size) * normal_n / used.value)[:, None]


def _wander(count: int, memory_s: float, rng: np.random.Generator) -> Array:
    """A stationary walk about 0 with unit variance that forgets within ``memory_s``."""
    kept = math.exp(-1.0 / (memory_s * traffic.WRENCH_HZ)) if memory_s > 0.0 else 0.0
    push = rng.normal(size=count)
    push[1:] *= math.sqrt(1.0 - kept * kept)
    for n in range(1, count):
        push[n] += kept * push[n - 1]
    return push


def _frames(normal_n: Array, loads: Array, rng: np.random.Generator) -> list[bytes]:
    """What the sensor behind the pad says of these loads."""
    turn, lever_m, period_us = traffic.rotation(), np.array(traffic.LEVER_M), 1_000_000 // traffic.WRENCH_HZ
    frames = []
    for n, (load, normal) in enumerate(zip(loads.tolist(), normal_n.tolist(), strict=True)):
        force, torque = pad_wrench(tuple(load), normal, traffic.PATCH.centre_m)
        force_noise, torque_noise = rng.normal(size=(2, 3))
        force += traffic.FORCE_STD_N * force_noise
        torque += traffic.TORQUE_STD_NM * torque_noise - np.cross(lever_m, force)
        frames.append(bota.encode_frame(force @ turn, torque @ turn, n * period_us))
    return frames
