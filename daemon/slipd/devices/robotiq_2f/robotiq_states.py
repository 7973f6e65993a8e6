"""State machine of the session with a Robotiq gripper.

An activation is two writes, "clear" and "activate", after which the fingers open and close fully. While it is queued
the gripper is unchanged; once "clear" is sent it is not active, even if a reading already on the line reports so.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum


class State(Enum):
    """State of the gripper."""

    CLOSED = "closed"
    WAITING = "waiting"
    """No status was received, or none since the gripper fell silent or an activation ended halfway."""
    INACTIVE = "inactive"
    ACTIVE = "active"
    ACTIVATION_QUEUED = "activation queued"
    """Neither write of the activation is sent."""
    CLEARED = "cleared"
    """"Clear" is sent, "activate" is not."""
    ACTIVATING = "activating"
    """"Activate" is sent and no status was received since, or the gripper reports an activation in progress."""


class Event(Enum):
    """Events; the first four are the kinds of permits."""

    ACTIVATE = "activate"
    MOVE = "move"
    SET_FORCE = "set_force"
    HALT = "halt"
    DROP = "drop"
    """Unsent writes are dropped."""
    GIVE_UP = "give up"
    """Unsent writes are dropped because the gripper refused a command."""
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
_ALWAYS = {Event.ACTIVATE: State.ACTIVATION_QUEUED, Event.FELL_SILENT: State.WAITING}

TRANSITIONS: Mapping[State, Mapping[Event, State]] = {
    State.CLOSED: {},
    State.WAITING: {**_ALWAYS, **_REPORTS},
    State.INACTIVE: {**_ALWAYS, **_REPORTS},
    State.ACTIVE: {
        **_ALWAYS,
        **_REPORTS,
        Event.MOVE: State.ACTIVE,
        Event.SET_FORCE: State.ACTIVE,
        Event.HALT: State.ACTIVE,
    },
    State.ACTIVATION_QUEUED: {
        **_ALWAYS,
        Event.CLEAR_SENT: State.CLEARED,
        Event.DROP: State.WAITING,
        Event.GIVE_UP: State.WAITING,
    },
    State.CLEARED: {
        **_ALWAYS,
        Event.CLEAR_REPEATED: State.ACTIVATION_QUEUED,
        Event.ACTIVATION_SENT: State.ACTIVATING,
        Event.DROP: State.WAITING,
        Event.GIVE_UP: State.WAITING,
    },
    State.ACTIVATING: {
        **_ALWAYS,
        **_REPORTS,
        Event.ACTIVATION_REPEATED: State.CLEARED,
        Event.GIVE_UP: State.WAITING,
    },
}
"""For each state, the events that it accepts and the state that follows; opening and closing the link set the state.

After a queued activation is dropped, the session handles the last report again.
"""

ACTIVATION = frozenset({State.ACTIVATION_QUEUED, State.CLEARED, State.ACTIVATING})
"""In these states the gripper accepts no motion."""
