"""Faults of the sensors: of forces (F), of taxels and images (T), and of numbers (N)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from run_courses import ask, health, lease, level, status
from simulation.bed import SECOND, Bed
from simulation.edits import Frozen, pad, rows_of, sealed, wrench
from simulation.faults import Bursts, Drop, Edit, Split
from simulation.steps import (
    BLIND,
    HELD,
    MENDED,
    OTHER_STABLE,
    PAD,
    RAISE,
    STABLE,
    STALE,
    WRENCH,
    Course,
    excuse,
    feels,
    forget,
    hold,
    play,
    recovers,
    replays,
    run,
    strike,
    struck,
    told,
    unwell,
)

from slipd_client.messages import Health

SHIFT_NM = 0.12
SKIPPED, OVERLOAD, INVALID, RAW = 1, 2, 4, 8
"""Bits of the status of a force sensor."""
STRANGE = (math.nan, math.inf, -math.inf)
ROW, COLUMN = 3, 8
"""A taxel in the middle of the contact."""


def shifted(six, _):
    return [*six[:3], six[3] + SHIFT_NM, six[4] + SHIFT_NM, six[5]]


def mixed_scans(_):
    before = {}

    def mixed(data, _):
        rows = [sealed(row) for row in rows_of(data)]
        old = [before.get(row[3], row) for row in rows]
        before.update({row[3]: row for row in rows})
        return b"".join(new if n % 2 else last for n, (new, last) in enumerate(zip(rows, old, strict=True)))

    return Edit(mixed, lies=False)


def one_number(place, value, share=1.0):
    """Return a fault by which one component of a share of the readings is this value."""

    def made(rng):
        def change(six, _):
            return [value if n == place and rng.random() < share else number for n, number in enumerate(six)]

        return Edit(wrench(change), lies=False)

    return made


def faulty_taxels(count, columns):
    def change(row, counts, _):
        return np.where((row == ROW) & np.isin(np.arange(len(counts)), columns), count, counts)

    return Edit(pad(change), lies=False)


def hum(row, counts, now_ns):
    return counts + round(12.0 * math.sin(2.0 * math.pi * 50.0 * now_ns * 1e-9) + 3e-9 * (now_ns % SECOND))


def wobble(times):
    """The grip is changed a little, up and down: only under a load that moves does a taxel that rests show."""
    return [step for n in range(times) for step in (lease, ask("grip.set", force_n=9.5 if n % 2 else 7.0), run(0.25))]


def used_or_unknown(bed):
    """Check that the utilisation is a number that can be, or none."""
    used = bed.watch.slip["left"]["utilisation"]
    assert used is None or used >= 0.0


def reads_nothing(bed):
    """From now on the left force sensor reads its offset, with a little noise."""
    offset = bed.engine._fingers["left"].tare.current.value
    bed.strike(Edit(wrench(lambda _, now_ns: offset * (1.0 + 1e-4 * (now_ns % 7)))), WRENCH)


def quiet_for_a_second(bed):
    """Check that no slip was told lately."""
    late = {level for t_ns, _, level in bed.watch.changes if t_ns > bed.t_ns - SECOND}
    assert not late & {"slipping", "warning"}


def because(reason):
    """Check that the left finger is unknown, for this reason among others."""

    def step(bed):
        level, reasons = bed.level()
        assert (level, reason in reasons) == ("unknown", True)

    return step


def failed(*words, stream=WRENCH):
    """Check that a stream is not used, and why."""
    return health(stream, *words, severity=Health.ERROR)


def not_stable(bed):
    assert bed.level()[0] != "stable"


def presses(normal_n):
    def step(bed):
        assert bed.rig.scene.normal_n == pytest.approx(normal_n, abs=0.05)

    return step


COURSES: dict[str, Course] = {
    "F1 an intermittent sensor is never trusted in its gaps": (
        HELD, [strike(Bursts, WRENCH), run(1.0), told("left", "unknown"), *MENDED, replays],
    ),
    "F1 a slow sensor is reported": (
        HELD, [strike(lambda rng: Drop(rng, share=0.6), WRENCH), run(1.1), unwell("Hz instead of")],
    ),
    "F1 streams that fall silent one after the other are each noticed in time": (
        HELD, [strike(Drop, PAD), run(0.015), strike(Drop, WRENCH), run(0.04), STALE],
    ),
    "F1 no grip is raised on a stale sensor": (HELD, [lease, strike(Drop, WRENCH), run(0.1), RAISE]),
    "F1 a force sensor that is stuck": (
        HELD,
        struck(WRENCH, lambda _: Edit(wrench(Frozen().reading)), 0.13, level("unknown", "stuck"), failed(), excuse),
    ),
    **{
        f"F2 a force sensor that calls its readings {reason}": (
            HELD, struck(WRENCH, Edit(wrench(status=bit)), 0.05, level("unknown", reason), failed(reason)),
        )
        for bit, reason in ((OVERLOAD, "overload"), (INVALID, "invalid"), (RAW, "raw"))
    },
    "F2 a status that leaves the reading usable": (
        HELD, struck(WRENCH, Edit(wrench(status=SKIPPED), lies=False), 0.1, STABLE),
    ),
    "F3 a force sensor that disagrees with the image": (
        HELD,
        struck(WRENCH, Edit(wrench(shifted)), 0.5, level("unknown", "disagreement", "disagreement_centroid"), excuse),
    ),
    **{
        f"F3 a force sensor that reads nothing in a grip is not believed until its pad is free, charge: {charge}": (
            lambda charge=charge: Bed(1, charge=charge).hold(),
            [
                reads_nothing, run(0.1), *[because("disagreement_contact"), run(1.0)] * 3, OTHER_STABLE, lease,
                ask("gripper.open", drop=True), run(1.0), level("no_contact"), status(streams={PAD: {"masked": []}}),
                excuse,  # at first, and for the last quarter of the release, it was believed
            ],
        )
        for charge in (False, True)
    },
    "F4 a tare in contact is refused and changes nothing": (
        HELD,
        [
            ask("tare", ("in_contact", "finger"), finger="left", seconds=0.1), run(0.3),
            status(fingers={"left": {"tare_id": 1}}), feels(8.0),
        ],
    ),
    "F4 a tare that a contact interrupts is given up": (
        lambda: Bed(1).free(),
        [ask("tare", finger="left", seconds=0.5), Bed.close, status(fingers={"left": {"tare_id": 1}}), feels(8.0)],
    ),
    **{
        f"N1 component {place} that is no number changes no later result": (
            HELD,
            [
                step
                for value in STRANGE
                for step in (
                    strike(one_number(place, value), WRENCH), run(0.03), because("invalid"),
                    strike(one_number(place, value, share=0.1), WRENCH), run(0.02), strike(None), recovers(0.1),
                    feels(8.0),
                )
            ],
        )
        for place in range(6)
    },
    **{
        f"N1 N3 N4 {what} numbers are not stable and do no lasting harm": (
            HELD,
            [
                strike(Edit(wrench(lambda six, _, number=number: [number] * 6))), run(0.05), not_stable, *MENDED,
                excuse,  # one reading is like another
            ],
        )
        for what, number in (("denormal", 1e-42), ("huge", 3e38))
    },
    "N2 A3 a set point that is no force is refused": (
        HELD,
        [
            lease, *(ask("grip.set", (code, "force_n"), force_n=force_n) for force_n, code in (
                *((n, "not_finite") for n in STRANGE), *((n, "out_of_range") for n in (-1.0, 1e300, 0.0)),
                *((n, "bad_type") for n in (True, "7", None)),
            )),
            run(0.1), presses(8.0),
        ],
    ),
    **{
        f"N3 counts of {count} do not wrap": (
            HELD,
            [
                strike(Edit(pad(lambda row, counts, _, count=count: counts * 0 + count)), PAD), run(0.1),
                used_or_unknown, *MENDED, excuse,  # the image was believed
            ],
        )
        for count in (-32_768, 32_767)
    },
    **{
        f"T1 faulty taxels are masked and reported within a second of moving load: {what}": (
            HELD,
            [
                strike(faulty_taxels(count, columns), PAD), *wobble(5), unwell(stream=PAD), STABLE, quiet_for_a_second,
                status(streams={PAD: {"masked": [ROW * 16 + column for column in columns]}}),
            ],
        )
        for what, count, columns in (
            ("dead", 0, [COLUMN]), ("stuck", 700, [COLUMN]), ("hot", 9000, [COLUMN]), ("saturated", 32_767, [COLUMN]),
            ("a lost row", 0, [*range(16)]),
        )
    },
    "T2 two images mixed": (HELD, struck(PAD, mixed_scans, 0.1, BLIND)),
    "T2 a charge pad that missed too much is unknown until it is free again": (
        lambda: Bed(1, charge=True).hold(), [strike(Drop, PAD), run(0.5), strike(Split, PAD), run(0.3), BLIND],
    ),
    "T3 a frozen array is reported while the force moves": (
        HELD,
        [
            strike(lambda _: Edit(pad(Frozen().row)), PAD), *wobble(1), because("stuck"), failed(stream=PAD),
            *MENDED, excuse,  # the image was believed until it was found out
        ],
    ),
    **{
        f"T4 hum and a drifting baseline are no slip, charge: {charge}": (
            lambda charge=charge: Bed(1, charge=charge),
            [strike(Edit(pad(hum), lies=False), PAD), hold, forget, run(1.0), quiet_for_a_second],
        )
        for charge in (False, True)
    },
}  # fmt: skip


@pytest.mark.parametrize("name", COURSES)
def test_A3_F1_F2_F3_F4_N1_N2_N3_N4_T1_T2_T3_T4_a_fault_of_a_sensor(name):
    play(COURSES[name])
