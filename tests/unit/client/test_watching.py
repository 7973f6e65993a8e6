"""``slipctl watch`` into a pipe and on a real pseudo-terminal, and the full screen that it draws on."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
from collections.abc import Callable, Iterator
from contextlib import ExitStack, nullcontext
from typing import Any

import pytest
from client_peers import PATIENCE_S, Publisher, until
from terminals import PseudoTerminal

from slipd_client import watch as module
from slipd_client.errors import Silence
from slipd_client.messages.codec import typed_message
from slipd_client.messages.topics import Message
from slipd_client.slipctl_parser import parser
from slipd_client.terminal import TerminalScreen

Start = Callable[..., "subprocess.Popen[str]"]


class Heard:
    """A subscriber that has heard these messages, and hears no more."""

    def __init__(self, messages: list[Message]) -> None:
        self._left = iter(messages)

    def __iter__(self) -> Iterator[Message]:
        return self._left

    def receive(self, timeout_s: float) -> Message | None:
        return next(self._left, None)

    def check_silence(self) -> None:
        """The daemon is well."""


def test_once_shows_the_last_message_of_every_topic(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bodies = [
        ("slip.left", {"level": "stable"}),
        ("wrench.left", {"force_n": [0.0, 0.0, 1.5]}),
        ("slip.left", {"level": "caution", "mu": None}),
        ("slip.right", {"finger": "right", "level": "unknown"}),
    ]
    head = {"v": 1, "boot": "b", "t_ns": 1, "finger": "left"}

    messages = [typed_message(topic, head | {"seq": n} | body) for n, (topic, body) in enumerate(bodies)]
    monkeypatch.setattr(module, "Subscriber", lambda *_, **__: nullcontext(Heard(messages)))
    module.run(parser().parse_args(["watch", "--once"]), None)
    assert re.search(r"^[^\x1b]*left +CAUTION[^\x1b]*right +UNKNOWN[^\x1b]*$", capsys.readouterr().out)
    module.run(parser().parse_args(["watch", "--once", "--json"]), None)
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [(line["topic"], line.get("mu"), line.get("force_n")) for line in lines] == [
        ("slip.left", None, None),
        ("slip.right", None, None),
        ("wrench.left", None, [0.0, 0.0, 1.5]),
    ]
    monkeypatch.setattr(module, "Subscriber", lambda *_, **__: nullcontext(Heard([])))
    with pytest.raises(Silence, match=r"no message of wrench.middle for 3 s; slipctl status lists the fingers"):
        module.run(parser().parse_args(["watch", "--once", "--topic", "wrench.middle"]), None)


def test_into_a_pipe_goes_each_change_and_ctrl_c_ends_it_cleanly(publisher: Publisher, slipctl: Start) -> None:
    process = slipctl("--publish", publisher.endpoint, "watch")
    publisher.wait_for(*(topic.encode() for topic in module.TOPICS))
    publisher.send("slip.left", 1, level="unknown", reasons=["stale"], utilisation=0.25)
    publisher.send_frames(b"warning", b"\xc1 no message")
    publisher.send("warning", 1, previous="stable", level="warning", reasons=["tipping"])
    publisher.send("warning", 4, previous="warning", level="slipping", reasons=[])
    lines = [process.stdout.readline() for _ in range(3)]
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=PATIENCE_S)
    expected = r".*left unknown \(stale\) λ 0.25.*\n.*left stable → warning  \(tipping\)\n.*left warning → slipping\n"
    assert re.fullmatch(expected, "".join(lines))
    assert (process.returncode, errors) == (130, "slipctl: 2 messages of warning were missed\n")


@pytest.mark.parametrize(
    ("options", "subscribed", "expected"),
    [
        (["--json"], b"", [("tactile.left", 1), ("status", 9), ("wrench.left", 2)]),
        (["--topic", "wrench.left", "--topic", "tactile"], b"tactile", [("tactile.left", 1), ("wrench.left", 2)]),
    ],
)
def test_json_is_every_message_of_every_topic_or_of_those_that_are_named(
    publisher: Publisher, slipctl: Start, options: list[str], subscribed: bytes, expected: list[tuple[str, int]]
) -> None:
    process = slipctl("watch", "--publish", publisher.endpoint, *options)
    publisher.wait_for(subscribed)
    for topic, seq in (("tactile.left", 1), ("status", 9), ("wrench.left", 2)):
        publisher.send(topic, seq)
    lines = [json.loads(process.stdout.readline()) for _ in expected]
    assert [(line["topic"], line["seq"]) for line in lines] == expected


def test_a_closed_output_pipe_is_not_an_error(publisher: Publisher, slipctl: Start) -> None:
    process = slipctl("--publish", publisher.endpoint, "watch", "--json")
    publisher.wait_for()
    process.stdout.close()
    process.stdout = None
    until(lambda: process.poll() is not None, lambda: publisher.send("status"))
    assert (process.returncode, process.stderr.read()) == (0, "")


LEFT = b"\x1b[0m\x1b[?7h\x1b[?25h\x1b[?1049l"
"""What gives the terminal back."""


def send_rig(publisher: Publisher) -> None:
    """Publish the state of two fingers on a gripper, as a daemon does."""
    for finger, level in (("left", "caution"), ("right", "slipping")):
        publisher.send(f"slip.{finger}", finger=finger, level=level, reasons=["rotation"], normal_n=10.0)
    publisher.send("gripper", width_m=0.0425, force_command_n=12.0)
    publisher.send("status", version="1.2.3", fingers={key: {"level": "stable"} for key in ("left", "right")})


@pytest.fixture
def watched(publisher: Publisher, slipctl: Start) -> Iterator[Callable[..., tuple[PseudoTerminal, Any]]]:
    """Starts ``slipctl watch`` on a terminal and waits until it listens."""
    with ExitStack() as stack:

        def start(term: str) -> tuple[PseudoTerminal, Any]:
            terminal = stack.enter_context(PseudoTerminal(80, 24))
            kept = {key: value for key, value in os.environ.items() if key not in ("NO_COLOR", "LC_ALL", "LC_CTYPE")}
            environment = kept | {"LANG": "C.UTF-8", "TERM": term}
            # In the group of a test run that nobody waits for, the kernel does not stop a process.
            options = {"stdout": terminal.slave, "env": environment, "process_group": 0}
            process = slipctl("--publish", publisher.endpoint, "watch", **options)
            os.close(terminal.slave)
            publisher.wait_for()
            return terminal, process

        yield start


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_to_end_gives_the_terminal_back_with_the_last_view(
    watched: Callable[..., tuple[PseudoTerminal, Any]], publisher: Publisher, number: signal.Signals
) -> None:
    terminal, process = watched("xterm-256color")
    parts = {"slipd 1.2.3", "CAUTION", "SLIPPING", "width 42.5 mm", "normal 10.00 N"}
    terminal.wait_for(lambda lines: all(part in "\n".join(lines) for part in parts), lambda: send_rig(publisher))
    process.send_signal(number)
    assert process.wait(PATIENCE_S) == 130
    terminal.read_all()
    assert b"SLIPPING" in terminal.sent.partition(LEFT)[2]
    assert (terminal.cursor_hidden, process.stderr.read()) == (False, "")


def test_ctrl_z_gives_the_terminal_back_until_the_program_goes_on(
    watched: Callable[..., tuple[PseudoTerminal, Any]], publisher: Publisher
) -> None:
    terminal, process = watched("xterm-256color")
    for _ in range(2):
        before = len(terminal.sent)
        terminal.wait_for(
            lambda _, before=before: b"\x1b[?1049h" in terminal.sent[before:] and b"CAUTION" in terminal.sent[before:],
            lambda: send_rig(publisher),
        )
        assert terminal.cursor_hidden
        process.send_signal(signal.SIGTSTP)
        assert os.WIFSTOPPED(os.waitpid(process.pid, os.WUNTRACED)[1])
        terminal.read_all()
        assert terminal.sent.endswith(LEFT)
        process.send_signal(signal.SIGCONT)


def test_a_dumb_terminal_gets_lines_without_escape_sequences(
    watched: Callable[..., tuple[PseudoTerminal, Any]], publisher: Publisher
) -> None:
    terminal, process = watched("dumb")
    terminal.wait_for(lambda lines: "left caution" in "\n".join(lines), lambda: send_rig(publisher))
    process.send_signal(signal.SIGINT)
    assert (process.wait(PATIENCE_S), b"\x1b" in terminal.sent) == (130, False)


def test_only_what_changed_is_drawn_and_a_line_as_wide_as_the_terminal_neither_wraps_nor_loses_its_end() -> None:
    size = os.terminal_size((40, 6))
    with PseudoTerminal(*size) as terminal, os.fdopen(terminal.slave, "w") as slave, TerminalScreen(slave) as screen:
        for lines in (["same", "first", "third"], ["same", "x" * 39 + "!", "next"], ["same", "x" * 60, "next"]):
            screen.draw(lines, size)
        shown = terminal.wait_for(lambda _: b"x" * 60 in terminal.sent)
        assert (shown[:4], terminal.sent.count(b"same")) == (["same", "x" * 40, "next", ""], 1)
        screen.draw(["same"], size)
        assert terminal.wait_for(lambda lines: not lines[1])[:3] == ["same", "", ""]
        assert terminal.cursor_hidden
