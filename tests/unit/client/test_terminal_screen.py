"""A full screen on a real pseudo-terminal, and what is left of it afterwards."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator

import pytest
from terminals import PATIENCE_S, PseudoTerminal

Run = Callable[[str], "subprocess.Popen[bytes]"]

LEFT = b"\x1b[0m\x1b[?7h\x1b[?25h\x1b[?1049l"

PROGRAM = """
import os, sys, time
from slipd_client.terminal import TerminalScreen

def size():
    return os.get_terminal_size(sys.stdout.fileno())

with TerminalScreen(sys.stdout) as screen:
    {body}
"""


@pytest.fixture
def terminal() -> Iterator[PseudoTerminal]:
    with PseudoTerminal(40, 6) as found:
        yield found


@pytest.fixture
def run(terminal: PseudoTerminal) -> Iterator[Run]:
    """Starts a program on the terminal, with these lines in the ``with`` statement of its screen."""
    started: list[subprocess.Popen[bytes]] = []

    def start(body: str) -> subprocess.Popen[bytes]:
        text = PROGRAM.format(body=body.replace("\n", "\n    "))
        started.append(
            subprocess.Popen(
                [sys.executable, "-c", text], stdout=terminal.slave, stderr=subprocess.PIPE, process_group=0
            )
        )
        os.close(terminal.slave)
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.communicate()


FOREVER = """
while True:
    screen.draw(["one", str(size().columns)], size())
    time.sleep(0.02)
"""


def test_lines_are_drawn_over_those_before_and_only_what_changed_is_sent(terminal: PseudoTerminal, run: Run) -> None:
    run(
        """screen.draw(["same", "first", "third"], size())
screen.draw(["same", "second"], size())
time.sleep(60)"""
    )
    shown = terminal.wait_for(lambda lines: lines[1] == "second")
    assert shown[:3] == ["same", "second", ""]
    assert terminal.sent.count(b"same") == 1
    assert terminal.cursor_hidden


def test_a_line_as_wide_as_the_terminal_neither_wraps_nor_loses_its_end(terminal: PseudoTerminal, run: Run) -> None:
    run("""screen.draw(["x" * 39 + "!", "next"], size())\nscreen.draw(["x" * 60, "next"], size())\ntime.sleep(60)""")
    shown = terminal.wait_for(lambda lines: lines[1] == "next" and terminal.sent.count(b"x" * 60))
    assert shown[2] == ""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_to_end_gives_the_terminal_back(terminal: PseudoTerminal, run: Run, number: signal.Signals) -> None:
    process = run(FOREVER)
    terminal.wait_for(lambda lines: lines[0] == "one")
    process.send_signal(number)
    process.wait(PATIENCE_S)
    while terminal.read(0.1):
        pass
    assert terminal.sent.endswith(LEFT)
    assert not terminal.cursor_hidden


def test_ctrl_z_gives_the_terminal_back_until_the_program_goes_on(terminal: PseudoTerminal, run: Run) -> None:
    process = run(FOREVER)
    terminal.wait_for(lambda lines: lines[0] == "one")
    process.send_signal(signal.SIGTSTP)
    assert os.WIFSTOPPED(os.waitpid(process.pid, os.WUNTRACED)[1])
    while terminal.read(0.1):
        pass
    assert terminal.sent.endswith(LEFT)
    before = len(terminal.sent)
    process.send_signal(signal.SIGCONT)
    terminal.wait_for(lambda _: b"one" in terminal.sent[before:])
    assert b"\x1b[?1049h" in terminal.sent[before:]
    assert terminal.cursor_hidden
    process.send_signal(signal.SIGTSTP)
    assert os.WIFSTOPPED(os.waitpid(process.pid, os.WUNTRACED)[1]), "and a second time"
