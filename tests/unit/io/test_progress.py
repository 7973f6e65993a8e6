from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from slipd.io.progress import Progress


@contextmanager
def terminal(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    ours, theirs = os.openpty()
    with os.fdopen(theirs, "w", encoding="utf-8") as stream:
        monkeypatch.setattr("sys.stderr", stream)
        yield ours
    os.close(ours)


def read_until(terminal: int, end: str) -> str:
    """Return what a terminal shows up to ``end``; one read may return a part of it."""
    shown = b""
    while not shown.endswith(end.encode()):
        shown += os.read(terminal, 4000)
    return shown.decode()


def test_a_terminal_shows_the_share_and_the_time_that_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([0.0, 0.05, 2.0, 3.0])
    with terminal(monkeypatch) as shown:
        progress = Progress(lambda done, of: f"{done} of {of}", now=lambda: next(clock))
        for done in (0, 1, 10, 40):
            progress.show(done, 40)
        progress.erase()
        lines = read_until(shown, "40 of 40\r\x1b[K").split("\r\x1b[K")
    assert lines == [
        "",
        "·" * 30 + " 0 of 40",
        "█" * 8 + "·" * 22 + " 10 of 40, about 6 s left",
        "█" * 30 + " 40 of 40",
        "",
    ]


def test_a_file_gets_nothing(capfd: pytest.CaptureFixture[str]) -> None:
    progress = Progress(lambda done, of: f"{done} of {of}")
    progress.show(1, 2)
    progress.erase()
    assert capfd.readouterr().err == ""


def test_what_takes_long_is_shown_again_until_it_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("slipd.io.progress.REPEATED_S", 0.001)
    with terminal(monkeypatch) as shown:
        with Progress(lambda done, of: f"{done} of {of}").shown() as show:
            show(1, 2)
            read_until(shown, "1 of 2")
            read_until(shown, "1 of 2")
        read_until(shown, "\r\x1b[K")
