"""One command at a time, each at most three times; test_gripper_scripts has what replaces and interrupts one."""

from __future__ import annotations

import pytest

from slipd.devices.shared.command_queue import ATTEMPTS, Command, CommandQueue
from slipd.devices.shared.device_interface import DecoderHealth

ANSWER_NS = 100
GO, FORCE = Command("go", "go", b"go"), Command("force", "force", b"force")


@pytest.fixture
def commands() -> CommandQueue:
    return CommandQueue(ANSWER_NS, DecoderHealth())


def test_A6_after_three_unanswered_attempts_all_waiting_commands_are_dropped(commands: CommandQueue) -> None:
    commands.replace([GO, FORCE])
    sent = [commands.on_time(at * ANSWER_NS) for at in range(ATTEMPTS + 2)]
    assert sent == [b"go"] * ATTEMPTS + [b"", b""]
    assert (commands.failure, commands.due_ns) == ("no answer to go", None)
    commands.replace([FORCE])
    assert commands.on_time(1000) == b"force"
    commands.handle_answer(1001)
    assert commands.failure == ""


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
