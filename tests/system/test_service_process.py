"""The daemon as a process: signals, a kill, a full disk."""

from __future__ import annotations

import asyncio
import os
import re
import resource
import signal
from pathlib import Path
from typing import Any

import pytest
from loop_waits import PATIENCE_S, eventually
from service_rig import Rig, assert_complete, started

from slipd import config
from slipd.recording.reader import Recording, open_recording
from slipd.recording.replay import replay
from slipd.service_run import Endpoints
from slipd_client.messages import decode, encode

pytestmark = pytest.mark.process


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Where the recording of the run is."""
    return tmp_path / "run.mcap"


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
async def test_P4_a_signal_ends_the_process_well(rig: Rig, runtime: Path, path: Path, number: signal.Signals) -> None:
    text = rig.file.read_text(encoding="utf-8").replace("mu = 0.5", "mu = 0.5  # MEASURE")
    rig.file.write_text(text, encoding="utf-8")
    (hint,) = [each for each in config.hints(rig.config, str(rig.file)) if "MEASURE" in each]
    with started(rig.file, "--record", str(path)) as (process, client):
        assert client.endpoints == Endpoints(f"ipc://{runtime}/publish", f"ipc://{runtime}/requests")
        await eventually(lambda: client.hear("wrench.left"), rig.send)
        process.send_signal(number)
        out, errors = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, out, "Traceback" in errors) == (0, "", False), errors
    assert f"WARNING slipd.service: {hint}\n" in errors, "as slipd check prints it"
    assert_complete(path)


def wrenches_in(recording: Recording) -> list[dict[str, Any]]:
    """Return the messages of the force sensor in a recording, which may still be written."""
    return [decode(payload) for topic, payload in recording.messages() if topic == "wrench.left"]


async def test_K2_a_killed_daemon_leaves_all_but_the_last_moment(rig: Rig, path: Path) -> None:
    with started(rig.file, "--record", str(path)) as (process, client):
        await eventually(lambda: len(client.hear("wrench.left")) > 100, rig.send)
        newest = client.newest("wrench.left")["seq"]
        await eventually(lambda: any(body["seq"] == newest for body in wrenches_in(open_recording(path))), rig.send)
        process.kill()
        process.wait()
        await asyncio.sleep(0.1)
        seen = {body["seq"]: body["t_ns"] for body in client.hear("wrench.left")}
    recorded = open_recording(path)
    kept = wrenches_in(recorded)
    assert kept[-1]["seq"] >= newest, "what is published reaches the file while the run goes on"
    assert {body["seq"] for body in kept} >= {seq for seq, t_ns in seen.items() if t_ns <= kept[-1]["t_ns"]}
    assert "ends without an end record" in str(recorded.fault)
    replayed = [encode(body) for topic, body in replay(open_recording(path)) if topic == "wrench.left"]
    assert replayed[: len(kept)] == [encode(body) for body in kept], "the last event may be there without its message"


async def test_K1_a_full_disk_ends_the_recording_and_says_so_and_the_run_goes_on(rig: Rig, path: Path) -> None:
    def stopped() -> dict[str, Any] | None:
        recording = client.newest("status").get("run_recording")
        return recording if recording and recording["state"] == "failed" else None

    def send() -> None:
        rig.send()
        rig.wrench.send(os.urandom(1000))

    with started(rig.file, "--record", str(path)) as (process, client):
        await eventually(lambda: sum(1 for _ in open_recording(path).entries()) > 10, rig.send)
        most = open_recording(path).path.stat().st_size + 3000
        resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (most, most))  # no file of it may be longer
        recording = await eventually(stopped, send)
        reason = f"{path}: the recording stopped: File too large"
        assert (recording["path"], recording["failure"]) == (str(path), reason)
        assert recording["lost"] > 0
        heard = len(client.hear("wrench.left"))
        await eventually(lambda: len(client.hear("wrench.left")) > heard + 10, rig.send)
        process.terminate()
        _, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 1
    assert f"ERROR slipd.recording.recorder: {reason}\n" in errors
    assert re.search(rf"\nslipd: {reason}; (\d+) entries are missing\n$", errors)
    recorded = open_recording(path)
    assert sum(1 for _ in recorded.entries()) > 0
    assert recorded.closed
    assert recorded.lost > recording["lost"]
    assert "stopped before the run did (File too large)" in str(recorded.fault)
