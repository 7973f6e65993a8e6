"""Faults of the lines, group L: bytes that arrive split, noisy, in excess, late or not at all."""

from __future__ import annotations

from random import Random

import pytest
from run_courses import ask, down, health, level, status, up
from simulation.bed import READY_S, Bed
from simulation.faults import Drop, Edit, Flood, Garbage, Noise, Split, Trickle
from simulation.steps import (
    BLIND,
    HELD,
    MENDED,
    OTHER_STABLE,
    PAD,
    STABLE,
    STALE,
    STREAMS,
    WRENCH,
    Course,
    play,
    replays,
    run,
    silent,
    strike,
    struck,
    unwell,
)

from slipd_client.messages import Health


def gone(reason: str) -> list:
    """The port of the force sensor cannot be opened."""
    return [lambda bed: bed.down(WRENCH, reason), run(0.05)]


def cut_short(rng):
    return Edit(lambda data, _: data[: rng.randrange(1, max(2, len(data)))] if data else data, lies=False)


def bad_bytes_are_counted(bed):
    assert all(bed.health(stream)["bad_bytes"] > 0 for stream in STREAMS)


def noise(seed: int):
    return lambda _: Noise(Random(seed), per_thousand=3.0)


COURSES: dict[str, Course] = {
    **{
        f"noise on every line is counted and never believed: {seed}": (
            HELD,
            [
                strike(noise(seed)), run(0.5),
                *(unwell(stream=stream) for stream in STREAMS), bad_bytes_are_counted, *MENDED, replays,
            ],
        )
        for seed in (1, 2)
    },
    **{
        f"{stream} is unplugged and read again when it is back": (
            HELD,
            [
                down(stream), level(*told), run(0.03), level("unknown", reason), OTHER_STABLE,
                status(streams={stream: {"health": Health.ERROR, "message": "unplugged"}}), up(stream), *MENDED,
                status(streams={stream: {"reconnects": 1}}), replays,
            ],
        )
        for stream, told, reason in (
            (WRENCH, ("unknown", "stale"), "stale"), (PAD, ("stable",), "rotation_unobserved"),
        )
    },
    "another device on the path is refused": (
        lambda: Bed(1, streams={WRENCH: 'hardware_id = "S/N 2"'}),
        [
            up(), run(READY_S), ask("tare", finger="right", seconds=0.1), run(0.5), level("unknown"),
            health(WRENCH, severity=Health.ERROR), level("no_contact", finger="right"),
        ],
    ),
    "a port that cannot be opened is reported and the other links go on": (
        HELD,
        [
            *gone("no such file or directory"), *gone("permission denied") * 5, STALE, OTHER_STABLE,
            health(WRENCH, "permission denied", severity=Health.ERROR),
        ],
    ),
    "a flood is counted": (
        HELD, [strike(Flood, *STREAMS), run(0.6), *(unwell(stream=stream) for stream in STREAMS), *MENDED],
    ),
    "a wrong baud rate": (HELD, struck(WRENCH, Garbage, 0.3, silent("no reading for 0.30 s"), STALE)),
    "a wrong baud rate of a pad": (
        HELD, struck(PAD, Garbage, 0.3, silent("no reading for 0.30 s", stream=PAD), BLIND),
    ),
    "a trickle of bytes": (HELD, struck(WRENCH, lambda _: Trickle(), 0.1, silent(), STALE)),
    "a trickle of bytes of a pad": (HELD, struck(PAD, lambda _: Trickle(), 0.1, silent(stream=PAD), BLIND)),
    "scans that come twice": (
        HELD, struck(PAD, Edit(lambda data, _: data + data, lies=False), 0.2, STABLE),
    ),
    "images that miss a part": (HELD, struck(PAD, cut_short, 0.1, BLIND)),
    "a force sensor that is off": (HELD, struck(WRENCH, Drop, 0.04, silent(), STALE)),
}  # fmt: skip


@pytest.mark.parametrize("name", COURSES)
def test_F1_L2_L3_L4_L5_L6_L7_L9_L11_T2_a_fault_of_a_line(name):
    play(COURSES[name])


def test_L1_a_split_stream_gives_the_same_as_a_whole_one():
    whole, torn = Bed(1), Bed(1)
    torn.strike(Split(torn.rng))
    for bed in (whole, torn):
        bed.hold()
    assert torn.watch.changes == whole.watch.changes
    assert [stream["bad_bytes"] for stream in torn.watch.status["streams"].values()] == [0] * 5
    play((lambda: torn, [replays]))
