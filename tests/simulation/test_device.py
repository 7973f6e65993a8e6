"""Faults of the devices, group D: boot text, counters that jump, formats of another version, grippers in trouble."""

from __future__ import annotations

import struct

import pytest
from run_courses import ask, down, lease, status, up
from simulation.edits import gripper, rows_of, sealed
from simulation.faults import Drop, Edit, Text
from simulation.steps import (
    BLIND,
    HELD,
    PAD,
    STABLE,
    STALE,
    WRENCH,
    Course,
    play,
    recovers,
    replays,
    run,
    silent,
    strike,
    struck,
)

FAULT, ECHO = 2, 3
CODES = (5, 7, 8, 9, 10, 11, 12, 13, 14, 15)
LATCHED = ask("grip.set", ("fault_latched", ""), force_n=10.0)
WRONG_ECHO = Edit(gripper(lambda status: status.__setitem__(ECHO, status[ECHO] ^ 0x10)), lies=False)


def shows(code):
    """Return the fault of a gripper that reports this one."""
    return Edit(gripper(lambda status: status.__setitem__(FAULT, code)), lies=False)


def refuses_with_the_reason(bed):
    """What moves the gripper is refused: first for the latched fault, and then for the one that it still has."""
    fault = bed.watch.gripper["fault"]
    assert fault
    for refusal in ("fault_latched", "gripper_fault"):
        for op in ("grip.set", "gripper.close"):
            error = bed.ask(op, force_n=9.0)["error"]
            assert (error["code"], fault in error["message"]) == (refusal, True)
        assert bed.ask("fault.ack")["ok"]


def of_another_version(data, _):
    return b"".join(sealed(row[:2] + b"\2" + row[3:]) for row in rows_of(data))


def counts_anew(bed):
    """The pad counts its scans from 0 on again."""
    first = bed.said_ns // 5_000_000

    def renumbered(row):
        (scan,) = struct.unpack_from("<H", row, 4)
        return sealed(row[:4] + struct.pack("<H", (scan - first) % 65_536) + row[6:])

    bed.strike(Edit(lambda data, _: b"".join(map(renumbered, rows_of(data))), lies=False), PAD)


COURSES: dict[str, Course] = {
    "D1 boot text is no reading and no harm": (
        HELD,
        [
            down(WRENCH), strike(Text(), WRENCH), up(WRENCH), run(0.5), STALE, strike(None, WRENCH), up(WRENCH),
            recovers(), replays,
        ],
    ),
    "D2 a pad with another version of the format is not read": (
        HELD, struck(PAD, Edit(of_another_version), 0.1, BLIND),
    ),
    "D3 a gap in the scans is counted": (
        HELD,
        [
            *struck(PAD, Drop, 0.1, BLIND), run(0.01),
            status(streams={PAD: {"lost": pytest.approx(20, abs=2), "restarts": 0}}),
        ],
    ),
    "D3 a pad that restarts its count is reported as a restart and loses nothing else": (
        HELD,
        [counts_anew, run(0.2), STABLE, status(streams={PAD: {"restarts": 1, "lost": pytest.approx(0.5, abs=0.5)}})],
    ),
    "D4 a gripper that does not answer is not moved": (
        HELD,
        [
            strike(Drop, "gripper"), run(0.5), lease, LATCHED, silent("no_answer", stream="gripper"), STABLE,
            strike(None, "gripper"), run(0.5), lease, LATCHED, ask("fault.ack", {"fault": "no_answer"}),
            ask("grip.set", force_n=10.0),
        ],
    ),
    "D4 every fault of the gripper is shown and refuses what moves it": (
        HELD,
        [
            *(
                step
                for code in CODES
                for step in (strike(shows(code), "gripper"), run(0.06), lease, refuses_with_the_reason)
            ),
            strike(None, "gripper"), run(0.06), status(gripper={"fault": ""}), ask("grip.set", force_n=9.0),
        ],
    ),
    "D5 an echo of another command is reported within three polls": (
        HELD,
        [
            step
            for fault, echo_ok in ((None, True), (WRONG_ECHO, False), (None, True))
            for step in (strike(fault, "gripper"), run(0.06), status(gripper={"echo_ok": echo_ok}))
        ],
    ),
    "A6 a command that never reaches the gripper is reported": (
        HELD,
        [
            lease, lambda bed: setattr(bed.line("gripper"), "deaf", True), ask("grip.set", force_n=10.0), run(0.5),
            silent("command_lost", stream="gripper"), lease, LATCHED,
        ],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", COURSES)
def test_A6_D1_D2_D3_D4_D5_a_fault_of_a_device(name):
    play(COURSES[name])
