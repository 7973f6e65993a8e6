"""``slipd evaluate`` on recordings of real daemons: output, files and exit code."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from replays import RECORDINGS
from rig_parts import wait_for
from terminals import PseudoTerminal

from slipd.cli import main

parquet = pytest.importorskip("pyarrow.parquet")

DEMO = str(RECORDINGS / "demo.mcap")
SLIPD = str(Path(sys.executable).with_name("slipd"))


@pytest.fixture(autouse=True)
def cache_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache"


LISTS_MODULES = """
import sys
from slipd.cli import main
code = main(sys.argv[1:])
print(*sorted(sys.modules), file=sys.stderr)
sys.exit(code)
"""

ENGINE = {"numba", "scipy", "pydantic", "mcap", "slipd.engine", "slipd.fusion", "slipd.devices", "slipd.config"}


@pytest.mark.process
def test_a_bad_recording_does_not_lose_another_and_no_engine_is_loaded_where_every_result_is_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    foreign = tmp_path / "foreign.mcap"
    foreign.write_bytes(b"no recording")
    command = ["evaluate", DEMO, str(foreign)]
    assert main(command) == 1
    assert re.search(r"^demo\.mcap +recorded +[\d.]+", capsys.readouterr().out, re.MULTILINE)
    assert set(sys.modules) >= ENGINE
    for table in ([], ["--out", str(tmp_path / "runs.parquet")]):
        again = [sys.executable, "-c", LISTS_MODULES, *command, *table]
        done = subprocess.run(again, capture_output=True, text=True, check=False, timeout=100)
        assert done.returncode == 1
        *told, modules = done.stderr.splitlines()
        assert told == [f"slipd: {foreign}: not an MCAP file, and so not a recording of slipd"]
        loaded = set(modules.split())
        assert loaded & ENGINE == set()
        assert ("pyarrow" in loaded) == bool(table)


@pytest.mark.process
def test_progress_is_shown_on_a_terminal_only() -> None:
    with PseudoTerminal() as terminal:
        process = subprocess.Popen([SLIPD, "evaluate", DEMO], stdout=subprocess.DEVNULL, stderr=terminal.slave)
        os.close(terminal.slave)
        while process.poll() is None or terminal.read(0.0):
            terminal.read(0.05)
        assert process.returncode == 0
        assert b"0 of 1 runs" in terminal.sent
        assert terminal.sent.endswith(b"\r\x1b[K"), "and erased at the end"


@pytest.mark.long
@pytest.mark.process
@pytest.mark.timeout(400)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_an_interrupted_batch_goes_on_where_it_ended_and_no_batch_leaves_a_process(
    tmp_path: Path, number: signal.Signals
) -> None:
    """Nine recordings are evaluated in processes; a pipe that nobody writes to keeps the batch from ending."""
    recordings, results, table = tmp_path / "recordings", tmp_path / "results", tmp_path / "runs.parquet"
    recordings.mkdir()
    for count in range(9):
        data = Path(DEMO).read_bytes() + bytes(count)  # another recording, by its hash
        (recordings / f"{count}.mcap").write_bytes(data)
    os.mkfifo(tmp_path / "waits.mcap")
    command = [SLIPD, "evaluate", "--results", str(results), "--out", str(table), str(recordings)]
    waiting = [*command, str(tmp_path / "waits.mcap")]
    with subprocess.Popen(waiting, stderr=subprocess.PIPE, text=True, start_new_session=True) as process:
        wait_for(lambda: list(results.glob("*.json")))
        if number == signal.SIGKILL:
            process.kill()
        else:
            os.killpg(process.pid, number)  # as a terminal does
        _, told = process.communicate(timeout=60)  # until the last process of the batch has closed the pipe
    kept = len(list(results.glob("*.json")))
    if number == signal.SIGINT:
        assert (process.returncode, told) == (130, "slipd: interrupted; the same command goes on from here\n")
    assert not table.exists()
    again = subprocess.run(command, capture_output=True, text=True, check=False, timeout=100)
    assert f"9 runs of 9 recordings, {kept} of them known before, 0 failed" in again.stdout
    assert parquet.read_table(table).num_rows == 9
