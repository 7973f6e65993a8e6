"""State of the recordings, and the names of their files."""

from __future__ import annotations

from typing import Any

import pytest

from slipd.events import LinkUp, Output, Record, RecordingChanged, Reply, Request
from slipd.requests.recording_state import RecordingState
from slipd.types.clocks import WallClock

Run = Any
NAME = "slipd-20231114T221500Z-b00t-1.mcap"  # the wall clock of the tests and their first 100 s


def records(run: Run) -> list[Record]:
    return [output for _, output in run.out if isinstance(output, Record)]


def shown(run: Run, key: str = "recording") -> dict[str, Any]:
    """A recording in the newest status."""
    return run.published("status")[-1][key]


def state(name: str | None, state: str, **more: Any) -> dict[str, Any]:
    path = name and f"/state/{name}"
    running = state == "running"
    return {"name": name, "path": path, "state": state, "running": running, "failure": None, "lost": 0} | more


def start(run: Run) -> dict[str, Any]:
    """A request whose answer waits for the disk."""
    return {"v": 1, "id": "c", "op": "record.start", "boot": "b00t", "deadline_ns": run.t_ns + 400_000_000}


def replies(outputs: list[Output]) -> list[Reply]:
    return [output for output in outputs if isinstance(output, Reply)]


def test_K3_a_client_starts_and_stops_a_recording_that_the_daemon_names(run: Run) -> None:
    for path in ("name", "path", "file"):
        assert run.refusal("record.start", **{path: "../../etc/passwd"}) == ("unknown_field", path)
    run.down("left.pad")
    assert run.published("status")[-1]["recording"] == state(None, "none")
    assert run.ask("record.start")["result"] == {"name": NAME, "path": f"/state/{NAME}"}
    assert shown(run) == state(NAME, "running")
    (begun,) = records(run)
    assert begun.name == NAME
    assert LinkUp("left.wrench", "opened left.wrench") in begun.opened
    assert [up.link for up in begun.opened[1:]] == ["left.wrench", "right.pad", "gripper"], "the links that are open"
    assert run.refusal("record.start") == ("not_ready", "")
    assert run.ask("record.stop")["result"] == {"name": NAME, "path": f"/state/{NAME}"}
    assert shown(run) == state(NAME, "stopped")
    assert records(run)[1:] == [Record("")]
    assert run.refusal("record.stop") == ("not_ready", "")
    assert run.ask("record.start")["result"]["name"] != NAME, "names are never used twice in a run"


def test_K1_a_failing_disk_ends_the_recording_and_is_published(run: Run) -> None:
    run.ask("record.start")
    run.feed(RecordingChanged(NAME, f"/state/{NAME}", "failed", "the disk is full", 3))
    assert shown(run) == state(NAME, "failed", failure="the disk is full", lost=3)
    assert "the disk is full" in run.ask("record.stop")["error"]["message"]
    assert run.ask("record.start")["ok"]
    run.feed(RecordingChanged(NAME, f"/state/{NAME}", "failed", "reported late"))
    assert shown(run)["failure"] is None, "of one that is over"


def test_the_reply_waits_for_the_disk_and_reports_its_error(run: Run) -> None:
    for state_of, code in (("failed", "record_failed"), ("limited", "no_room")):
        run.disk = lambda name, state=state_of: RecordingChanged(name, f"/state/{name}", state, "why")
        assert run.ask("record.start")["error"] == {"code": code, "message": "why", "field": ""}
        assert shown(run) == state(shown(run)["name"], state_of, failure="why")
    assert run.refusal("record.stop") == ("not_ready", "")


def test_a_copy_of_a_waiting_request_is_neither_carried_out_nor_answered_twice(run: Run) -> None:
    body = start(run)
    assert replies(run.feed(Request(b"ann", dict(body)))) == []
    assert replies(run.feed(Request(b"ann", dict(body)))) == []
    for again, code in ({}, "replayed"), ({"id": "d"}, "not_ready"):
        (refused,) = replies(run.feed(Request(b"ben", body | again)))
        assert refused.body["error"]["code"] == code
    (answer,) = replies(run.feed(RecordingChanged(NAME, f"/state/{NAME}", "running")))
    assert (answer.client, answer.body["id"], answer.body["ok"]) == (b"ann", "c", True)
    assert replies(run.feed(Request(b"ann", dict(body)))) == [answer]
    assert replies(run.feed(RecordingChanged(NAME, f"/state/{NAME}", "running", lost=5))) == []
    assert shown(run)["lost"] == 5
    assert [record.name for record in records(run)] == [NAME]


def test_a_recording_stopped_before_its_file_is_created_is_answered(run: Run) -> None:
    run.feed(Request(b"ann", start(run)))
    assert run.ask("record.stop")["result"] == {"name": NAME, "path": None}
    (answer,) = replies(run.feed(RecordingChanged(NAME, f"/state/{NAME}", "running")))
    assert answer.body["result"]["path"] == f"/state/{NAME}"
    assert shown(run) == state(NAME, "stopped")


def test_a_limit_reached_after_the_stop_leaves_it_stopped(run: Run) -> None:
    run.ask("record.start")
    run.ask("record.stop")
    run.feed(RecordingChanged(NAME, f"/state/{NAME}", "limited", "as large as it may be"))
    assert shown(run) == state(NAME, "stopped")
    run.feed(RecordingChanged(NAME, f"/state/{NAME}", "failed", "the last bytes had no room"))
    assert shown(run)["failure"] == "the last bytes had no room"


def test_the_recording_of_the_whole_run_is_published_beside_the_one_on_request(run: Run) -> None:
    run.ask("record.start")
    assert shown(run, "run_recording") is None
    run.feed(RecordingChanged("", "/data/run.mcap", "running"))
    assert shown(run, "run_recording") == state(None, "running", path="/data/run.mcap")
    run.feed(RecordingChanged("", "/data/run.mcap", "failed", "No space left", 7))
    failed = state(None, "failed", failure="No space left", lost=7, path="/data/run.mcap")
    assert shown(run, "run_recording") == failed
    assert shown(run) == state(NAME, "running")


def test_a_recording_without_events_of_the_disk_replays(run: Run) -> None:
    body = start(run)
    run.feed(Request(b"ann", body))
    assert (shown(run)["name"], shown(run)["running"]) == (NAME, True)
    assert run.ask("record.stop")["ok"]
    assert (shown(run)["name"], shown(run)["running"]) == (NAME, False)
    run.feed(Request(b"ann", body | {"id": "d"}))
    assert shown(run)["running"]


@pytest.mark.parametrize("wall_ns", [0, -(10**30), 2**63 - 1, 10**30])
def test_every_wall_clock_gives_a_valid_name(wall_ns: int) -> None:
    recordings = RecordingState("b", WallClock(wall_ns))
    assert recordings.start(Request(b"ann", {}), 0) is None
    (record,) = recordings.due()
    assert record.name.startswith("slipd-")
    assert "/" not in record.name
