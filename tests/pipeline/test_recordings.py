"""Which recording runs is the engine's to know, and its name the daemon's to choose."""

from __future__ import annotations

from typing import Any

import pytest

from slipd.grip.policy import Refusal
from slipd.pipeline.events import LinkUp, Record, RecordingFailed
from slipd.pipeline.recordings import Recordings

Run = Any
NAME = "slipd-20231114T221500Z-b00t-1.mcap"  # the wall clock of the tests and their first 100 s


def records(run: Run) -> list[Record]:
    return [output for _, output in run.out if isinstance(output, Record)]


def test_a_client_starts_and_stops_one_without_naming_it(run: Run) -> None:
    assert run.ask("record.start")["result"] == {"name": NAME}
    assert run.told("status")[-1]["recording"] == {"name": NAME, "running": True, "failure": None}
    (begun,) = records(run)
    assert begun.name == NAME
    assert LinkUp("left.wrench", "opened left.wrench") in begun.opened
    assert run.refusal("record.start") == ("not_ready", "")
    assert run.ask("record.stop")["result"] == {"name": NAME}
    assert run.told("status")[-1]["recording"] == {"name": NAME, "running": False, "failure": None}
    assert records(run)[1:] == [Record("")]
    assert run.refusal("record.stop") == ("not_ready", "")


def test_links_that_are_down_are_not_said_to_be_open(run: Run) -> None:
    run.down("left.pad")
    run.ask("record.start")
    assert [up.link for up in records(run)[0].opened] == ["left.wrench", "right.pad", "gripper"]


@pytest.mark.parametrize("path", ["name", "path", "file"])
def test_a_client_gives_no_path(run: Run, path: str) -> None:
    assert run.refusal("record.start", **{path: "../../etc/passwd"}) == ("unknown_field", path)
    assert records(run) == []


def test_k3_names_are_never_used_twice_in_a_run(run: Run) -> None:
    names = []
    for _ in range(3):
        names.append(run.ask("record.start")["result"]["name"])
        run.ask("record.stop")
    assert len(set(names)) == 3


def test_k1_a_disk_that_fails_ends_it_and_is_told(run: Run) -> None:
    run.ask("record.start")
    run.feed(RecordingFailed(NAME, "the disk is full"))
    assert run.told("status")[-1]["recording"] == {"name": NAME, "running": False, "failure": "the disk is full"}
    assert "the disk is full" in run.ask("record.stop")["error"]["message"]
    assert run.ask("record.start")["ok"]
    run.feed(RecordingFailed(NAME, "told late"))
    assert run.told("status")[-1]["recording"]["failure"] is None, "of one that is over"


@pytest.mark.parametrize("wall_ns", [0, -(10**30), 2**63 - 1, 10**30])
def test_any_clock_makes_a_name(wall_ns: int) -> None:
    recordings = Recordings("b", wall_ns)
    found = recordings.start(0)
    assert not isinstance(found, Refusal)
    assert found["name"].startswith("slipd-")
    assert "/" not in found["name"]
