"""``slipd evaluate`` on recordings of real daemons: output, files and exit code."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from replays import RECORDINGS
from terminals import PseudoTerminal

from slipd.cli import main

parquet = pytest.importorskip("pyarrow.parquet")

DEMO, REFLEX = (str(RECORDINGS / f"{name}.mcap") for name in ("demo", "reflex"))
SLIPD = str(Path(sys.executable).with_name("slipd"))


@pytest.fixture(autouse=True)
def cache_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache"


def rows(out: str) -> dict[tuple[str, str], list[str]]:
    """The lines of the table by recording and config."""
    found, recording = {}, ""
    for line in out.split("\n\n")[0].splitlines()[1:]:
        cells = line.split()
        if not line.startswith(" "):
            recording = cells.pop(0)
        found[recording, cells[0]] = cells[1:]
    return found


def test_bad_recordings_do_not_lose_the_others(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    foreign, cut = tmp_path / "foreign", tmp_path / "cut.mcap"
    foreign.write_bytes(b"\xff\xfe no recording")
    cut.write_bytes(Path(REFLEX).read_bytes()[:-20_000])
    assert main(["evaluate", str(foreign), "none.mcap", str(cut), DEMO]) == 1
    captured = capsys.readouterr()
    table = rows(captured.out)
    assert table["foreign", "recorded"] == table["none.mcap", "recorded"] == ["no", "run,", "see", "below"]
    assert float(table["cut.mcap", "recorded"][0]) > 1.0, "as far as it goes"
    assert float(table["demo.mcap", "recorded"][0]) > 3.0
    told = captured.err.splitlines()
    assert told[0] == f"slipd: {foreign}: not an MCAP file, and so not a recording of slipd"
    assert told[1] == "slipd: none.mcap: cannot be opened: No such file or directory"
    assert told[2].startswith(f"slipd: {cut}: ")
    assert len(told) == 3


LISTS_MODULES = """
import sys
from slipd.cli import main
code = main(sys.argv[1:])
print(*sorted(sys.modules), file=sys.stderr)
sys.exit(code)
"""

ENGINE = {"numba", "scipy", "pydantic", "mcap", "slipd.engine", "slipd.fusion", "slipd.devices", "slipd.config"}


@pytest.mark.process
def test_no_engine_is_loaded_where_every_result_is_kept(tmp_path: Path) -> None:
    foreign = tmp_path / "foreign.mcap"
    foreign.write_bytes(b"no recording")
    command = ["evaluate", DEMO, str(foreign)]
    assert main(command) == 1, "one of them is no recording"
    assert set(sys.modules) >= ENGINE
    for table in ([], ["--out", str(tmp_path / "runs.parquet")]):
        again = [sys.executable, "-c", LISTS_MODULES, *command, *table]
        done = subprocess.run(again, capture_output=True, text=True, check=False, timeout=100)
        assert done.returncode == 1
        loaded = set(done.stderr.splitlines()[-1].split())
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


class Batch:
    """A batch of nine recordings in processes, which a pipe that nobody writes to keeps from ending."""

    def __init__(self, folder: Path) -> None:
        recordings, waits = folder / "recordings", folder / "waits.mcap"
        recordings.mkdir()
        for number in range(9):
            shutil.copy(DEMO, recordings / f"{number}.mcap")
            with (recordings / f"{number}.mcap").open("ab") as file:
                file.write(bytes(number))  # another recording, by its hash
        os.mkfifo(waits)
        self.results, self.table = folder / "results", folder / "runs.parquet"
        options = ["--results", str(self.results), "--out", str(self.table)]
        self.command = [SLIPD, "evaluate", *options, str(recordings)]
        self.process = subprocess.Popen(
            [*self.command, str(waits)], stderr=subprocess.PIPE, text=True, start_new_session=True
        )

    def wait_for_a_result(self) -> None:
        deadline_s = time.monotonic() + 100.0
        while not self.kept() and self.process.poll() is None and time.monotonic() < deadline_s:
            time.sleep(0.01)
        assert self.process.returncode is None

    def kept(self) -> int:
        return len(list(self.results.glob("*.json")))

    def others(self) -> list[int]:
        """The other processes of the session, which are those that replay."""
        found = []
        for path in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                session = int((path / "stat").read_text().rpartition(")")[2].split()[3])
                if session == self.process.pid != int(path.name):
                    found.append(int(path.name))
        return found


@pytest.mark.long
@pytest.mark.process
def test_an_interrupted_batch_goes_on_where_it_ended(tmp_path: Path) -> None:
    batch = Batch(tmp_path)
    with batch.process as process:
        batch.wait_for_a_result()
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does
        _, told = process.communicate(timeout=60)
    kept = batch.kept()
    assert kept > 0
    assert (process.returncode, told) == (130, "slipd: interrupted; the same command goes on from here\n")
    assert not batch.table.exists()
    again = subprocess.run(batch.command, capture_output=True, text=True, check=False, timeout=100)
    assert f"9 runs of 9 recordings, {kept} of them known before, 0 failed" in again.stdout
    assert parquet.read_table(batch.table).num_rows == 9


@pytest.mark.long
@pytest.mark.process
def test_a_killed_batch_leaves_no_process(tmp_path: Path) -> None:
    batch = Batch(tmp_path)
    with batch.process as process:
        batch.wait_for_a_result()
        assert batch.others()
        process.kill()
    deadline_s = time.monotonic() + 60.0
    while batch.others() and time.monotonic() < deadline_s:
        time.sleep(0.05)
    assert batch.others() == []
