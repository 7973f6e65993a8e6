"""State of the recordings, and the names of their files."""

from __future__ import annotations

import re
from typing import Any

import pytest
from engine_rig import Run
from run_courses import Step, ask, down, follow, newest

from slipd.events import LinkUp, Record, RecordingChanged, Reply, Request, WallClock
from slipd.requests.handlers import RecordingState

NAME = "slipd-20231114T221500Z-b00t-1.mcap"  # the wall clock of the tests and their first 100 s
FILE = {"name": NAME, "path": f"/state/{NAME}"}
START, STOP = ask("record.start", FILE), ask("record.stop", FILE)
NOT_READY = ("not_ready", "")
OPEN = ["left.wrench", "right.pad", "gripper"]


def shows(state: str, name: str | None = NAME, key: str = "recording", **more: Any) -> Step:
    """Check a recording in the newest status."""
    usual = {"name": name, "path": name and f"/state/{name}", "state": state, "running": state == "running"}
    return newest("status", **{key: usual | {"failure": None, "lost": 0} | more})


def disk(state: str, *told: Any, name: str = NAME, path: str = FILE["path"], **more: int) -> Step:
    """The host reports what became of a file."""
    return lambda run: run.feed(RecordingChanged(name, path, state, *told, **more))


def disk_says(state: str) -> Step:
    """Let the host answer each further request for a recording like this."""
    return lambda run: vars(run).update(disk=lambda name: RecordingChanged(name, f"/state/{name}", state, "why"))


def asked(number: str, client: bytes, *expected: tuple[bytes, str, Any]) -> Step:
    """Send a request whose answer waits for the disk; check the replies so far: to whom, which, and its error."""

    def step(run: Run) -> None:
        run.feed(Request(client, START_BODY | {"id": number}))
        found = [one for _, one in run.out if isinstance(one, Reply)]
        assert [(one.client, one.body["id"], one.body.get("error", {}).get("code")) for one in found] == list(expected)

    return step


def begun(*names: str) -> Step:
    """Check the names of the files that the host was told to write; "": to write no more."""

    def step(run: Run) -> None:
        assert [one.name for _, one in run.out if isinstance(one, Record)] == list(names)

    return step


def with_open_links(run: Run) -> None:
    (record,) = (one for _, one in run.out if isinstance(one, Record))
    assert record.first[1:] == tuple(LinkUp(link, f"opened {link}") for link in OPEN)


START_BODY = {"v": 1, "op": "record.start", "boot": "b00t", "deadline_ns": 100_400_000_000}
WAITS, COPIED = (b"ben", "c", "replayed"), (b"ben", "d", "not_ready")
ANSWER = (b"ann", "c", None)
WHOLE = {"name": "", "path": "/data/run.mcap"}
COURSES: dict[str, list[Step]] = {
    "K3 a client starts and stops a recording that the daemon names": [
        *(ask("record.start", ("unknown_field", key), **{key: "../../etc/passwd"}) for key in ("name", "path", "file")),
        *(down("left.pad"), shows("none", None), START, shows("running"), with_open_links),
        *(ask("record.start", NOT_READY), STOP, shows("stopped"), begun(NAME, ""), ask("record.stop", NOT_READY)),
        ask("record.start", {"name": NAME.replace("-1.", "-2.")}),
    ],
    "K1 a failing disk ends the recording and is published": [
        *(START, disk("failed", "the disk is full", 3), shows("failed", failure="the disk is full", lost=3)),
        *(ask("record.stop", "the disk is full"), ask("record.start"), disk("failed", "reported late")),
        newest("status", recording={"failure": None}),  # of one that is over
    ],
    **{
        f"the reply waits for the disk and reports its error: {state}": [
            *(disk_says(state), ask("record.start", (code, "")), shows(state, failure="why")),
            ask("record.stop", NOT_READY),
        ]
        for state, code in (("failed", "record_failed"), ("limited", "no_room"))
    },
    "a copy of a waiting request is neither carried out nor answered twice": [
        *(asked("c", b"ann"), asked("c", b"ann"), asked("c", b"ben", WAITS), asked("d", b"ben", WAITS, COPIED)),
        *(disk("running"), asked("c", b"ann", WAITS, COPIED, ANSWER, ANSWER), disk("running", lost=5)),
        *(newest("status", recording={"lost": 5}), begun(NAME)),
    ],
    "a recording stopped before its file is created is answered": [
        *(asked("c", b"ann"), ask("record.stop", FILE | {"path": None}), disk("running"), shows("stopped")),
    ],
    "a limit reached after the stop leaves it stopped": [
        *(START, STOP, disk("limited", "as large as it may be"), shows("stopped")),
        *(disk("failed", "the last bytes had no room"), shows("failed", failure="the last bytes had no room")),
    ],
    "the recording of the whole run is published beside the one on request": [
        *(START, newest("status", run_recording=None), disk("running", **WHOLE)),
        shows("running", None, "run_recording", path="/data/run.mcap"),
        disk("failed", "No space left", 7, **WHOLE),
        shows("failed", None, "run_recording", path="/data/run.mcap", failure="No space left", lost=7),
        shows("running"),
    ],
    "a path that is no UTF-8 is published in escapes": [
        lambda run: vars(run).update(
            disk=lambda name: RecordingChanged(name, f"/\udcff/{name}", "failed", "/\udcff: why")
        ),
        *(ask("record.start", ("record_failed", "")), ask("record.stop", r"/\udcff: why")),
        shows("failed", path=rf"/\udcff/{NAME}", failure=r"/\udcff: why"),
    ],
    "a recording without events of the disk replays": [
        *(asked("c", b"ann"), newest("status", recording={"name": NAME, "running": True}), ask("record.stop")),
        newest("status", recording={"name": NAME, "running": False}),
        lambda run: run.feed(Request(b"ann", START_BODY | {"id": "d"})),
        newest("status", recording={"running": True}),
    ],
}


@pytest.mark.parametrize("name", COURSES)
def test_K1_K3_a_course_of_recordings(run: Run, name: str) -> None:
    follow(run, COURSES[name])


@pytest.mark.parametrize("wall_ns", [0, -(10**30), 2**63 - 1, 10**30])
def test_every_wall_clock_gives_a_valid_name(wall_ns: int) -> None:
    recordings = RecordingState("b", WallClock(wall_ns))
    assert not recordings.start(Request(b"ann", {}), 0)
    (record,) = recordings.due()
    assert re.fullmatch("slipd-[^/]*", record.name)
