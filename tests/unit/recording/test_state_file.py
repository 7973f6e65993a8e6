"""The file in which a run keeps its state: whole or absent, private, and never a reason to wait or to fail."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from threading import Thread

import pytest

from slipd.recording.state_file import MOST_BYTES, StateFile


def kept(path: Path, *texts: str) -> StateFile:
    with closing(StateFile(path)) as file:
        for text in texts:
            file.keep(text)
    return file


def restored(path: Path) -> tuple[str, str]:
    """Return the text that was kept, and what is wrong with it."""
    found = StateFile(path).read()
    assert found is not None
    return found.text, found.problem


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A file in which nothing was kept yet."""
    path = tmp_path / "state" / "rig.json"
    assert StateFile(path).read() is None
    return path


def test_the_newest_text_is_read_again_and_only_this_user_may(path: Path) -> None:
    kept(path, "one", "two", "two")
    assert restored(path) == ("two", "")
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert [each.name for each in path.parent.iterdir()] == ["rig.json"], "no draft is left"


def linked(path: Path) -> None:
    path.rename(path.with_name("elsewhere"))
    path.symlink_to("elsewhere")


FOREIGN: dict[str, Callable[[Path], object]] = {
    "writable": lambda path: path.chmod(0o620),
    "link": linked,
    "pipe": lambda path: (path.unlink(), os.mkfifo(path)),
    "folder": lambda path: (path.unlink(), path.mkdir()),
    "size": lambda path: path.write_bytes(bytes(MOST_BYTES + 1)),
    "text": lambda path: path.write_bytes(b"\xff"),
    "open folder": lambda path: path.parent.chmod(0o777),
}


@pytest.mark.parametrize("what", FOREIGN)
def test_what_another_could_have_put_there_is_not_read(path: Path, what: str) -> None:
    kept(path, "text")
    FOREIGN[what](path)
    text, problem = restored(path)
    assert (text, str(path.parent) in problem) == ("", True)


def test_a_disk_that_fails_is_reported_and_the_file_before_stays(path: Path) -> None:
    kept(path, "text")
    path.unlink()
    path.mkdir()  # the file cannot take the place of a folder
    assert str(path) in kept(path, "more").problem
    assert [each.name for each in path.parent.iterdir()] == ["rig.json"]
    path.rmdir()
    assert kept(path, "again").problem == ""


def test_a_host_that_starts_no_more_threads_is_reported(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_: Thread) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(Thread, "start", refuse)
    assert "can't start new thread" in kept(path, "text").problem
