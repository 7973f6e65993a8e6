"""What the status of a daemon is made into: repairs, one line, and a bundle without secrets."""

from __future__ import annotations

import json
import os
import re
import stat
import tarfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from engine_rig import RIG, Run
from project import DOCS

from slipd.events import HostNotice, LinkDown, RecordingChanged, Tick
from slipd.recording.mcap_file import EVENTS, RecordingFile, RunHead
from slipd.recording.reader import open_recording
from slipd_client.diagnose import REMOVED, Bundle, without_secrets
from slipd_client.errors import CallError
from slipd_client.messages import decode, encode
from slipd_client.messages.names import DAEMON_LATE, GRIP_UNKNOWN, REASONS
from slipd_client.repairs import FINGER_REPAIRS, repairs, summary
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


def stream(**changes: Any) -> dict[str, Any]:
    return WELL | {"streams": {"left.wrench": WELL["streams"]["left.wrench"] | changes}}


LATE = stream(health=1, message=f"{DAEMON_LATE} 0.04 s: readings waited, the sensor went on")
"""A stream that waited for the daemon needs no repair, and excuses no finger."""

UNKNOWN_GRIP = {"streams": {"gripper": {"health": 2, "message": f"{GRIP_UNKNOWN}, and stays as it is"}}}


def failed(why: str) -> dict[str, Any]:
    failure = f"/r 1.mcap: the recording stopped: {why}"
    return WELL | {"recording": {"state": "failed", "failure": failure, "path": "/r 1.mcap"}}


PORT, DISK = "ls -l /dev/left /dev/serial/by-id", "recording-failed"


@pytest.mark.parametrize(
    ("status", "number", "command"),
    [
        (stream(health=1), "stream-degraded", "slipctl watch"),
        (stream(health=1, message="taxels are masked: hot 3"), "stream-degraded", "slipctl view"),
        (stream(health=1, message="no fresh gravity: …"), "stream-degraded", "slipctl gravity left --help"),
        (stream(health=3), "stream-silent", PORT),
        (stream(health=2), "stream-fault", "slipctl watch"),
        (stream(health=2, age_s=5.0), "stream-fault", PORT),
        (stream(health=2, age_s=None, address="udp://192.168.1.1:49152"), "stream-missing", "ping -c 3 192.168.1.1"),
        (stream(health=2, age_s=5.0, address="tcp://[fe80::1]:1000"), "stream-fault", "ping -c 3 fe80::1"),
        (stream(health=3, address="ws://sensors"), "stream-silent", "ping -c 3 sensors"),
        (stream(health=3, address="ipc:///run/own"), "stream-silent", "slipctl status --json"),
        (failed("Read-only file system"), DISK, "findmnt --target '/r 1.mcap'"),
        (failed("Input/output error"), DISK, "dmesg --level err"),
        (failed("No space left on device"), DISK, "df -h"),
    ],
)
def test_a_stream_that_is_not_well_and_a_recording_that_failed_are_to_be_looked_at(
    status: dict[str, Any], number: str, command: str
) -> None:
    [repair] = repairs(status)
    about = "recording" if number == DISK else "left.wrench"
    assert (repair.id, repair.about, repair.command) == (number, about, command)


@pytest.mark.parametrize("reason", FINGER_REPAIRS)
def test_a_finger_names_the_command_that_mends_it(reason: str) -> None:
    [repair] = repairs(WELL | {"fingers": {"left": {"level": "unknown", "reasons": [reason]}}})
    assert repair.problem == REASONS[reason]
    parser().parse_args(repair.command.removeprefix("slipctl ").removesuffix(" --help").split())


@pytest.mark.parametrize(
    ("changes", "found"),
    [
        ({}, []),
        (LATE, []),
        (LATE | {"fingers": {"left": {"level": "unknown", "reasons": ["stuck"]}}}, ["finger-unknown"]),
        (LATE | {"late_s": 0.3}, ["daemon-late"]),
        (UNKNOWN_GRIP | {"notices": {"config": "cannot be read"}}, ["gripper-force-unknown", "config-kept"]),
        ({"late_s": 2.0}, ["daemon-late"]),
        ({"notices": {"realtime": "no", "config": "kept"}}, ["config-kept", "realtime-refused"]),
        ({"notices": {"latency left.wrench": "held back in /sys/x"}}, ["adapter-latency"]),
        ({"recording": {"state": "failed", "failure": "disk full"}}, ["recording-failed"]),
        ({"run_recording": {"state": "limited", "failure": None}}, ["recording-limited"]),
        ({"incidents": {"saved": 1, "failure": "disk full"}}, ["incident-failed"]),
        ({"incidents": {"saved": 1, "not_saved": 1, "failure": None}}, []),
        (
            {
                "streams": {"gripper": {"health": 2, "message": "no_answer is latched: look at the gripper"}},
                "gripper": {"latched_fault": "no_answer", "active": False, "force_limit_n": None},
            },
            ["gripper-fault", "gripper-inactive", "gripper-no-limit"],
        ),
        ({"gripper": {"latched_fault": "", "active": True, "force_limit_n": 20.0}}, []),
    ],
)
def test_what_is_wrong_around_the_streams_is_listed_and_summed_up(changes: dict[str, Any], found: list[str]) -> None:
    status = WELL | changes
    assert [repair.id for repair in repairs(status)] == found
    assert ("streams are read;" in summary(status), "more)" in summary(status)) == (found != [], len(found) > 2)


def test_every_repair_has_its_section_in_the_documents() -> None:
    text = (DOCS / "health.md").read_text(encoding="utf-8")
    code = (DOCS.parent / "clients/slipd_client/repairs.py").read_text(encoding="utf-8")
    words = "stream|finger|friction|gravity|pad|gripper|recording|incident|daemon|config|realtime|state|adapter"
    known = re.findall(rf'"((?:{words})-[a-z-]+)"', code)
    assert set(re.findall(r"^## ([a-z-]+)$", text, re.MULTILINE)) == set(known)
    assert repairs(stream(health=3))[0].as_map()["link"] == "docs/health.md#stream-silent"


def test_the_status_of_a_real_engine_becomes_repairs() -> None:
    run = Run(RIG)
    run.tick()
    run.feed(HostNotice("config", "kept"))
    run.feed(RecordingChanged("", "/r.mcap", "failed", "disk full"))
    found = {repair.id for repair in repairs(run.published("status")[-1])}
    assert found >= {"stream-missing", "config-kept", "recording-failed"}


def test_every_line_for_people_fits_a_page_and_names_where_to_read_on(capsys: pytest.CaptureFixture[str]) -> None:
    reading = {"health": 2, "address": "udp://192.168.1.1:49152", "message": "its readings are far too long " * 9}
    found = stream(**reading) | {"fingers": {"left": {"level": "unknown", "reasons": ["not_tared"]}}}
    print_status(found, as_json=False)
    text = capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= 100
    assert ("\n          slipctl tare left all\n" in text, "ping" in text) == (True, False), "the device sends"
    assert "2 to repair, each explained in docs/health.md (slipd docs health)\n" in text


SECRET_URL = "ws://robot:hunter2@host:5000"
KEY = "rq:rM>}U?@Lns47E1%kR.o@n%FcmmsL/@{H8]yf7"


def contents(path: Path) -> dict[str, str]:
    with tarfile.open(path) as archive:
        return {member.name.rpartition("/")[2]: archive.extractfile(member).read().decode() for member in archive}


@pytest.mark.parametrize(
    ("text", "clean"),
    [
        ('password = "hunter 2" # mine', f'password = "{REMOVED}" # mine'),
        ("http://127.0.0.1:8000/?token=abc123&x=1", f"http://127.0.0.1:8000/?token={REMOVED}&x=1"),
        ('"api_key": "abc", "b": 1', f'"api_key": "{REMOVED}", "b": 1'),
        ('{"token": 123, "b": 1}', f'{{"token": {REMOVED}, "b": 1}}'),
        ("Authorization: Bearer eyJhbGciOi.J9.x", f"Authorization: {REMOVED}"),
        ("ws://user:word@host:5000/x", f"ws://{REMOVED}@host:5000/x"),
        (f'public = "{KEY}"', f'public = "{REMOVED}"'),
        (f"--server={KEY}, ({KEY}); {KEY}", f"--server={REMOVED}, ({REMOVED}); {REMOVED}"),
        ('"path": "/home/anna.b/run.mcap"', '"path": "~/run.mcap"'),
        ("/dev/serial/by-id/usb-FTDI_FT232R_A10KZP-0", "/dev/serial/by-id/usb-FTDI_FT232R_A10KZP-0"),
        ("mu = 0.5\nrows = 4\n", "mu = 0.5\nrows = 4\n"),
    ],
)
def test_secrets_are_removed_and_the_rest_stays(text: str, clean: str) -> None:
    assert without_secrets(text) == clean


def test_a_bundle_is_private_and_overwrites_nothing(tmp_path: Path) -> None:
    made, path = Bundle(), tmp_path / "out.tar.gz"
    made.add("config.toml", lambda: 'token = "x"\n')
    made.add("log.txt", lambda: (_ for _ in ()).throw(FileNotFoundError("no journal")))
    made.write(path)
    found = contents(path)
    assert (stat.S_IMODE(path.stat().st_mode), found["config.toml"]) == (0o600, f'token = "{REMOVED}"\n')
    assert "log.txt: no journal" in found["problems.txt"]
    for place, why in ((path, "exists, and is not overwritten"), (tmp_path / "nowhere" / "out", "cannot be written")):
        with pytest.raises(CallError, match=why):
            made.write(place)


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """A recording with a password in its config, in a message and in an event."""
    file = RecordingFile(tmp_path / "run.mcap", RunHead(f'port = "{SECRET_URL}"\n', "b", 0))
    file.add(0, 1, EVENTS, LinkDown("pads", f"{SECRET_URL} does not answer"))
    file.add(1, 2, "status", encode({"streams": [{"address": SECRET_URL, "rate_hz": 0.1}]}))
    file.add(2, 3, EVENTS, Tick())
    file.finish(3)
    return tmp_path / "run.mcap"


def test_the_secrets_inside_a_recording_are_removed_and_the_rest_stays(recording: Path, tmp_path: Path) -> None:
    made = Bundle()
    made.add_recording(recording)
    clean = tmp_path / "clean.mcap"
    clean.write_bytes(made.parts["run.mcap"])
    found = open_recording(clean)
    ((_, event), _), ((_, payload),) = found.events(), found.messages()
    address = f"ws://{REMOVED}@host:5000"
    assert (made.problems, found.config_text, event, decode(payload)["streams"]) == (
        [],
        f'port = "{address}"\n',
        LinkDown("pads", f"{address} does not answer"),
        [{"address": address, "rate_hz": 0.1}],
    )


def test_only_recordings_of_this_user_are_added(recording: Path, tmp_path: Path) -> None:
    key, link, shared, missing = (tmp_path / f"{name}.mcap" for name in ("key", "link", "shared", "missing"))
    key.write_text("-----BEGIN OPENSSH PRIVATE KEY-----\n", encoding="utf-8")
    link.symlink_to(recording)
    shared.write_bytes(recording.read_bytes())
    shared.chmod(0o666)
    left_out = [
        (key, "it is not a recording of slipd"),
        (link, "it must be a file of the user"),
        (shared, "must not be writable by other users"),
        (missing, "No such file"),
    ]
    if os.geteuid() == 0:  # only root gives files away
        os.chown(recording, 54321, -1)
        left_out.append((recording, "it must be a file of the user"))
    made = Bundle()
    for path, why in left_out:
        made.add_recording(path)
        assert re.search(f"^{path}: left out: .*{why}", made.problems[-1])
    assert made.parts == {}


@pytest.mark.usefixtures("no_patience")
def test_without_a_daemon_the_bundle_has_what_there_is(
    tmp_path: Path, call: Callable[..., tuple[int, str, str]]
) -> None:
    config, out = tmp_path / "rig.toml", tmp_path / "out.tar.gz"
    config.write_text("mu = 0.5\n", encoding="utf-8")
    nowhere = f"ipc://{tmp_path}/nobody"
    arguments = ["--publish", nowhere, "--requests", nowhere, "diagnose", str(out), "--config", str(config)]
    code, said, _ = call(*arguments, "--seconds", "0.1")
    assert (code, "not in it: status.json" in said) == (0, True)
    found = contents(out)
    versions = json.loads(found["versions.json"])
    assert (found["config.toml"], versions["slipd-client"]) == ("mu = 0.5\n", f"{versions['slipd']} (in slipd)")
    assert re.match(r"\d+\.\d+", versions["slipd"])
    assert "status.json: " in found["problems.txt"]
    assert call(*arguments, "--seconds", "0.1")[0] == 2, "it is never overwritten"
    out.unlink()
    code, said, _ = call(*arguments, "--seconds", "0", "--json")
    assert (code, json.loads(said)["bytes"]["config.toml"]) == (0, len("mu = 0.5\n"))
