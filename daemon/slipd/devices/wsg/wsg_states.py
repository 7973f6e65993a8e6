"""State machine of the session with a WSG gripper.

An activation is the homing command, which moves the fingers over their whole stroke. While it is queued the gripper is
unchanged; once it is sent, the gripper is not ready until homing ends.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum


class State(Enum):
    """State of the gripper."""

    CLOSED = "closed"
    WAITING = "waiting"
    """Its configuration is incomplete, or no reading was received."""
    SILENT = "silent"
    """It no longer sends readings, and is being configured again."""
    INACTIVE = "inactive"
    """It is not referenced."""
    ACTIVE = "active"
    FAULTY = "faulty"
    """It is referenced and reports a fault; it accepts only a stop or an activation."""
    HOMING_QUEUED = "homing queued"
    HOMING = "homing"
    REHOMING_QUEUED = "rehoming queued"
    """Homing is in progress, and queued again."""
    SETTLING = "settling"
    """Homing ended, was stopped or dropped, and no reading was received since."""


class Event(Enum):
    """Events; the first four are the kinds of permits."""

    ACTIVATE = "activate"
    MOVE = "move"
    SET_FORCE = "set_force"
    HALT = "halt"
    HOMING_SENT = "homing sent"
    HOMING_DROPPED = "homing dropped"
    """Homing was dropped before it was sent."""
    HOMING_ENDED = "homing ended"
    """The gripper reports the end of homing, or homing took too long."""
    REPORTED_INACTIVE = "reported inactive"
    REPORTED_ACTIVE = "reported active"
    REPORTED_FAULT = "reported fault"
    FELL_SILENT = "fell silent"


_REPORTS = {
    Event.REPORTED_INACTIVE: State.INACTIVE,
    Event.REPORTED_ACTIVE: State.ACTIVE,
    Event.REPORTED_FAULT: State.FAULTY,
}
_ALWAYS = {Event.ACTIVATE: State.HOMING_QUEUED, Event.FELL_SILENT: State.SILENT}

TRANSITIONS: Mapping[State, Mapping[Event, State]] = {
    State.CLOSED: {},
    State.WAITING: _REPORTS,
    State.SILENT: _REPORTS,
    State.INACTIVE: {**_ALWAYS, **_REPORTS},
    State.ACTIVE: {
        **_ALWAYS,
        **_REPORTS,
        Event.MOVE: State.ACTIVE,
        Event.SET_FORCE: State.ACTIVE,
        Event.HALT: State.ACTIVE,
    },
    State.FAULTY: {**_ALWAYS, **_REPORTS, Event.HALT: State.FAULTY},
    State.HOMING_QUEUED: {
        **_ALWAYS,
        Event.HALT: State.SETTLING,
        Event.HOMING_SENT: State.HOMING,
        Event.HOMING_DROPPED: State.SETTLING,
    },
    State.HOMING: {
        Event.ACTIVATE: State.REHOMING_QUEUED,
        Event.FELL_SILENT: State.SILENT,
        Event.HALT: State.SETTLING,
        Event.HOMING_ENDED: State.SETTLING,
    },
    State.REHOMING_QUEUED: {
        Event.ACTIVATE: State.REHOMING_QUEUED,
        Event.FELL_SILENT: State.SILENT,
        Event.HALT: State.SETTLING,
        Event.HOMING_SENT: State.HOMING,
        Event.HOMING_DROPPED: State.HOMING,
        Event.HOMING_ENDED: State.HOMING_QUEUED,
    },
    State.SETTLING: {**_ALWAYS, **_REPORTS, Event.HALT: State.SETTLING},
}
"""For each state, the events that it accepts and the state that follows; opening and closing the link set the state.

After homing is dropped before it was sent, the session handles the last report again.
"""

QUEUED = frozenset({State.HOMING_QUEUED, State.REHOMING_QUEUED})
IN_PROGRESS = frozenset({State.HOMING, State.REHOMING_QUEUED})
ACTIVATION = QUEUED | IN_PROGRESS
"""In these states the gripper accepts no motion."""


def report_of(*, referenced: bool, fault: str) -> Event:
    """Return the event of a reading, whose ``fault`` is "" where the gripper reports none."""
    if not referenced:
        return Event.REPORTED_INACTIVE
    return Event.REPORTED_FAULT if fault else Event.REPORTED_ACTIVE
