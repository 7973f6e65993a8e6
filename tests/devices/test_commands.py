"""One command at a time, each at most three times, and never one that a newer has replaced."""

from __future__ import annotations

import pytest

from slipd.devices.commands import ATTEMPTS, Command, Commands
from slipd.devices.health import DecoderHealth

ANSWER_NS = 100
GO, FASTER, FORCE, STOP = (
    Command(name, kind, name.encode()) for name, kind in (("go", "go"), ("faster", "go"), ("force", 1), ("stop", 2))
)


@pytest.fixture
def commands() -> Commands:
    return Commands(ANSWER_NS, DecoderHealth())


def test_the_next_goes_when_the_last_is_answered(commands: Commands) -> None:
    assert (commands.due_ns, commands.on_time(5)) == (None, b"")
    commands.replace([GO, FORCE])
    assert commands.on_time(5) == b"go"
    assert (commands.on_time(6), commands.due_ns) == (b"", 5 + ANSWER_NS)
    commands.answered(7)
    assert (commands.due_ns, commands.on_time(7)) == (7, b"force")
    commands.answered(8)
    assert (commands.due_ns, commands.trouble) == (None, "")


def test_A6_what_is_not_answered_is_sent_three_times_and_takes_what_waits_with_it(commands: Commands) -> None:
    commands.replace([GO, FORCE])
    sent = [commands.on_time(at * ANSWER_NS) for at in range(ATTEMPTS + 2)]
    assert sent == [b"go"] * ATTEMPTS + [b"", b""]
    assert (commands.trouble, commands.due_ns) == ("no answer to go", None)
    commands.replace([FORCE])
    assert commands.on_time(1000) == b"force"
    commands.answered(1001)
    assert commands.trouble == ""


def test_A6_what_a_newer_one_of_its_kind_replaces_is_not_repeated(commands: Commands) -> None:
    commands.replace([GO])
    commands.on_time(0)
    commands.replace([FORCE, FASTER])
    assert [commands.on_time(at * ANSWER_NS) for at in (1, 2, 3, 4)] == [b"force"] * ATTEMPTS + [b""]


def test_a_refusal_takes_what_waits_with_it(commands: Commands) -> None:
    commands.replace([GO, FORCE])
    commands.on_time(0)
    commands.answered(1, "go: refused")
    assert (commands.on_time(2), commands.trouble) == (b"", "go: refused")


def test_an_interruption_waits_for_nothing_and_is_kept_by_what_comes_behind_it(commands: Commands) -> None:
    commands.replace([GO, FORCE])
    commands.on_time(0)
    commands.interrupt(STOP)
    commands.replace([FORCE], keep=[STOP])
    assert commands.holds([2])
    assert commands.on_time(1) == b"stop"
    assert commands.holds([2])
    commands.answered(2)
    assert (commands.holds([2]), commands.on_time(2)) == (False, b"force")


def test_a_new_beginning_forgets_everything(commands: Commands) -> None:
    commands.replace([GO])
    commands.on_time(0)
    commands.give_up("no reply")
    commands.replace([GO])
    commands.reset()
    assert (commands.due_ns, commands.trouble, commands.on_time(10**9)) == (None, "", b"")
