"""Which recordings of a folder are deleted: never those of a run that goes on, and never by the wall clock."""

from __future__ import annotations

import errno
import fcntl
import gc
from pathlib import Path

import pytest

from slipd.recording.run_files import RunFiles


def record(files: RunFiles, stamp: str, boot: str) -> Path:
    path = files.place(files.folder / f"run-{stamp}-{boot}-0001.mcap")
    path.write_bytes(bytes(10))
    return path


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


@pytest.mark.parametrize(("files", "size", "left"), [(3, 10**6, "678"), (100, 25, "78"), (100, 5, ""), (0, 100, "")])
def test_K3_the_oldest_by_number_are_deleted_whatever_the_clock_says(
    tmp_path: Path, files: int, size: int, left: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    gc.collect()  # files that earlier tests left open
    handles, run = len(names(Path("/proc/self/fd"))), RunFiles(tmp_path, "a")
    lock, real = tmp_path / ".run-a.lock", fcntl.flock
    taken = iter([lock])

    def flock(*what: int) -> None:
        for path in taken:  # once, another run takes it for a left one
            path.unlink()
        real(*what)

    monkeypatch.setattr(fcntl, "flock", flock)
    kept = {str(n): record(run, f"{2030 - n}0101T000000Z", "a").name for n in range(1, 9)}
    others = {"slipd-20200101T000000Z-a.mcap", "incident-20200101T000000Z-a.mcap", "run-20200101T000000Z-a-0001.mcap"}
    for name in others:
        (tmp_path / name).write_bytes(bytes(10))
    run.delete_oldest("run", files, size)
    assert names(tmp_path) == {kept[n] for n in left} | others | {".run-a.lock"}
    lock.unlink()
    run.delete_oldest("run", files, size)
    run.close()
    run.close()
    assert ".run-a.lock" not in names(tmp_path)
    assert len(names(Path("/proc/self/fd"))) <= handles  # those of other tests may be closed meanwhile


def test_K3_no_run_deletes_the_files_of_another_that_goes_on(tmp_path: Path) -> None:
    one, two = RunFiles(tmp_path, "a"), RunFiles(tmp_path, "b")
    of_one = [record(one, "20260101T000000Z", "a") for _ in range(3)]
    one.delete_oldest("run", 3)
    of_two = [record(two, "20250101T000000Z", "b") for _ in range(3)]
    two.delete_oldest("run", 2)
    assert [path.exists() for path in of_one + of_two] == [True] * 3 + [False, True, True]
    one.close()
    two.delete_oldest("run", 2)
    assert [path.exists() for path in of_one + of_two] == [False] * 4 + [True, True]
    two.close()


def test_K3_the_files_of_a_killed_run_are_those_of_nobody(tmp_path: Path) -> None:
    (tmp_path / ".run-dead.lock").touch()
    run = RunFiles(tmp_path, "a")
    record(run, "20260101T000000Z", "dead")
    run.delete_oldest("run", 0)
    assert names(tmp_path) == {".run-a.lock"}
    run.close()


def test_on_a_disk_without_locks_nothing_of_a_run_that_may_go_on_is_deleted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unable(*_: object) -> None:
        raise OSError(errno.ENOLCK, "no locks")

    run = RunFiles(tmp_path, "a")
    (tmp_path / ".run-b.lock").touch()
    mine, other = record(run, "20260101T000000Z", "a"), record(run, "20260101T000000Z", "b")
    monkeypatch.setattr(fcntl, "flock", unable)
    run.delete_oldest("run", 0)
    assert (mine.exists(), other.exists()) == (False, True)
