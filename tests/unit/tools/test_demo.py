"""The end of the demo: its summary says where the machine was too busy."""

from __future__ import annotations

from typing import Any

import pytest

from slipd.tools.demo_summary import Tally, print_summary
from slipd.tools.sim.robot_program import Change, Report

BEGIN: dict[str, Any] = {"t_s": 0.0, "t_ns": 0, "event": "begin"}
HOLD: dict[str, Any] = {"t_s": 10.0, "t_ns": 10**10, "event": "hold"}


def warned(*reasons: str, level: str = "warning") -> Change:
    return Change(1, 1, "left", level, rising=True, reasons=list(reasons), utilisation=0.9)


def test_a_scene_without_its_warnings_is_explained_by_what_the_machine_lost(capsys: pytest.CaptureFixture[str]) -> None:
    end = {"t_s": 18.0, "t_ns": 18 * 10**9, "event": "end", "dropped_bytes": {"left-pad": 300, "left-wrench": 12}}
    print_summary(Tally(missed=7), Report(refusals=["deadline_passed"]), [BEGIN, HOLD, end])
    told = capsys.readouterr().out
    assert "warnings: 0 (" in told
    assert "NOT AS EXPECTED: the rotation was not warned of\n" in told
    assert (
        "this machine was too busy: 312 bytes of the sensors were not read in time, 7 messages were missed, "
        "1 requests were too late or refused"
    ) in told
    assert "end other programs that compute, then run the demo again" in told
    slid = {"t_s": 13.0, "t_ns": 13 * 10**9, "event": "slide_begins"}
    print_summary(Tally(), Report(changes=[warned("rotation")]), [BEGIN, HOLD, slid])
    assert "NOT AS EXPECTED: the slip was not reported\n" in capsys.readouterr().out


def test_a_scene_that_went_as_it_should_or_ended_early_is_no_fault(capsys: pytest.CaptureFixture[str]) -> None:
    print_summary(Tally(missed=7), Report(changes=[warned("rotation")]), [BEGIN, HOLD])
    assert "NOT AS EXPECTED" not in capsys.readouterr().out
    print_summary(Tally(), Report(), [BEGIN])
    told = capsys.readouterr().out
    assert "ended before the box would turn: no warning is due yet" in told
    assert "busy" not in told
