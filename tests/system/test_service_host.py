"""The daemon as a service: what it reports to systemd, and a config that is read again."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from loop_waits import PATIENCE_S, eventually
from service_rig import Rig, assert_complete, started

pytestmark = pytest.mark.process


@pytest.fixture
def told(tmp_path: Path) -> Iterator[Callable[[bytes], None]]:
    """The service manager's side: waits until the daemon reports what matches, after its reports of earlier calls."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        manager.settimeout(PATIENCE_S)

        def told(pattern: bytes) -> None:
            while not re.search(pattern, manager.recv(4096)):
                pass

        yield told


async def test_P4_G2_a_service_reports_is_watched_and_reads_its_config_again(
    rig: Rig, tmp_path: Path, told: Callable[[bytes], None]
) -> None:
    def reload(text: str) -> None:
        rig.file.write_text(text, encoding="utf-8")
        process.send_signal(signal.SIGHUP)

    rig.pad.unplug()  # a stream that is missing is no failed start
    variables = os.environ | {"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "2000000"}
    with started(rig.file, env=variables, stdin=subprocess.DEVNULL) as (process, client):
        told(b"^READY=1$")
        told(b"^STATUS=0 of 2 streams are read; left.*no such port")
        told(b"^WATCHDOG=1$")

        good = rig.file.read_text(encoding="utf-8")
        first_id = (await eventually(lambda: client.newest("status")))["config_id"]
        reload(good[: len(good) // 2] + "[")  # half-written
        told(b"^STATUS=.*config: the config read before is kept: ")
        await eventually(lambda: set(client.newest("status")["notices"]) == {"config"})
        reload(good)
        await eventually(lambda: client.newest("status")["notices"] == {})

        reload(good + f'\n[bus]\npublish = "ipc://{tmp_path}/nowhere/publish"\n')  # no run can start with it
        told(b"^RELOADING=1")
        told(b"^READY=1$")
        told(b"^STATUS=.*the config read before is kept: .*nowhere/publish: there is no directory")
        await eventually(lambda: client.newest("status")["notices"])
        assert {body["config_id"] for body in client.hear("status")} == {first_id}

        reload(good.replace("mu = 0.5", "mu = 0.4"))
        told(b"^RELOADING=1\nMONOTONIC_USEC=")
        told(b"^READY=1$")
        await eventually(lambda: client.newest("status")["config_id"] != first_id)
        assert client.newest("status")["boot"] != client.heard[0][1]["boot"], "a new run"

        rig.file.unlink()
        os.mkfifo(rig.file)
        process.send_signal(signal.SIGHUP)
        with rig.file.open("w", encoding="utf-8"):  # opens as soon as the daemon reads it, and nothing is written
            process.send_signal(signal.SIGTERM)
            told(b"^STOPPING=1$")
            assert process.wait(PATIENCE_S) == 0


async def test_G2_without_any_config_that_starts_the_daemon_ends_and_names_both_reasons(
    rig: Rig, tmp_path: Path
) -> None:
    def endpoint(folder: str) -> str:
        return f'\n[bus]\npublish = "ipc://{tmp_path}/{folder}/publish"\n'

    text = rig.file.read_text(encoding="utf-8")
    (tmp_path / "first").mkdir()
    rig.file.write_text(text + endpoint("first"), encoding="utf-8")
    with started(rig.file, "--record", str(tmp_path / "run.mcap"), stdin=subprocess.DEVNULL) as (process, client):
        await eventually(lambda: client.hear("wrench.left"), rig.send)
        (tmp_path / "first").rename(tmp_path / "moved")
        rig.file.write_text(text + endpoint("nowhere"), encoding="utf-8")
        process.send_signal(signal.SIGHUP)
        _, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 1
    assert re.search(
        rf"\nslipd: {rig.file}: neither the changed config nor the one before can start"
        r"\n  changed: .*nowhere/publish: there is no directory.*"
        r"\n  before: .*first/publish: there is no directory.*\n$",
        errors,
    ), errors
    assert "Traceback" not in errors
    assert not (tmp_path / "run-2.mcap").exists()
    assert_complete(tmp_path / "run.mcap")


SLOW_DISK = """
import sys, time
from pathlib import Path
from slipd.cli import main
from slipd.recording.mcap_file import RecordingFile

finish, begun, done = RecordingFile.finish, *map(Path, sys.argv[1:3])

def slowly(*arguments):
    begun.touch()
    while not done.exists():
        time.sleep(0.01)
    finish(*arguments)

RecordingFile.finish = slowly
del sys.argv[1:3]
main()
"""


async def test_P4_a_signal_during_a_reload_ends_the_daemon_once_its_recording_is_closed(
    rig: Rig, tmp_path: Path
) -> None:
    begun, done, record = tmp_path / "begun", tmp_path / "done", tmp_path / "run.mcap"
    slow = {"command": [sys.executable, "-c", SLOW_DISK, str(begun), str(done)], "stdin": subprocess.DEVNULL}
    with started(rig.file, "--record", str(record), **slow) as (process, client):
        await eventually(lambda: client.hear("wrench.left"), rig.send)
        rig.file.write_text(rig.file.read_text(encoding="utf-8").replace("mu = 0.5", "mu = 0.4"), encoding="utf-8")
        process.send_signal(signal.SIGHUP)
        await eventually(begun.exists)
        for number in (signal.SIGTERM, signal.SIGINT):
            process.send_signal(number)
        done.touch()
        out, errors = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, out, "Traceback" in errors) == (0, "", False), errors
    assert_complete(record)
    assert not (tmp_path / "run-2.mcap").exists(), "no second run"
