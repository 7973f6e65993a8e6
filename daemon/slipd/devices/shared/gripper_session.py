"""Sessions with grippers: their interface, and what they share.

`slipd.devices` exports the interface. Permits become motions by a state machine, which is a table: for each state, the
events that it accepts and the state that follows. The table defines the machine completely.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from enum import Enum
from typing import Any, ClassVar, Generic, Protocol, TypeVar, runtime_checkable

from slipd.devices.shared.device_interface import Session
from slipd.devices.shared.waiting_commands import WaitingCommands
from slipd.types.permit import Permit


@runtime_checkable
class GripperSession(Session, Protocol):
    """Protocol session with a gripper, in metres between the pads and newtons on one pad.

    Nothing moves without a permit, and a permit that the gripper cannot accept sends nothing. A `Table` defines what
    the session accepts in each state.
    """

    @property
    def activating(self) -> bool:
        """Whether an activation is queued or in progress; until it is over no move and no force is accepted."""

    @property
    def command_lost(self) -> bool:
        """Whether the gripper refused the last command, or never acknowledged it."""

    @property
    def width_range_m(self) -> tuple[float, float]:
        """Smallest and largest width between the pads, m; (0, inf) until the gripper reports them."""

    @property
    def width_step_m(self) -> float:
        """Resolution of the reported width, m; 0: as fine as its numbers."""

    @property
    def speed_range_mps(self) -> tuple[float, float] | None:
        """Smallest and largest speed, m/s; None if the speed cannot be set."""

    @property
    def force_range_n(self) -> tuple[float, float]:
        """Smallest and largest force, N on one pad; (0, inf) until the gripper reports them."""

    @property
    def force_sent_n(self) -> float | None:
        """Force in effect after all queued commands, N on one pad; None if none was sent since the activation."""

    @property
    def force_acknowledged_n(self) -> float | None:
        """Force that the gripper acknowledged last, N on one pad; None if none since the activation."""

    def applied_n(self, force_n: float) -> float:
        """Return the force that would be sent for ``force_n``; the gripper may only have discrete settings."""

    def execute(self, permit: Permit, now_ns: int) -> bool:
        """Carry out a permit, the only way to command the gripper.

        - "activate" makes the gripper ready; some grippers open and close fully meanwhile. All queued commands are
          dropped.
        - "move" moves the fingers to a width, with a force and a speed (None: the session's default).
        - "set_force" changes the force at the width sent last; a move that is not sent yet is sent with that force.
        - "halt" stops the fingers where they are, before all else. A move or an activation that is not sent yet is
          dropped; a force that is not sent yet may still be sent.

        Args:
            permit: Permit of the grip gate.
            now_ns: Time of the call.

        Returns:
            True if the permit is accepted: something will be sent, or, for "halt", something unsent was dropped.
            `force_sent_n` is then the new force, at most ``permit.force_n`` or else the gripper's smallest force.
            False if nothing will be sent, because the gripper is not known to be active, reports a fault, or is
            activating.

        Raises:
            ValueError: The width or speed is out of the gripper's range, or a value is missing or not finite.
        """

    def drop(self) -> bool:
        """Drop commands that are not sent yet, except a stop; return whether there were any.

        An unanswered command remains, but is not repeated.
        """

    def acknowledge(self) -> None:
        """Forget that a command was lost, and acknowledge the fault to the gripper; move nothing."""


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


Queue = TypeVar("Queue", bound=WaitingCommands[Any])


class GripperSessionBase(ABC, Generic[Queue]):
    """Carry out permits, the only way to command a gripper; each device implements the motions.

    A subclass sets ``_table``, its states; ``_activation``, those in which it activates the gripper; and ``_queue``.
    """

    _table: ClassVar[Table]
    _activation: ClassVar[frozenset[State]]
    _queue: Queue
    width_step_m = 0.0
    """Resolution of the reported width, m; 0: as fine as its numbers."""

    @property
    def activating(self) -> bool:
        """Whether an activation is queued or in progress; until it is over no motion is accepted."""
        return self._state in self._activation

    @property
    def force_sent_n(self) -> float | None:
        """Force sent or queued last, N on one pad; None if there was none since the activation."""
        return self._queue.force_n

    @property
    def force_acknowledged_n(self) -> float | None:
        """Force that the gripper acknowledged last, N on one pad; None if none since the activation."""
        return self._queue.acknowledged_n

    def execute(self, permit: Permit, now_ns: int) -> bool:
        """Carry out a permit; see `slipd.devices.GripperSession.execute`.

        Raises:
            ValueError: The width or speed is out of the gripper's range, or a value is missing or not finite.
        """
        if permit.kind == "activate":
            accepted = self._handle_event(Event.ACTIVATE)
            if accepted:
                self._activate(now_ns)
            return accepted
        if permit.kind == "halt":
            return self._halt()
        force_n = permit.force_n
        if force_n is None:
            raise ValueError(f"a permit of kind {permit.kind!r} must have a force")
        if not math.isfinite(force_n):
            raise ValueError(f"a force must be finite, got {force_n} N")
        if permit.kind == "set_force":
            accepted = self._handle_event(Event.SET_FORCE)
            if accepted:
                self._set_force(force_n)
            return accepted
        if permit.width_m is None:
            raise ValueError("a permit of kind 'move' must have a width")
        return self._move(permit.width_m, permit.speed_mps, force_n)

    def _reset(self, state: State) -> None:
        """Start again in a state: nothing waits, nothing was sent or reported."""
        self._state = state
        self._queue.reset()
        self._reported: Event | None = None  # by the last reading that counts

    def _accepts(self, event: Event) -> bool:
        """Return whether the present state accepts an event."""
        return event in self._table[self._state]

    def _handle_event(self, event: Event) -> bool:
        """Go to the state that follows; return False, and stay, if the present state refuses the event."""
        accepted = self._accepts(event)
        if accepted:
            self._state = self._table[self._state][event]
        return accepted

    def _repeat_report(self) -> None:
        """Handle the last report again, because an activation is over, or was dropped before it was sent."""
        if self._reported is not None:
            self._handle_event(self._reported)

    @abstractmethod
    def _activate(self, now_ns: int) -> None:
        """Queue what makes the gripper ready; its state accepts it."""

    @abstractmethod
    def _move(self, width_m: float, speed_mps: float | None, force_n: float) -> bool:
        """Move to a width with a force, if the state accepts it."""

    @abstractmethod
    def _set_force(self, force_n: float) -> None:
        """Queue a change of the force at the width requested last; the state accepts it."""

    @abstractmethod
    def _halt(self) -> bool:
        """Stop the fingers where they are, if the state accepts it; return whether anything is sent or dropped."""


def check_range(name: str, value: float, bounds: tuple[float, float], unit: str, tolerance: float = 0.0) -> None:
    """Check that a value is within its bounds.

    Raises:
        ValueError: It is not, or it is not a number.
    """
    low, high = bounds
    if not low - tolerance <= value <= high + tolerance:  # also False for NaN
        raise ValueError(f"the {name} must be from {low:g} to {high:g} {unit}, got {value}")
