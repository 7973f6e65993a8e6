"""One command at a time, each at most three times, and never one that a newer one has replaced."""

from __future__ import annotations

import pytest

from slipd.devices.shared.command_queue import ATTEMPTS, Command, CommandQueue
from slipd.devices.shared.device_interface import DecoderHealth

ANSWER_NS = 100
GO, FASTER, FORCE, STOP = (
    Command(name, kind, name.encode()) for name, kind in (("go", "go"), ("faster", "go"), ("force", 1), ("stop", 2))
)


@pytest.fixture
def commands() -> CommandQueue:
    return CommandQueue(ANSWER_NS, DecoderHealth())


def test_the_next_command_is_sent_when_the_last_is_answered(commands: CommandQueue) -> None:
    assert (commands.due_ns, commands.on_time(5)) == (None, b"")
    commands.replace([GO, FORCE])
    assert commands.on_time(5) == b"go"
    assert (commands.on_time(6), commands.due_ns) == (b"", 5 + ANSWER_NS)
    commands.handle_answer(7)
    assert (commands.due_ns, commands.on_time(7)) == (7, b"force")
    commands.handle_answer(8)
    assert (commands.due_ns, commands.failure) == (None, "")


def test_A6_after_three_unanswered_attempts_all_waiting_commands_are_dropped(commands: CommandQueue) -> None:
    commands.replace([GO, FORCE])
    sent = [commands.on_time(at * ANSWER_NS) for at in range(ATTEMPTS + 2)]
    assert sent == [b"go"] * ATTEMPTS + [b"", b""]
    assert (commands.failure, commands.due_ns) == ("no answer to go", None)
    commands.replace([FORCE])
    assert commands.on_time(1000) == b"force"
    commands.handle_answer(1001)
    assert commands.failure == ""


def test_A6_a_command_that_a_newer_one_of_its_kind_replaces_is_not_repeated(commands: CommandQueue) -> None:
    commands.replace([GO])
    commands.on_time(0)
    commands.replace([FORCE, FASTER])
    assert [commands.on_time(at * ANSWER_NS) for at in (1, 2, 3, 4)] == [b"force"] * ATTEMPTS + [b""]


@pytest.mark.parametrize(("force", "sent"), [(1.0, b"home"), (None, b"go")])
def test_a_force_is_not_repeated_after_an_activation(commands: CommandQueue, force: float | None, sent: bytes) -> None:
    commands.replace([Command("go", "go", b"go", force)])
    commands.on_time(0)
    commands.replace([Command("home", "home", b"home", activates=True)])
    assert commands.on_time(ANSWER_NS) == sent


def test_a_refusal_drops_waiting_commands(commands: CommandQueue) -> None:
    commands.replace([GO, FORCE])
    commands.on_time(0)
    commands.handle_answer(1, "go: refused")
    assert (commands.on_time(2), commands.failure) == (b"", "go: refused")


def test_an_interruption_is_sent_at_once_and_kept_by_later_commands(commands: CommandQueue) -> None:
    commands.replace([GO, FORCE])
    commands.on_time(0)
    commands.interrupt(STOP)
    commands.replace([FORCE], keep=[STOP])
    assert commands.contains([2])
    assert commands.on_time(1) == b"stop"
    assert commands.contains([2])
    commands.handle_answer(2)
    assert (commands.contains([2]), commands.on_time(2)) == (False, b"force")


@pytest.mark.parametrize("waits", [False, True])
def test_dropped_commands_are_not_sent_and_sent_ones_are_not_repeated(commands: CommandQueue, waits: bool) -> None:
    commands.replace([GO, FORCE])
    assert commands.on_time(0) == b"go"
    commands.replace([FORCE, STOP] if waits else [STOP])
    assert commands.drop(keep=[2]) is waits
    assert (commands.waiting, commands.outstanding) == ([STOP], GO)
    commands.waiting.clear()
    assert (commands.on_time(ANSWER_NS), commands.failure) == (b"", "no answer to go")


def test_a_stop_that_was_sent_is_repeated_though_all_else_is_dropped(commands: CommandQueue) -> None:
    commands.interrupt(STOP)
    commands.on_time(0)
    commands.replace([FORCE])
    assert commands.drop(keep=[2])
    assert [commands.on_time(at * ANSWER_NS) for at in (1, 2, 3)] == [b"stop", b"stop", b""]


def test_the_force_is_that_of_the_last_command_sent_or_waiting_that_sets_one(commands: CommandQueue) -> None:
    weak, strong = Command("weak", "force", b"w", 1.0), Command("strong", "force", b"s", 2.0)
    assert commands.force is None
    commands.replace([weak, GO])
    assert (commands.force, commands.on_time(0)) == (1.0, b"w")
    commands.replace([strong, GO])
    assert commands.force == 2.0
    commands.drop(keep=[])
    assert commands.force == 1.0
    commands.replace([Command("home", "home", b"h", activates=True)])
    assert commands.force is None
    commands.drop(keep=[])
    commands.forget_force()
    assert commands.force is None


def test_a_reset_forgets_everything(commands: CommandQueue) -> None:
    commands.replace([GO])
    commands.on_time(0)
    commands.give_up("no reply")
    commands.replace([GO])
    commands.reset()
    assert (commands.due_ns, commands.failure, commands.on_time(10**9)) == (None, "", b"")
