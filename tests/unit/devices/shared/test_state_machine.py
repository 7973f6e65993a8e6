"""A state machine follows its table and refuses everything else."""

from __future__ import annotations

from enum import Enum

from slipd.devices.shared.gripper_session import StateMachine


class Door(Enum):
    OPEN = "open"
    SHUT = "shut"
    LOCKED = "locked"


class Hand(Enum):
    PUSH = "push"
    TURN = "turn"


TABLE = {Door.OPEN: {Hand.PUSH: Door.SHUT}, Door.SHUT: {Hand.PUSH: Door.OPEN, Hand.TURN: Door.LOCKED}, Door.LOCKED: {}}


def test_an_accepted_event_leads_to_the_next_state() -> None:
    machine = StateMachine(TABLE, Door.OPEN)
    assert (machine.accepts(Hand.PUSH), machine.handle(Hand.PUSH), machine.state) == (True, True, Door.SHUT)
    assert (machine.handle(Hand.TURN), machine.state) == (True, Door.LOCKED)


def test_an_event_that_is_not_in_the_table_is_refused_and_changes_nothing() -> None:
    for door, hand in ((Door.OPEN, Hand.TURN), (Door.LOCKED, Hand.PUSH)):
        machine = StateMachine(TABLE, door)
        assert (machine.accepts(hand), machine.handle(hand), machine.state) == (False, False, door)
