"""State machine of the session with an external driver.

The driver carries out an activation on its own; it is in progress until the driver answers the set-point. While an
activation is queued or in progress, the gripper accepts no motion, whatever the driver reports.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum


class State(Enum):
    """State of the driver and its gripper."""

    CLOSED = "closed"
    UNREGISTERED = "unregistered"
    """Connected, but no driver is registered, or another one than before."""
    WAITING = "waiting"
    """Registered, but no report was received yet."""
    SILENT = "silent"
    """No recent report."""
    INACTIVE = "inactive"
    ACTIVE = "active"
    FAULTY = "faulty"
    """Active, with a fault; it accepts only a stop or an activation."""
    ACTIVATION_QUEUED = "activation queued"
    ACTIVATING = "activating"


class Event(Enum):
    """Events; the first four are the kinds of permits."""

    ACTIVATE = "activate"
    MOVE = "move"
    SET_FORCE = "set_force"
    HALT = "halt"
    ACTIVATION_SENT = "activation sent"
    ACTIVATION_OVER = "activation over"
    """The activation was dropped, answered, or will never be answered."""
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
_ALWAYS = {**_REGISTRATIONS, Event.FELL_SILENT: State.SILENT, Event.ACTIVATE: State.ACTIVATION_QUEUED}

TRANSITIONS: Mapping[State, Mapping[Event, State]] = {
    State.CLOSED: {},
    State.UNREGISTERED: _REGISTRATIONS,
    State.WAITING: {**_REGISTRATIONS, **_REPORTS, Event.FELL_SILENT: State.SILENT},
    State.SILENT: {**_REGISTRATIONS, **_REPORTS},
    State.INACTIVE: {**_ALWAYS, **_REPORTS},
    State.ACTIVE: {
        **_ALWAYS,
        **_REPORTS,
        Event.MOVE: State.ACTIVE,
        Event.SET_FORCE: State.ACTIVE,
        Event.HALT: State.ACTIVE,
    },
    State.FAULTY: {**_ALWAYS, **_REPORTS, Event.HALT: State.FAULTY},
    State.ACTIVATION_QUEUED: {
        **_ALWAYS,
        Event.ACTIVATION_SENT: State.ACTIVATING,
        Event.ACTIVATION_OVER: State.INACTIVE,
    },
    State.ACTIVATING: {**_ALWAYS, Event.HALT: State.INACTIVE, Event.ACTIVATION_OVER: State.INACTIVE},
}
"""For each state, the events that it accepts and the state that follows; opening and closing the link set the state.

After an activation is over or halted, the session handles the last report again.
"""

ACTIVATION = frozenset({State.ACTIVATION_QUEUED, State.ACTIVATING})
"""In these states the gripper accepts no motion."""
