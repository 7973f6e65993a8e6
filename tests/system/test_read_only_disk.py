"""A disk that becomes read-only while the daemon records on it: the recordings end, and nothing else."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from breaking_disk import BreakingDisk, breaking_disk
from daemon_peers import PATIENCE_S, Client, until
from service_rig import Rig, asked, client_of, serving, start

from slipd import config
from slipd.recording.reader import open_recording
from slipd.tools.recordings.recover import recover
from slipd_client.health.repairs import repairs

READ_ONLY = "Read-only file system"
STOPPED = {READ_ONLY: "findmnt --target {path}", "Input/output error": "dmesg --level err"}
"""How the kernel reports the failure of the disk to a file that is open, by chance; what status advises then."""


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[BreakingDisk]:
    """A disk that can fail; the test is skipped where none can be mounted."""
    with breaking_disk(tmp_path) as mounted:
        yield mounted


def newest(client: Client, key: str) -> dict[str, Any]:
    """Return a part of the newest status; empty before the first."""
    heard = client.hear("status")
    return (heard[-1].get(key) or {}) if heard else {}


async def goes_on(client: Client, rig: Rig) -> None:
    """Wait for more verdicts."""
    heard = len(client.hear("slip.left"))
    await until(lambda: len(client.hear("slip.left")) > heard + 10, rig.send)


def advice(client: Client) -> dict[str, str]:
    """Return the command that ``slipctl status`` suggests for each fault."""
    return {repair.id: repair.command for repair in repairs(client.hear("status")[-1])}


@pytest.mark.process
async def test_K1_a_disk_that_becomes_read_only_ends_the_recording_and_the_run_goes_on(
    rig: Rig, disk: BreakingDisk
) -> None:
    path = disk.folder / "run.mcap"
    with start(rig.file, "--record", str(path)) as process:
        assert process.stderr is not None
        client = client_of(process)
        await until(lambda: sum(1 for _ in open_recording(path).entries()) > 10, rig.send)
        disk.fail()
        await until(lambda: newest(client, "run_recording").get("state") == "failed", rig.send)
        reason = newest(client, "run_recording")["failure"]
        beginning, _, why = reason.rpartition(": ")
        assert beginning == f"{path}: the recording stopped"
        assert advice(client)["recording-failed"] == STOPPED[why].format(path=path)
        await goes_on(client, rig)
        assert process.poll() is None
        client.close()
        process.terminate()
        assert process.wait(PATIENCE_S) == 1
        errors = process.stderr.read()
    assert re.search(rf"\nslipd: {reason}; (\d+) entries are missing\n$", errors)
    recorded = open_recording(path)
    assert sum(1 for _ in recorded.entries()) > 10
    assert recorded.fault is not None, "its end could not be written"


async def test_K1_a_folder_that_becomes_read_only_costs_its_recordings_alone_and_status_says_so(
    rig: Rig, disk: BreakingDisk, tmp_path: Path
) -> None:
    folder = disk.folder / "kept"
    limits = (
        f'[recording]\ndirectory = "{folder}"\nmin_free_bytes = 0\n[recording.continuous]\nenabled = true\n'
        "[recording.incidents]\nenabled = true\nafter_s = 0.2\n"
    )

    def slide() -> None:
        rig.pad.send_image()
        rig.wrench.send_wrench(2.1)

    async with serving(config.parse(rig.file.read_text(encoding="utf-8") + limits, "rig.toml")) as client:
        await until(lambda: newest(client, "run_recording").get("state") == "running", rig.send)
        [run] = folder.glob("run-*.mcap")
        await until(lambda: sum(1 for _ in open_recording(run).entries()) > 10, rig.send)
        disk.fail()
        await until(lambda: newest(client, "run_recording").get("state") == "failed", rig.send)
        await until(lambda: newest(client, "incidents").get("not_saved"), slide)
        refused = (await asked(client, "record.start"))["error"]
        assert refused["code"] == "record_failed"
        assert READ_ONLY in refused["message"]
        assert READ_ONLY in newest(client, "incidents")["failure"]
        assert {"recording-failed", "incident-failed"} <= advice(client).keys()
        await goes_on(client, rig)
    recover(run, tmp_path / "recovered.mcap")
    assert open_recording(tmp_path / "recovered.mcap").closed
