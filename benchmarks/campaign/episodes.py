"""Random faults one after another; after each, the verdict must recover."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from random import Random

from campaign.size import size_of
from nanoseconds import MS
from simulation.bed import FINGERS, SECOND
from simulation.edits import pad, wrench
from simulation.faults import Bunch, Bursts, Chain, Delay, Drop, Edit, Flood, Garbage, Noise, Split, Trickle
from simulation.line import Fault
from simulation.slow_reader import SlowReader

FAULTS = 12
"""Of an episode."""

RECOVERY_S = 1.0
LONGEST_S = 0.8
GROWTH_BYTES = 256_000
"""What an engine may grow by in an episode: windows that fill, and no more."""

STATUS_BITS = (2, 4, 8)
CLOCK_SPAN_US = 1 << 32

Make = Callable[[Random], Fault]


def _edit_of(stream: str, rng: Random) -> Fault:
    jump_us = rng.randrange(CLOCK_SPAN_US)
    change = wrench if stream.endswith("wrench") else pad
    return Edit(change(clock_us=lambda time_us: (time_us + jump_us) % CLOCK_SPAN_US), lies=False)


def _none_of_it(rng: Random) -> Fault:
    value = rng.choice((float("nan"), float("inf"), float("-inf")))
    place = rng.randrange(6)
    return Edit(wrench(lambda six, _: [value if n == place else number for n, number in enumerate(six)]))


ANY_LINE: dict[str, Make] = {
    "noise": lambda rng: Noise(rng, per_thousand=10.0 ** rng.uniform(-1.0, 2.0)),
    "splits": lambda rng: Split(rng, most=rng.choice((1, 8, 64))),
    "off": Drop,
    "drops": lambda rng: Drop(rng, share=rng.random()),
    "fits and starts": lambda rng: Bursts(rng, mean_ns=round(rng.uniform(5, 100)) * MS),
    "bunches": lambda rng: Chain([Bunch(), Split(rng, most=256)]),
    "garbage": Garbage,
    "flood": Flood,
    "trickle": lambda _: Trickle(period_ns=200 * MS),
    "delay": lambda rng: Delay(round(rng.uniform(1, 15)) * MS),
}
WRENCH_ALONE: dict[str, Make] = {
    "status": lambda rng: Edit(wrench(status=rng.choice(STATUS_BITS))),
    "no numbers": _none_of_it,
}
HOST = ("stall", "suspend", "unplug")


@dataclass(frozen=True)
class Episode:
    """One bed from its start to its end.

    Attributes:
        seed: Of everything.
        seconds: That were simulated.
        messages: That were told.
        story: What befell it, in order.
        faults: What did not hold.
    """

    seed: int
    seconds: float
    messages: int
    story: list[str]
    faults: list[str]


def play(seed: int, count: int = FAULTS) -> Episode:
    """One episode."""
    bed, rng = SlowReader(seed), Random(seed ^ 0x5EED)
    bed.hold()
    story: list[str] = []
    begun_ns = bed.t_ns
    bed.run(1.0)
    before = size_of(bed.engine)
    for _ in range(count):
        story.append(_strike(bed, rng))
        slow = [finger for finger in FINGERS if bed.recovery_s("stable", finger, RECOVERY_S) > RECOVERY_S]
        if slow:
            told = {finger: bed.level(finger) for finger in slow}
            bed.watch.faults.append(f"behind {story[-1]}: not stable within {RECOVERY_S} s, but {told}")
        bed.run(rng.uniform(0.0, 0.3))
        if bed.watch.faults:
            break
    faults = list(bed.watch.faults)
    if size_of(bed.engine) > before + GROWTH_BYTES:
        faults.append(f"the engine grew from {before} to {size_of(bed.engine)} bytes")
    if not bed.replays():
        faults.append("the same events told something else when they were replayed")
    return Episode(seed, (bed.t_ns - begun_ns) / SECOND, bed.watch.messages, story, faults)


def _strike(bed: SlowReader, rng: Random) -> str:
    """One fault, begun and ended; returns what it was."""
    seconds = rng.uniform(0.02, LONGEST_S)
    streams = [line.link for line in bed.lines.values() if line.link != "gripper"]
    name = rng.choice([*ANY_LINE, *WRENCH_ALONE, "clock", *HOST])
    stream = rng.choice([other for other in streams if name not in WRENCH_ALONE or other.endswith("wrench")])
    if name in HOST:
        return _host(bed, rng, name, stream, seconds)
    struck = [stream]
    if name in ANY_LINE and rng.random() < 0.3:
        struck = rng.sample([line.link for line in bed.lines.values()], rng.randint(2, 5))
    bed.watch.lateness_ns = 16 * MS if name in ("bunches", "delay") else 0
    for other in struck:
        make = ANY_LINE.get(name) or WRENCH_ALONE.get(name)
        bed.line(other).fault = make(bed.rng) if make is not None else _edit_of(other, bed.rng)
    bed.run(seconds)
    for other in struck:
        bed.line(other).fault = None
    return f"{name} on {', '.join(struck)} for {seconds:.3f} s"


def _host(bed: SlowReader, rng: Random, name: str, stream: str, seconds: float) -> str:
    bed.watch.lateness_ns = 0
    if name == "stall":
        bed.stall(seconds)
        bed.catch_up()
    elif name == "suspend":
        seconds = 10.0 ** rng.uniform(0.0, 3.5)
        bed.suspend(seconds)
        bed.run(0.01)
    else:
        bed.down(stream)
        bed.run(seconds)
        bed.up(stream)
    return f"{name} of {stream if name == 'unplug' else 'the host'} for {seconds:.3f} s"
