"""State machine of the session with an external driver.

The driver carries out an activation on its own: it is under way until the driver answers the set-point that asks for
it. What the driver reports always counts, but while an activation is queued or under way the gripper takes no motion.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum


class State(Enum):
    """State of the driver and its gripper."""

    CLOSED = "closed"
    UNREGISTERED = "unregistered"
    """Connected, but no driver registered, or another than before."""
    WAITING = "waiting"
    """Registered; no report came yet."""
    SILENT = "silent"
    """No report of late."""
    INACTIVE = "inactive"
    ACTIVE = "active"
    FAULTY = "faulty"
    """Active, with a fault: it can be stopped, and nothing else."""
    ACTIVATION_QUEUED = "activation queued"
    ACTIVATING = "activating"


class Event(Enum):
    """Events; the first four are the kinds of a permit."""

    ACTIVATE = "activate"
    MOVE = "move"
    SET_FORCE = "set_force"
    HALT = "halt"
    ACTIVATION_SENT = "activation sent"
    ACTIVATION_OVER = "activation over"
    """It was dropped, the driver answered it, or never will."""
    REGISTERED = "registered"
    STRANGER = "stranger"
    """A driver of another name registered on the same connection."""
    REPORTED_INACTIVE = "reported inactive"
    REPORTED_ACTIVE = "reported active"
    REPORTED_FAULT = "reported fault"
    FELL_SILENT = "fell silent"


_REPORTS = {
    Event.REPORTED_INACTIVE: State.INACTIVE,
    Event.REPORTED_ACTIVE: State.ACTIVE,
    Event.REPORTED_FAULT: State.FAULTY,
}
_REGISTRATIONS = {Event.REGISTERED: State.WAITING, Event.STRANGER: State.UNREGISTERED}
_ANYWAY = {**_REGISTRATIONS, Event.FELL_SILENT: State.SILENT, Event.ACTIVATE: State.ACTIVATION_QUEUED}

TRANSITIONS: Mapping[State, Mapping[Event, State]] = {
    State.CLOSED: {},
    State.UNREGISTERED: _REGISTRATIONS,
    State.WAITING: {**_REGISTRATIONS, **_REPORTS, Event.FELL_SILENT: State.SILENT},
    State.SILENT: {**_REGISTRATIONS, **_REPORTS},
    State.INACTIVE: {**_ANYWAY, **_REPORTS},
    State.ACTIVE: {
        **_ANYWAY,
        **_REPORTS,
        Event.MOVE: State.ACTIVE,
        Event.SET_FORCE: State.ACTIVE,
        Event.HALT: State.ACTIVE,
    },
    State.FAULTY: {**_ANYWAY, **_REPORTS, Event.HALT: State.FAULTY},
    State.ACTIVATION_QUEUED: {
        **_ANYWAY,
        Event.ACTIVATION_SENT: State.ACTIVATING,
        Event.ACTIVATION_OVER: State.INACTIVE,
    },
    State.ACTIVATING: {**_ANYWAY, Event.HALT: State.INACTIVE, Event.ACTIVATION_OVER: State.INACTIVE},
}
"""For each state, the events that it takes and the state that follows; opening and closing the link set the state.

Where an activation is over or is halted, the last report counts again: the session hands it over once more.
"""

ACTIVATION = frozenset({State.ACTIVATION_QUEUED, State.ACTIVATING})
"""While in one of these the gripper takes no motion."""
