"""The daemon as a service: what it reports to systemd, and a config that is read again."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from daemon_peers import PATIENCE_S, Client, until
from service_rig import Rig, client_of, left_in, start

from slipd.recording.reader import open_recording

pytestmark = pytest.mark.process

WATCHDOG_S = 2.0


class Manager:
    """The service manager's side of the notify socket."""

    def __init__(self, path: Path) -> None:
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(str(path))
        self._socket.settimeout(0.05)
        self.heard: list[bytes] = []

    def until(self, pattern: bytes) -> None:
        """Wait for a report that matches, after those of earlier calls."""
        until_s = time.monotonic() + PATIENCE_S
        while not (self.receive() and re.search(pattern, self.heard[-1])):
            assert time.monotonic() < until_s, (pattern, self.heard)

    def receive(self) -> bool:
        """Return whether another report came within a moment."""
        try:
            self.heard.append(self._socket.recv(4096))
        except TimeoutError:
            return False
        return True

    def close(self) -> None:
        self._socket.close()


@contextmanager
def service(rig: Rig, tmp_path: Path) -> Iterator[tuple[Manager, subprocess.Popen[str], Client]]:
    """A daemon that a service manager started, with a watchdog."""
    manager = Manager(tmp_path / "notify")
    environment = os.environ | {
        "NOTIFY_SOCKET": str(tmp_path / "notify"),
        "WATCHDOG_USEC": str(round(WATCHDOG_S * 1e6)),
    }
    with start(rig.file, env=environment, stdin=subprocess.DEVNULL) as process:
        client = client_of(process)
        try:
            yield manager, process, client
        finally:
            client.close()
            manager.close()


async def test_P2_P4_G2_a_service_reports_is_watched_and_reads_its_config_again(rig: Rig, tmp_path: Path) -> None:
    rig.pad.unplug()  # a stream that is missing is no failed start
    with service(rig, tmp_path) as (manager, process, client):
        manager.until(b"^READY=1$")
        manager.until(b"^STATUS=0 of 2 streams are read; left.*no such port")
        manager.until(b"^WATCHDOG=1$")

        process.send_signal(signal.SIGSTOP)  # P2: a daemon that stands still does not feed the watchdog
        while manager.receive():
            pass
        count, until_s = len(manager.heard), time.monotonic() + WATCHDOG_S
        while time.monotonic() < until_s:
            assert not manager.receive()
        process.send_signal(signal.SIGCONT)
        manager.until(b"^WATCHDOG=1$")
        assert len(manager.heard) > count

        good = rig.file.read_text(encoding="utf-8")
        first_id = (await until(lambda: client.hear("status")))[-1]["config_id"]
        for bad in (good[: len(good) // 2] + "[", "", good.replace("bota", "nobody's sensor")):  # G2: half-written
            rig.file.write_text(bad, encoding="utf-8")
            process.send_signal(signal.SIGHUP)
            manager.until(b"^STATUS=.*config: the config read before is kept: ")
            await until(lambda: set(client.hear("status")[-1]["notices"]) == {"config"})
            assert client.hear("status")[-1]["config_id"] == first_id
            rig.file.write_text(good, encoding="utf-8")
            process.send_signal(signal.SIGHUP)
            await until(lambda: client.hear("status")[-1]["notices"] == {})

        taken = f'\n[bus]\npublish = "ipc://{tmp_path}/nowhere/publish"\n'  # no run can start with it
        rig.file.write_text(good + taken, encoding="utf-8")
        process.send_signal(signal.SIGHUP)
        manager.until(b"^RELOADING=1")
        manager.until(b"^READY=1$")
        manager.until(b"^STATUS=.*the config read before is kept: .*nowhere/publish: there is no directory")
        status = (await until(lambda: client.hear("status")[-1]["notices"] and client.hear("status")))[-1]
        assert status["config_id"] == first_id

        rig.file.write_text(good.replace("mu = 0.5", "mu = 0.4"), encoding="utf-8")
        process.send_signal(signal.SIGHUP)
        manager.until(b"^RELOADING=1\nMONOTONIC_USEC=")
        manager.until(b"^READY=1$")
        status = (await until(lambda: [body for body in client.hear("status") if body["config_id"] != first_id]))[-1]
        assert status["boot"] != client.heard[0][1]["boot"], "a new run"

        rig.file.unlink()
        os.mkfifo(rig.file)
        process.send_signal(signal.SIGHUP)
        with rig.file.open("w", encoding="utf-8"):  # opens as soon as the daemon reads it, and nothing is written
            process.send_signal(signal.SIGTERM)
            manager.until(b"^STOPPING=1$")
            assert process.wait(PATIENCE_S) == 0


async def test_G2_without_any_config_that_starts_the_daemon_ends_and_names_both_reasons(
    rig: Rig, tmp_path: Path
) -> None:
    def endpoint(folder: str) -> str:
        return f'\n[bus]\npublish = "ipc://{tmp_path}/{folder}/publish"\n'

    text, record = rig.file.read_text(encoding="utf-8"), tmp_path / "run.mcap"
    (tmp_path / "first").mkdir()
    rig.file.write_text(text + endpoint("first"), encoding="utf-8")
    with start(rig.file, "--record", str(record), stdin=subprocess.DEVNULL) as process:
        client = client_of(process)
        await until(lambda: client.hear("wrench.left"), rig.send)
        client.close()
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
    assert "run-2.mcap" not in (left_in(tmp_path) or [])
    recorded = open_recording(record)
    assert sum(1 for _ in recorded.entries()) > 0
    assert recorded.complete


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
    before = [sys.executable, "-c", SLOW_DISK, str(begun), str(done)]
    with start(rig.file, "--record", str(record), command=before, stdin=subprocess.DEVNULL) as process:
        client = client_of(process)
        await until(lambda: client.hear("wrench.left"), rig.send)
        client.close()
        rig.file.write_text(rig.file.read_text(encoding="utf-8").replace("mu = 0.5", "mu = 0.4"), encoding="utf-8")
        process.send_signal(signal.SIGHUP)
        await until(begun.exists)
        for number in (signal.SIGTERM, signal.SIGINT):
            process.send_signal(number)
        done.touch()
        out, errors = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, out, "Traceback" in errors) == (0, "", False), errors
    recorded = open_recording(record)
    assert sum(1 for _ in recorded.entries()) > 0
    assert recorded.complete
    assert "run-2.mcap" not in (left_in(tmp_path) or []), "no second run"
