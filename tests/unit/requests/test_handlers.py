"""Requests are checked, carried out at most once, and answered; engine and real bytes."""

from __future__ import annotations

import pytest
from engine_rig import Run
from nanoseconds import MS
from run_courses import ask, follow, status, wait


def test_hello_returns_boot_and_clock(run: Run) -> None:
    reply = run.ask("hello", boot=..., deadline_ns=...)
    assert reply["result"] == {"boot": "b00t", "t_ns": run.t_ns, "version": 1, "fingers": ["left", "right"]}
    assert reply["t_ns"] == run.t_ns


@pytest.mark.parametrize("request_id", ["c41f-7", 0, -5, 2**40, ""])
def test_a_reply_repeats_the_id_of_its_request(run: Run, request_id: str | int) -> None:
    assert run.ask("status", id=request_id)["id"] == run.ask("no.such.op", id=request_id)["id"] == request_id


def test_A2_a_repeated_request_gets_the_same_reply_and_is_carried_out_once(run: Run) -> None:
    once = {"id": "c-1", "deadline_ns": run.t_ns + 400 * MS}
    first = run.ask("record.start", **once)
    run.wait(100)
    assert run.ask("record.start", **once) == first
    late = [ask("record.start", ("deadline_passed", "deadline_ns"), **once)]
    others = [
        ask("record.stop", ("repeated_id", "id"), id="c-1"),
        ask("record.start", ("replayed", ""), by=b"ben", **once),
    ]
    follow(run, [*others, status(recording={"running": True}), wait(300), *late])
