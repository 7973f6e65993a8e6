"""State machine of the session with a Robotiq gripper.

An activation is two writes, "clear" and "activate", after which the fingers open and close fully. While it is queued
the gripper is unchanged; once "clear" was sent it is not active, even if a reading that was on its way says so.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum


class State(Enum):
    """State of the gripper."""

    CLOSED = "closed"
    WAITING = "waiting"
    """No status came, or none since the gripper fell silent or an activation was given up halfway."""
    INACTIVE = "inactive"
    ACTIVE = "active"
    ACTIVATION_QUEUED = "activation queued"
    """Neither write of the activation was sent."""
    CLEARED = "cleared"
    """"Clear" was sent, "activate" was not."""
    ACTIVATING = "activating"
    """"Activate" was sent and no status came since, or the gripper reports that it activates."""


class Event(Enum):
    """Events; the first four are the kinds of a permit."""

    ACTIVATE = "activate"
    MOVE = "move"
    SET_FORCE = "set_force"
    HALT = "halt"
    DROP = "drop"
    """What was not sent is dropped."""
    GIVE_UP = "give up"
    """What was not sent is dropped because the gripper refused a command."""
    CLEAR_SENT = "clear sent"
    CLEAR_REPEATED = "clear repeated"
    """"Clear" was not answered: both writes are queued again."""
    ACTIVATION_SENT = "activation sent"
    ACTIVATION_REPEATED = "activation repeated"
    """"Activate" was not answered: it is queued again."""
    REPORTED_INACTIVE = "reported inactive"
    REPORTED_ACTIVATING = "reported activating"
    REPORTED_ACTIVE = "reported active"
    FELL_SILENT = "fell silent"


_REPORTS = {
    Event.REPORTED_INACTIVE: State.INACTIVE,
    Event.REPORTED_ACTIVATING: State.ACTIVATING,
    Event.REPORTED_ACTIVE: State.ACTIVE,
}
_ANYWAY = {Event.ACTIVATE: State.ACTIVATION_QUEUED, Event.FELL_SILENT: State.WAITING}

TRANSITIONS: Mapping[State, Mapping[Event, State]] = {
    State.CLOSED: {},
    State.WAITING: {**_ANYWAY, **_REPORTS},
    State.INACTIVE: {**_ANYWAY, **_REPORTS},
    State.ACTIVE: {
        **_ANYWAY,
        **_REPORTS,
        Event.MOVE: State.ACTIVE,
        Event.SET_FORCE: State.ACTIVE,
        Event.HALT: State.ACTIVE,
    },
    State.ACTIVATION_QUEUED: {
        **_ANYWAY,
        Event.CLEAR_SENT: State.CLEARED,
        Event.DROP: State.WAITING,
        Event.GIVE_UP: State.WAITING,
    },
    State.CLEARED: {
        **_ANYWAY,
        Event.CLEAR_REPEATED: State.ACTIVATION_QUEUED,
        Event.ACTIVATION_SENT: State.ACTIVATING,
        Event.DROP: State.WAITING,
        Event.GIVE_UP: State.WAITING,
    },
    State.ACTIVATING: {
        **_ANYWAY,
        **_REPORTS,
        Event.ACTIVATION_REPEATED: State.CLEARED,
        Event.GIVE_UP: State.WAITING,
    },
}
"""For each state, the events that it takes and the state that follows; opening and closing the link set the state.

Where a queued activation is dropped, the last status counts again: the session hands it over once more.
"""

ACTIVATION = frozenset({State.ACTIVATION_QUEUED, State.CLEARED, State.ACTIVATING})
"""While in one of these the gripper takes no motion."""
