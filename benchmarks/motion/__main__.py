"""Measure the advice on motion.

``PYTHONPATH=tests/support:benchmarks python -m motion limits|simulated|time|latency [N]``; ``simulated N FIRST`` begins
with another seed.
"""

from __future__ import annotations

import argparse
import itertools
import time
from collections.abc import Callable

import numpy as np
from motion.simulated import compare
from motion_grips import GRAVITY_MPS2, Advised, Grip, random_grip, true_room, true_use

from slipd.config import parse
from slipd.devices.external import encode_reading
from slipd.engine.engine import Engine
from slipd.events import Bytes, Event, LinkUp, Tick
from slipd.grasp.object_estimate import ObjectState
from slipd.grasp.object_swing import Swing
from slipd.tools.shipped_files import shipped_config
from slipd.tools.sim.carry import carry_config
from slipd.tools.sim.virtual_gripper import LINES, TICK_NS, carried_rig
from slipd.types.arrays import Array

SAFETY = 1.5
BEGIN_NS, ARM_NS = 10**9, 2_000_000
DOWN, STILL = (0.0, 0.0, GRAVITY_MPS2), (0.0, 0.0, 0.0)
FIRST_SEED = 100
"""Of simulated motions: what is learned of a swing was fitted to earlier seeds."""
WAYS = 60
"""Directions in which a limit is compared with the truth, beside the worst one."""


def unit(v: Array) -> Array:
    """Return vectors of length 1."""
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


def holds(grip: Grip, felt: Array, still: Array) -> bool:
    """Return whether a grip truly holds what it feels, with the safety."""
    return SAFETY * true_use(grip, felt) <= 1.0 and true_room(grip, felt, SAFETY, still) >= 0.0


def advised_with_doubts(rng: np.random.Generator) -> tuple[Grip, Array, Advised]:
    """Return a random grip, gravity and the advice: friction, object and forces are known within their uncertainty."""
    grip, gravity = random_grip(rng), GRAVITY_MPS2 * unit(rng.normal(size=3))
    part, com_std = rng.uniform(0.002, 0.03), rng.uniform(0.0002, 0.002)
    mass = grip.mass_kg * float(np.clip(rng.normal(1.0, part), 1.0 - 2.0 * part, 1.0 + 2.0 * part))
    com = grip.com_m + com_std * np.clip(rng.normal(size=3), -2.0, 2.0)
    own = ObjectState(mass, part * grip.mass_kg, tuple(com.tolist()), (com_std,) * 3, "")
    return grip, gravity, Advised(grip, gravity, grip.mu * rng.uniform(0.75, 1.0), own, (0.02, 0.0005), rng)


def measure_limits(count: int) -> None:
    """Compare limits and time scales of random grips with the truth."""
    above, turns, scales, checked, parts = 0, 0, 0, 0, []
    for seed in range(count):
        rng = np.random.default_rng(seed)
        grip, gravity, advised = advised_with_doubts(rng)
        found = advised.limits()
        if found.acceleration_mps2 is None or found.worst_direction is None or found.turn_utilisation is None:
            raise RuntimeError(found.unknown)
        worst = max(true_use(grip, GRAVITY_MPS2 * way) for way in unit(rng.normal(size=(WAYS, 3))))
        turns += worst > found.turn_utilisation < 1.0
        points = random_motion(rng, gravity)
        scale = advised.check(points).time_scale or 0.0
        scales += scale > 0.0 and not all(holds(grip, felt, gravity) for felt in slowed(points, gravity, scale))
        if found.acceleration_mps2 == 0.0:
            continue
        checked += 1
        ways = (found.worst_direction, *unit(rng.normal(size=(WAYS, 3))))
        if not all(holds(grip, gravity - found.acceleration_mps2 * way, gravity) for way in ways):
            above += 1
        parts.append(found.acceleration_mps2 / largest(grip, gravity, found.worst_direction))
    print(f"limits above the true one: {above} of {checked} (of {count} grips, {count - checked} do not hold at rest)")
    print(f"orientations that use more than reported: {turns} of {count}; time scales that do not hold: {scales}")
    if parts:
        shares = np.percentile(parts, (5, 50, 95)).round(3)
        print("limit over the true one in the worst direction: p5, p50, p95", shares)


def random_motion(rng: np.random.Generator, gravity: Array) -> Array:
    """Return a motion from rest without a turn."""
    points = np.zeros((60, 10))
    points[:, 0] = 0.01 * np.arange(60)
    swing = np.sin(np.linspace(0.0, np.pi, 60)) ** 2
    points[:, 1:4] = gravity - swing[:, None] * unit(rng.normal(size=3)) * rng.uniform(2.0, 25.0)
    return points


def slowed(points: Array, gravity: Array, scale: float) -> Array:
    """Return what the gripper feels of every tenth point of a motion that is slowed down."""
    return np.asarray(gravity + scale**2 * (points[::6, 1:4] - gravity))


def largest(grip: Grip, gravity: Array, way: Array) -> float:
    """Return the largest acceleration in a direction that truly holds, m/s²."""
    low, high = 0.0, 80.0
    for _ in range(20):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(grip, gravity - middle * way, gravity) else (low, middle)
    return max(low, 1e-9)


def measure_simulated(count: int, first: int = FIRST_SEED) -> None:
    """Compare predictions with simulated motions, of seeds from ``first``; those above 1 as they are, and as 1."""
    for build_s in (0.15, 0.5, 1.0):
        every = [compare(np.random.default_rng(first + k), build_s) for k in range(count)]
        found = [each for each in every if not each.slid]
        occurred = np.array([each.occurred for each in found])
        print(
            f"motion within {build_s} s: {len(found)}, in {sum(each.seen for each in found)} a swing was seen;", end=" "
        )
        print("utilisations p5, p50, p95", np.percentile(occurred, (5, 50, 95)).round(2), end=" ")
        print("slid at", [round(each.predicted, 2) for each in every if each.slid])
        for name, most in itertools.product(("rigid", "predicted"), (1.0, np.inf)):
            error = np.array([min(getattr(each, name), most) for each in found]) - occurred
            print(f"  {name}, at most {most}, less occurred", np.percentile(error, (5, 50, 95)).round(3), end=" ")
            print("(p5, p50, p95), size p95", np.percentile(abs(error), 95).round(3), "largest", error.max().round(3))


def measure_time(count: int) -> None:
    """Print the processor time of the limits, of a look at the loads, and of a check of 2,000 points."""
    _, gravity, advised = advised_with_doubts(np.random.default_rng(3))
    points = np.zeros((2000, 10))
    points[:, 0], points[:, 1:4] = 0.002 * np.arange(2000), gravity
    points[1:, 1:4] += np.random.default_rng(0).normal(0.0, 2.0, (1999, 3))
    far = points + (points - points[0]) * 4.0 * (np.arange(10) // 3 == 0) * (np.arange(10) > 0)

    def check_swinging() -> None:
        advised.held.swing = Swing(40.0, 0.0)
        advised.check(far)

    work: dict[str, Callable[[], object]] = {
        "limits": advised.limits,
        "look": lambda: (advised.look(), advised.read([finger.state for finger in advised.fingers.values()])),
        "check": lambda: advised.check(points),
        "check of a motion that is too fast": lambda: advised.check(far),
        "check of one with a swing": check_swinging,
    }
    for name, run in work.items():
        times = []
        for _ in range(count):
            begin = time.thread_time()
            run()
            times.append(1000.0 * (time.thread_time() - begin))
        print(f"{name}: p50 {np.median(times):.3f}, p95 {np.percentile(times, 95):.3f} ms")


def measure_latency(count: int) -> None:
    """Print what a read of a force sensor takes in an engine with the arm stream at 500 Hz, over one without it.

    Both engines run side by side on the same bytes, for ``count`` reads of each of four rounds; the median of each.
    Which one is first changes at random: the first finds what it needs less often in the cache.
    """
    rng = np.random.default_rng(0)
    for round_ in range(4):
        rig = carried_rig(round_)
        with_arm = carry_config(shipped_config("demo.toml").read_text(encoding="utf-8")).replace("250.0", "500.0")
        engines = [Fed(with_arm), Fed(with_arm[: with_arm.index("[grasp.arm]")])]
        for line in LINES:
            rig.devices[line].opened(0)
            for each in engines:
                each.feed(LinkUp(line.replace("-", "."), line), 0)
        engines[0].feed(LinkUp("arm", "arm"), 0)
        for step in range(1, count + 1):
            t_ns = BEGIN_NS + step * TICK_NS
            said = rig.advance(t_ns)
            for each in engines if rng.random() < 0.5 else engines[::-1]:
                for line, data in said.items():
                    if data:
                        each.feed(Bytes(line.replace("-", "."), data), t_ns)
                if step % 4 == 0:
                    each.feed(Tick(), t_ns)
            if step * TICK_NS % ARM_NS < TICK_NS:
                felt = encode_reading("arm", t_ns, gravity_mps2=DOWN, angular_velocity_radps=STILL)
                engines[0].feed(Bytes("arm", felt), t_ns)
        there, without, arm = (
            np.median(times) / 1000.0 for times in (*(each.force for each in engines), engines[0].arm)
        )
        print(f"read of a force sensor {there:.1f} µs with the arm, {without:.1f} µs without: {there / without:.3f}; "
              f"a reading of the arm {arm:.1f} µs")  # fmt: skip


class Fed:
    """An engine, and how long it took for each read of a force sensor and of the arm, ns."""

    def __init__(self, text: str) -> None:
        self._engine = Engine(parse(text, "rig.toml"), boot="b", wall_minus_monotonic_ns=0)
        self.force: list[int] = []
        self.arm: list[int] = []

    def feed(self, event: Event, t_ns: int) -> None:
        """Handle an event."""
        begin_ns = time.perf_counter_ns()
        for _ in self._engine.handle(event, t_ns):
            pass
        if isinstance(event, Bytes) and not event.link.endswith(("pad", "gripper")):
            (self.arm if event.link == "arm" else self.force).append(time.perf_counter_ns() - begin_ns)


MEASURES: dict[str, Callable[..., None]] = {
    "limits": measure_limits, "simulated": measure_simulated, "time": measure_time, "latency": measure_latency
}  # fmt: skip


def main() -> None:
    """Measure one of the four."""
    parser = argparse.ArgumentParser(prog="python -m motion", description="Measure the advice on motion.")
    parser.add_argument("measure", choices=MEASURES)
    parser.add_argument("count", type=int, nargs="?", default=1000, help="default: %(default)s")
    parser.add_argument("first", type=int, nargs="*", help="first seed, of simulated motions")
    chosen = parser.parse_args()
    MEASURES[chosen.measure](chosen.count, *chosen.first)


if __name__ == "__main__":
    main()
