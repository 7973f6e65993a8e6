"""State machine of the session with a WSG gripper.

An activation is the command to home, which moves the fingers over their whole stroke. While it is queued the gripper is
unchanged; once it was sent, the gripper does not count as ready until homing ends.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum


class State(Enum):
    """State of the gripper."""

    CLOSED = "closed"
    WAITING = "waiting"
    """Its configuration is not complete, or it has sent no reading."""
    SILENT = "silent"
    """It sent readings, and sends none any more: it is asked anew."""
    INACTIVE = "inactive"
    """It is not referenced."""
    ACTIVE = "active"
    FAULTY = "faulty"
    """It is referenced and reports a fault: it can be stopped, and nothing else."""
    HOMING_QUEUED = "homing queued"
    HOMING = "homing"
    REHOMING_QUEUED = "rehoming queued"
    """Homing is under way, and queued once more."""
    SETTLING = "settling"
    """Homing ended, was stopped or taken back, and no reading came since."""


class Event(Enum):
    """Events; the first four are the kinds of a permit."""

    ACTIVATE = "activate"
    MOVE = "move"
    SET_FORCE = "set_force"
    HALT = "halt"
    HOMING_SENT = "homing sent"
    HOMING_DROPPED = "homing dropped"
    """It was dropped before it was sent."""
    HOMING_ENDED = "homing ended"
    """The gripper reports it, or it took too long."""
    REPORTED_INACTIVE = "reported inactive"
    REPORTED_ACTIVE = "reported active"
    REPORTED_FAULT = "reported fault"
    FELL_SILENT = "fell silent"


_REPORTS = {
    Event.REPORTED_INACTIVE: State.INACTIVE,
    Event.REPORTED_ACTIVE: State.ACTIVE,
    Event.REPORTED_FAULT: State.FAULTY,
}
_ANYWAY = {Event.ACTIVATE: State.HOMING_QUEUED, Event.FELL_SILENT: State.SILENT}

TRANSITIONS: Mapping[State, Mapping[Event, State]] = {
    State.CLOSED: {},
    State.WAITING: _REPORTS,
    State.SILENT: _REPORTS,
    State.INACTIVE: {**_ANYWAY, **_REPORTS},
    State.ACTIVE: {
        **_ANYWAY,
        **_REPORTS,
        Event.MOVE: State.ACTIVE,
        Event.SET_FORCE: State.ACTIVE,
        Event.HALT: State.ACTIVE,
    },
    State.FAULTY: {**_ANYWAY, **_REPORTS, Event.HALT: State.FAULTY},
    State.HOMING_QUEUED: {
        **_ANYWAY,
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
    State.SETTLING: {**_ANYWAY, **_REPORTS, Event.HALT: State.SETTLING},
}
"""For each state, the events that it takes and the state that follows; opening and closing the link set the state.

Where homing is taken back before it was sent, the last reading counts again: the session hands it over once more.
"""

QUEUED = frozenset({State.HOMING_QUEUED, State.REHOMING_QUEUED})
UNDER_WAY = frozenset({State.HOMING, State.REHOMING_QUEUED})
ACTIVATION = QUEUED | UNDER_WAY
"""While in one of these the gripper takes no motion."""
