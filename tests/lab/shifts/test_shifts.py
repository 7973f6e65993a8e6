"""What ``python -m shifts`` is made of: a minute of work, its faulty lines, and what its report finds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from random import Random

import pytest
from shifts.faulty_lines import KINDS, LINES, OF_HOST, FaultyLines
from shifts.shift_holdings import ShiftHoldings, containers_in
from shifts.shift_report import grown, overdrawn, recorded, traced, worked
from shifts.shift_watch import Found, watch
from shifts.slow_rig import SECOND, STEP_NS, SlowRig
from soak.faulty_gripper import KINDS as KINDS_OF_SOAK

from slipd.events import Bytes, LinkDown, LinkUp

MINUTE_H = 1 / 60


@pytest.fixture
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SLIPD_RUNTIME_DIR", str(tmp_path / "run"))
    return tmp_path


@pytest.mark.timeout(600)
def test_a_minute_of_work_is_sound_and_recorded(runtime: Path) -> None:
    found = watch(runtime, 1, MINUTE_H, 500.0)
    assert found.wrong == []
    assert found.heard == (found.published, 0), "a healthy subscriber misses nothing"
    assert found.hours == pytest.approx(MINUTE_H, rel=0.3)
    assert sum(found.jobs.values()) > 0
    assert found.files["run"] == (1, 1)
    assert found.sound
    assert f"| {found.events} |" in worked(found).markdown()
    assert f"missing by their numbers: {found.heard[1]}" in grown(found).text()
    assert "files of the continuous recording" in recorded(found).text()


@pytest.mark.timeout(600)
def test_a_run_with_traced_memory_names_lines_of_the_code(runtime: Path) -> None:
    found = watch(runtime, 2, MINUTE_H / 2, 500.0, trace=True)
    assert any("slipd" in place for place, _, _ in found.traced)
    assert "bytes" in traced(found).text()


def test_every_kind_of_fault_of_the_soak_befalls_the_simulated_lines() -> None:
    assert set(KINDS_OF_SOAK) <= {*KINDS, *OF_HOST}


@pytest.mark.parametrize("kind", [*KINDS, *OF_HOST])
def test_a_fault_ends_and_the_lines_work_again(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shifts.faulty_lines.KINDS", {kind: KINDS[kind]} if kind in KINDS else {})
    monkeypatch.setattr("shifts.faulty_lines.OF_HOST", (kind,) if kind in OF_HOST else ())
    lines, t_ns = FaultyLines(SlowRig(1), Random(1)), 0

    def let(seconds: float) -> list[object]:
        nonlocal t_ns
        events = []
        for _ in range(round(seconds * SECOND / STEP_NS)):
            t_ns += STEP_NS
            events += lines.step(t_ns)
        return events

    assert [event.link for event in let(1.0) if isinstance(event, LinkUp)] == list(LINES)
    lines.calm = False
    let(0.1)
    assert lines.faults == {kind: 1}
    lines.calm = True
    let(40.0)
    after = let(1.0)
    assert not any(isinstance(event, LinkDown) for event in after)
    assert {event.link for event in after if isinstance(event, Bytes)} == {*LINES} - {"gripper"}, "it only answers"


def test_devices_that_are_switched_off_leave_all_lines_and_come_back() -> None:
    lines = FaultyLines(SlowRig(1), Random(1))
    lines.step(STEP_NS)
    lines.off = True
    assert sorted(event.link for event in lines.step(2 * STEP_NS)) == sorted(LINES)
    assert lines.step(3 * STEP_NS) == []
    lines.off = False
    assert all(isinstance(event, LinkUp) for event in lines.step(4 * STEP_NS)[: len(LINES)])
    assert lines.off_ns == 2 * STEP_NS


def held(hours: float, leak: int) -> ShiftHoldings:
    return ShiftHoldings(hours, 200_000 + leak * 100, 1, 1, 1, 15 + leak, 1, 3, 1000, {"engine._kept": 5 + leak})


@pytest.mark.parametrize(("leak", "reached"), [(0, {"yes", ""}), (1, {"yes", "no", ""})])
def test_what_grows_is_found(leak: int, reached: set[str]) -> None:
    found = Found(10.0, took_s=1.0, samples=[held(n / 6, n * leak) for n in range(60)])
    table = grown(found)
    assert {row[-1] for row in table.rows} == reached
    assert overdrawn(table) == bool(leak)
    assert ("`engine._kept`" in table.notes[1]) == bool(leak)


def test_a_run_is_not_sound_where_something_was_lost() -> None:
    found = Found(1.0, heard=(10, 0), published=10)
    assert found.sound
    for worse in ({"heard": (10, 1)}, {"lost": 1}, {"wrong": ["x"]}, {"files": {"run": (2, 1)}}, {"not_ready": 1}):
        assert not replace(found, **worse).sound


def test_the_containers_of_a_thing_are_counted_by_their_place() -> None:
    rig = SlowRig(1)
    counts = containers_in({"a": [1, 2, 3], "b": [4], "rig": rig._gripper})
    assert counts["engine"] == 3
    assert counts["engine[]"] == 4, "alike places count together"
    assert any(place.startswith("engine[].") for place in counts)
