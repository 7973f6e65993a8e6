"""States of a session with a gripper: what a device's table is made of.

Permits become motions by a state machine, which is a table: for each state, the events that it accepts and the state
that follows. The table defines the machine completely.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum


class State(Enum):
    """State of a session and its gripper, for all grippers; each has a table of those that it knows."""

    CLOSED = "closed"
    UNREGISTERED = "unregistered"
    """Connected, but no driver is registered, or another one than before."""
    WAITING = "waiting"
    """No status was received yet, or none since an activation ended halfway; or the configuration is incomplete."""
    SILENT = "silent"
    """It no longer sends."""
    INACTIVE = "inactive"
    """It must be activated: switched on, or sent to its reference."""
    ACTIVE = "active"
    FAULTY = "faulty"
    """It is active and reports a fault; it accepts only a stop or an activation."""
    ACTIVATION_QUEUED = "activation queued"
    """Nothing of the activation is sent."""
    CLEARED = "cleared"
    """The first of two writes of an activation is sent."""
    ACTIVATING = "activating"
    REACTIVATION_QUEUED = "reactivation queued"
    """An activation is in progress, and queued again."""
    SETTLING = "settling"
    """An activation ended, was stopped or dropped, and no reading was received since."""


class Event(Enum):
    """Events of a session with a gripper; the first four are the kinds of permits."""

    ACTIVATE = "activate"
    MOVE = "move"
    SET_FORCE = "set_force"
    HALT = "halt"
    DROP = "drop"
    """Unsent commands are dropped."""
    GIVE_UP = "give up"
    """Unsent commands are dropped because the gripper refused one."""
    CLEAR_SENT = "clear sent"
    CLEAR_REPEATED = "clear repeated"
    """The first write of an activation was not answered: both are queued again."""
    ACTIVATION_SENT = "activation sent"
    ACTIVATION_REPEATED = "activation repeated"
    """The activation was not answered: it is queued again."""
    ACTIVATION_GONE = "activation gone"
    """It neither waits nor is unanswered any more: it was dropped, or answered."""
    ACTIVATION_ENDED = "activation ended"
    """The gripper reports its end, or it took too long."""
    REGISTERED = "registered"
    STRANGER = "stranger"
    """A driver of another name registered on the same connection."""
    REPORTED_INACTIVE = "reported inactive"
    REPORTED_ACTIVATING = "reported activating"
    REPORTED_ACTIVE = "reported active"
    REPORTED_FAULT = "reported fault"
    FELL_SILENT = "fell silent"


Table = Mapping[State, Mapping[Event, State]]
"""For each state of a gripper, the events that it accepts and the state that follows.

Opening and closing the link set the state.
"""

REPORTS = {Event.REPORTED_INACTIVE: State.INACTIVE, Event.REPORTED_ACTIVE: State.ACTIVE}
FAULT_REPORTS = REPORTS | {Event.REPORTED_FAULT: State.FAULTY}
MOTIONS = dict.fromkeys((Event.MOVE, Event.SET_FORCE, Event.HALT), State.ACTIVE)
"""An active gripper stays active."""


def report_of(*, active: bool, fault: str) -> Event:
    """Return the event of a reading, whose ``fault`` is "" where the gripper reports none."""
    if not active:
        return Event.REPORTED_INACTIVE
    return Event.REPORTED_FAULT if fault else Event.REPORTED_ACTIVE
