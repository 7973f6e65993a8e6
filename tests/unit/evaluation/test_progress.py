"""The progress bar, on a real terminal."""

from __future__ import annotations

import io
import sys
from collections.abc import Iterator

import pytest
from terminals import PseudoTerminal

from slipd.evaluation.progress import Progress


@pytest.fixture
def terminal() -> Iterator[PseudoTerminal]:
    with PseudoTerminal() as found:
        yield found


def on(terminal: PseudoTerminal, monkeypatch: pytest.MonkeyPatch, encoding: str = "utf-8") -> Progress:
    monkeypatch.setattr(sys, "stderr", open(terminal.slave, "w", encoding=encoding))  # noqa: PTH123, SIM115
    return Progress()


def shown(terminal: PseudoTerminal) -> str:
    while terminal.read(0.05):
        pass
    return terminal.lines[0]


def test_the_bar_grows_and_is_erased(terminal: PseudoTerminal, monkeypatch: pytest.MonkeyPatch) -> None:
    progress = on(terminal, monkeypatch)
    progress.show_runs(0, 3)
    assert shown(terminal) == "·" * 30 + " 0 of 3 runs"
    progress.show_runs(2, 3)
    assert shown(terminal).startswith("█" * 20 + "·" * 10 + " 2 of 3 runs, about ")
    progress.erase()
    assert shown(terminal) == ""
    sys.stderr.close()


def test_a_share_is_shown_in_percent_and_not_too_often(
    terminal: PseudoTerminal, monkeypatch: pytest.MonkeyPatch
) -> None:
    progress = on(terminal, monkeypatch, "ascii")
    for n in range(1000):
        progress.show_share(0.4 + n * 1e-6, "replayed")
    assert shown(terminal).startswith("#" * 12 + "." * 18 + " 40 % replayed")
    assert terminal.sent.count(b"replayed") < 1000
    sys.stderr.close()


def test_without_a_terminal_nothing_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    text = io.StringIO()
    monkeypatch.setattr(sys, "stderr", text)
    progress = Progress()
    progress.show_runs(1, 2)
    progress.show_share(0.5, "replayed")
    progress.erase()
    assert text.getvalue() == ""
