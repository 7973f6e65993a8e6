"""What the status of a daemon is made into: a list of repairs, and one line."""

from __future__ import annotations

import re
from typing import Any

import pytest
from engine_rig import GRIPPER, LEFT, RIGHT, Run
from project import DOCS

from slipd.events import HostNotice, RecordingChanged
from slipd_client.health.repairs import FINGER_REPAIRS, Repair, repairs, summary
from slipd_client.messages.names import DAEMON_LATE, GRIP_UNKNOWN, REASONS
from slipd_client.slipctl_parser import parser
from slipd_client.watch import print_status

WELL: dict[str, Any] = {
    "streams": {"left.wrench": {"health": 0, "message": "", "address": "/dev/left", "age_s": 0.01}},
    "fingers": {"left": {"level": "stable", "reasons": []}},
    "gripper": None,
    "late_s": 0.0,
    "recording": {"state": "running", "failure": None},
    "run_recording": None,
    "notices": {},
}


def ids(found: list[Repair]) -> list[str]:
    return [repair.id for repair in found]


def stream(**changes: Any) -> dict[str, Any]:
    return WELL | {"streams": {"left.wrench": WELL["streams"]["left.wrench"] | changes}}


def test_a_daemon_that_is_well_needs_no_repair() -> None:
    assert repairs(WELL) == []
    assert summary(WELL) == "1 of 1 streams are read"


def test_a_stream_that_waited_for_the_daemon_needs_no_repair_and_excuses_no_finger() -> None:
    late = stream(health=1, message=f"{DAEMON_LATE} 0.04 s: readings waited, the sensor went on")
    assert repairs(late) == []
    assert ids(repairs(late | {"fingers": {"left": {"level": "unknown", "reasons": ["stuck"]}}})) == ["finger-unknown"]
    assert ids(repairs(late | {"late_s": 0.3})) == ["daemon-late"]


def test_a_grip_of_unknown_force_comes_first() -> None:
    fault = {"streams": {"gripper": {"health": 2, "message": f"{GRIP_UNKNOWN}, and stays as it is"}}}
    found = repairs(WELL | fault | {"notices": {"config": "cannot be read"}})
    assert ids(found) == ["gripper-force-unknown", "config-kept"]


@pytest.mark.parametrize(
    ("changes", "number", "command"),
    [
        ({"health": 1}, "stream-degraded", "slipctl watch"),
        ({"health": 3}, "stream-silent", "ls -l /dev/left /dev/serial/by-id"),
        ({"health": 2}, "stream-fault", "slipctl watch"),
        ({"health": 2, "age_s": 5.0}, "stream-fault", "ls -l /dev/left /dev/serial/by-id"),
        ({"health": 2, "age_s": None, "address": "udp://192.168.1.1:49152"}, "stream-missing", "ping -c 3 192.168.1.1"),
        ({"health": 2, "age_s": 5.0, "address": "tcp://[fe80::1]:1000"}, "stream-fault", "ping -c 3 fe80::1"),
        ({"health": 3, "address": "ws://sensors"}, "stream-silent", "ping -c 3 sensors"),
        ({"health": 3, "address": "ipc:///run/own"}, "stream-silent", "slipctl status --json"),
    ],
)
def test_a_stream_that_is_not_well_is_to_be_looked_at(changes: dict[str, Any], number: str, command: str) -> None:
    [repair] = repairs(stream(**changes))
    assert (repair.id, repair.about, repair.command) == (number, "left.wrench", command)


@pytest.mark.parametrize("reason", FINGER_REPAIRS)
def test_a_finger_names_the_command_that_mends_it(reason: str) -> None:
    status = WELL | {"fingers": {"left": {"level": "unknown", "reasons": [reason]}}}
    [repair] = repairs(status)
    assert repair.problem == REASONS[reason]
    parser().parse_args(repair.command.removeprefix("slipctl ").removesuffix(" --help").split())


@pytest.mark.parametrize(
    ("changes", "found"),
    [
        ({"late_s": 2.0}, ["daemon-late"]),
        ({"notices": {"realtime": "no", "config": "kept"}}, ["config-kept", "realtime-refused"]),
        ({"notices": {"latency left.wrench": "held back in /sys/x"}}, ["adapter-latency"]),
        ({"recording": {"state": "failed", "failure": "disk full"}}, ["recording-failed"]),
        ({"run_recording": {"state": "limited", "failure": None}}, ["recording-limited"]),
        ({"incidents": {"saved": 1, "failure": "disk full"}}, ["incident-failed"]),
        ({"incidents": {"saved": 1, "not_saved": 1, "failure": None}}, []),
        (
            {"gripper": {"latched_fault": "no_answer", "active": False, "force_limit_n": None}},
            ["gripper-fault", "gripper-inactive", "gripper-no-limit"],
        ),
        ({"gripper": {"latched_fault": "", "active": True, "force_limit_n": 20.0}}, []),
    ],
)
def test_what_is_wrong_around_the_streams_is_listed(changes: dict[str, Any], found: list[str]) -> None:
    assert ids(repairs(WELL | changes)) == found


def test_every_repair_has_its_section_in_the_documents() -> None:
    text = (DOCS / "health.md").read_text(encoding="utf-8")
    code = (DOCS.parent / "clients/slipd_client/health/repairs.py").read_text(encoding="utf-8")
    known = set(
        re.findall(
            r'"((?:stream|finger|friction|gravity|pad|gripper|recording|incident|daemon|config|realtime|state|adapter)-[a-z-]+)"',
            code,
        )
    )
    assert set(re.findall(r"^## ([a-z-]+)$", text, re.MULTILINE)) == known
    assert repairs(stream(health=3))[0].as_map()["link"] == "docs/health.md#stream-silent"


def test_the_status_of_a_real_engine_becomes_repairs() -> None:
    run = Run(LEFT + RIGHT + GRIPPER)
    run.tick()
    assert "stream-missing" in ids(repairs(run.published("status")[-1]))
    run.feed(HostNotice("config", "kept"))
    run.feed(RecordingChanged("", "/r.mcap", "failed", "disk full"))
    assert {"config-kept", "recording-failed"} <= set(ids(repairs(run.published("status")[-1])))


def test_every_line_for_people_fits_a_page_and_names_where_to_read_on(capsys: pytest.CaptureFixture[str]) -> None:
    reading = {"health": 2, "address": "udp://192.168.1.1:49152", "message": "its readings are far too long " * 9}
    found = stream(**reading) | {"fingers": {"left": {"level": "unknown", "reasons": ["not_tared"]}}}
    print_status(found, as_json=False)
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 100
    assert "          slipctl tare left all" in lines
    assert not any("ping" in line for line in lines), "the device sends"
    assert any(line.endswith("docs/health.md, under its id: slipd docs health") for line in lines)
