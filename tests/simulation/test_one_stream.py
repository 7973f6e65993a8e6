"""One stream of the left finger is at fault for a while: what becomes of its finger, which is well again behind it."""

from __future__ import annotations

import pytest
from simulation.edits import Frozen, rows_of, sealed, wrench
from simulation.faults import Drop, Edit, Garbage, Trickle

WRENCH, PAD = "left.wrench", "left.pad"
SHIFT_NM = 0.12
SKIPPED, OVERLOAD, INVALID, RAW = 1, 2, 4, 8
"""Bits of the status of a force sensor."""


def of_another_version(data, _):
    return b"".join(sealed(row[:2] + b"\2" + row[3:]) for row in rows_of(data))


def shifted(six, _):
    return [*six[:3], six[3] + SHIFT_NM, six[4] + SHIFT_NM, six[5]]


def cut_short(rng):
    return Edit(lambda data, _: data[: rng.randrange(1, max(2, len(data)))] if data else data, lies=False)


def mixed_scans(_):
    before = {}

    def mixed(data, _):
        rows = [sealed(row) for row in rows_of(data)]
        old = [before.get(row[3], row) for row in rows]
        before.update({row[3]: row for row in rows})
        return b"".join(new if n % 2 else last for n, (new, last) in enumerate(zip(rows, old, strict=True)))

    return Edit(mixed, lies=False)


def distrusted(bit, reason):
    return (
        WRENCH,
        lambda _: Edit(wrench(status=bit)),
        0.05,
        {"reasons": [reason], "healths": (1, 2), "message": reason},
    )


FAULTS = {
    "a wrong baud rate": (WRENCH, Garbage, 0.3, {"healths": (3,), "message": "no reading for 0.30 s"}),
    "a wrong baud rate of a pad": (PAD, Garbage, 0.3, {"healths": (3,), "message": "no reading for 0.30 s"}),
    "a trickle of bytes": (WRENCH, lambda _: Trickle(), 0.1, {"healths": (3,)}),
    "a trickle of bytes of a pad": (PAD, lambda _: Trickle(), 0.1, {"healths": (3,)}),
    "a pad with another version of the format": (PAD, lambda _: Edit(of_another_version), 0.1, {"healths": (1, 2, 3)}),
    "scans that come twice": (PAD, lambda _: Edit(lambda data, _: data + data, lies=False), 0.2, {"level": "stable"}),
    "a force sensor that is off": (WRENCH, Drop, 0.04, {"reasons": ["stale"], "healths": (3,)}),
    "a force sensor that is stuck": (
        WRENCH,
        lambda _: Edit(wrench(Frozen().reading)),
        0.13,
        {"reasons": ["stuck"], "healths": (1, 2), "lies": True},
    ),
    "a force sensor that is overloaded": distrusted(OVERLOAD, "overload"),
    "a force sensor that calls its readings invalid": distrusted(INVALID, "invalid"),
    "a force sensor that calls its readings raw": distrusted(RAW, "raw"),
    "a status that leaves the reading usable": (
        WRENCH,
        lambda _: Edit(wrench(status=SKIPPED), lies=False),
        0.1,
        {"level": "stable"},
    ),
    "a force sensor that disagrees with the image": (
        WRENCH,
        lambda _: Edit(wrench(shifted)),
        0.5,
        {"reasons": ["disagreement", "disagreement_centroid"], "lies": True},
    ),
    "images that miss a part": (PAD, cut_short, 0.1, {"reasons": ["rotation_unobserved"]}),
    "two images mixed": (PAD, mixed_scans, 0.1, {}),
}
"""Stream, fault made of the random numbers, for how long, s, and what `Bed.struck` is to find."""


@pytest.mark.parametrize(("stream", "fault", "seconds", "found"), FAULTS.values(), ids=FAULTS)
def test_D2_D3_F1_F2_F3_L3_L4_L11_T2_a_fault_of_one_stream(held, stream, fault, seconds, found):
    held.struck(stream, fault(held.rng), seconds, **found)
