"""``slipctl watch`` on a real pseudo-terminal, drawn by a terminal emulator."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, NamedTuple

import pytest
from terminals import PATIENCE_S, PseudoTerminal

if TYPE_CHECKING:
    from conftest import Publisher

LOADS = [0.0] * 64 + [0.2] * 32 + [0.5] * 32
"""Of 8 × 16 taxels: nothing presses on the half at −Y."""


UNLOADED, LARGEST = "303030", "ffffaf"
"""Colours of taxels."""


class Rig:
    """Two fingers on a gripper, as a daemon publishes them."""

    def __init__(self, publisher: Publisher) -> None:
        self._publisher = publisher
        self._seq = 0

    def send(self) -> None:
        self._seq += 1
        contact = {"centroid_m": [0.0, 0.006], "pole_m": [0.0, -0.003], "utilisation": 0.8, "normal_n": 10.0}
        for finger, level in (("left", "caution"), ("right", "slipping")):
            self._publisher.send(
                f"slip.{finger}", self._seq, finger=finger, level=level, reasons=["rotation"], **contact
            )
            self._publisher.send(
                f"tactile.{finger}", self._seq, finger=finger, rows=8, cols=16, pitch_m=0.0032, loads_n=LOADS
            )
        self._publisher.send("gripper", self._seq, width_m=0.0425, force_command_n=12.0)
        well = {"health": 0, "rate_hz": 1000.0, "expected_hz": 1000.0}
        streams = {f"{finger}.{kind}": well for finger in ("left", "right") for kind in ("wrench", "pad")}
        fingers = {finger: {"level": "stable"} for finger in ("left", "right")}
        self._publisher.send("status", self._seq, version="1.2.3", fingers=fingers, streams=streams)


class Watched(NamedTuple):
    """A running ``slipctl watch``, its terminal, and the rig that it shows."""

    terminal: PseudoTerminal
    process: subprocess.Popen[str]
    rig: Rig


Watch = Callable[..., Watched]


def environment(**changes: str) -> dict[str, str]:
    """The environment of the tests, without what changes the look of the view, and with some changes."""
    looks = ("NO_COLOR", "LC_ALL", "LC_CTYPE", "LANG", "TERM")
    kept = {key: value for key, value in os.environ.items() if key not in looks}
    return kept | {"LANG": "C.UTF-8", "TERM": "xterm-256color"} | changes


@pytest.fixture
def watched(publisher: Publisher, slipctl: Callable[..., subprocess.Popen[str]]) -> Iterator[Watch]:
    """Starts ``slipctl watch`` on a terminal of some size, waits until it listens, and sends it the state of a rig."""
    with contextlib.ExitStack() as stack:

        def start(columns: int, lines: int, *arguments: str, **changes: str) -> Watched:
            terminal = stack.enter_context(PseudoTerminal(columns, lines))
            command = ("--publish", publisher.endpoint, "watch", *arguments)
            process = slipctl(*command, stdout=terminal.slave, env=environment(**changes))
            os.close(terminal.slave)
            publisher.wait_for_subscriber()
            return Watched(terminal, process, Rig(publisher))

        yield start


def whole(lines: list[str]) -> bool:
    """Whether everything of the rig is on the screen."""
    text = "\n".join(lines)
    return all(part in text for part in ("slipd 1.2.3", "CAUTION", "SLIPPING", "width 42.5 mm", "normal 10.00 N"))


def test_ctrl_c_gives_the_terminal_back_with_the_last_view(watched: Watch) -> None:
    terminal, process, rig = watched(80, 24)
    terminal.wait_for(whole, rig.send)
    process.send_signal(signal.SIGINT)
    assert process.wait(PATIENCE_S) == 130
    while terminal.read(0.1):
        pass
    _, _, after = terminal.sent.partition(b"\x1b[?1049l")
    assert b"SLIPPING" in after
    assert not terminal.cursor_hidden
    assert process.stderr.read() == ""


def test_a_dumb_terminal_gets_lines_without_escape_sequences(watched: Watch) -> None:
    terminal, process, rig = watched(80, 24, TERM="dumb")
    terminal.wait_for(lambda lines: "\n".join(lines).count("left caution") >= 2, rig.send)
    process.send_signal(signal.SIGINT)
    assert process.wait(PATIENCE_S) == 130
    assert b"\x1b" not in terminal.sent
