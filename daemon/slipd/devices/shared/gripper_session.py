"""Sessions with grippers: their interface, which `slipd.devices` exports, and what they share.

`GripperSessionBase` carries out permits; `QueuedGripperSession` is for grippers that answer one command at a time and
report their own ranges.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Any, ClassVar, Generic, Protocol, TypeVar, runtime_checkable

from slipd.devices.shared.command_queue import CommandQueue, WaitingCommands
from slipd.devices.shared.device_interface import Session
from slipd.devices.shared.gripper_states import Event, State, Table
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


UNKNOWN_RANGE = 0.0, math.inf
CommandsT = TypeVar("CommandsT", bound=CommandQueue)


class QueuedGripperSession(GripperSessionBase[CommandsT]):
    """Session that sends one command at a time, to a gripper that reports its own ranges.

    A subclass sets ``decoder`` too.

    Attributes:
        width_range_m: Smallest and largest width between the pads, m; (0, inf) until the gripper reports them.
        force_range_n: Smallest and largest force, N on one pad; likewise.
        speed_range_mps: Smallest and largest speed, m/s; None if it cannot be set, or until the gripper reports them.
    """

    decoder: Any

    def _reset(self, state: State) -> None:
        super()._reset(state)
        self.decoder.forget()
        self.identity = ""
        self._set_ranges()
        self._fault = ""  # in the last reading

    @property
    def command_lost(self) -> bool:
        """Whether the last command was refused, was never acknowledged, or reached a gripper that could not obey."""
        return bool(self._queue.failure)

    def applied_n(self, force_n: float) -> float:
        """Return ``force_n``: a force has no steps."""
        return force_n

    def drop(self) -> bool:
        """Drop commands that are not sent yet, except a stop; do not repeat unanswered ones."""
        dropped = self._queue.drop()
        self._follow_activation()
        return dropped

    def acknowledge(self) -> None:
        """Forget that a command was lost, and acknowledge a fault if the gripper reports one."""
        self._queue.failure = ""
        if self._fault:
            self._queue.acknowledge()
            self._follow_activation()

    def _move(self, width_m: float, speed_mps: float | None, force_n: float) -> bool:
        if not self._accepts(Event.MOVE):
            return False
        if speed_mps is not None:
            check_range("speed", speed_mps, self.speed_range_mps or (0.0, 0.0), "m/s")
        check_range("width", width_m, self.width_range_m, "m")
        self._handle_event(Event.MOVE)
        self._queue.move(width_m, speed_mps, self._in_range(force_n))
        return True

    def _set_force(self, force_n: float) -> None:
        self._queue.set_force(self._in_range(force_n))

    def _set_ranges(
        self,
        width_m: tuple[float, float] = UNKNOWN_RANGE,
        force_n: tuple[float, float] = UNKNOWN_RANGE,
        speed_mps: tuple[float, float] | None = None,
    ) -> None:
        """Set the ranges that the gripper reports."""
        self.width_range_m, self.force_range_n, self.speed_range_mps = width_m, force_n, speed_mps

    def _in_range(self, force_n: float) -> float:
        """Return the nearest force that the gripper has."""
        least, most = self.force_range_n
        return min(max(force_n, least), most)

    def _follow_activation(self) -> None:
        """Update the state with the outcome of a queued activation."""
        if any(command.activates for command in self._queue.waiting):
            return
        sent = self._queue.outstanding
        if sent is not None and sent.activates:
            self._handle_event(Event.ACTIVATION_SENT)
        elif self._handle_event(Event.ACTIVATION_GONE):
            self._repeat_report()


def check_range(name: str, value: float, bounds: tuple[float, float], unit: str, tolerance: float = 0.0) -> None:
    """Check that a value is within its bounds.

    Raises:
        ValueError: It is not, or it is not a number.
    """
    low, high = bounds
    if not low - tolerance <= value <= high + tolerance:  # also False for NaN
        raise ValueError(f"the {name} must be from {low:g} to {high:g} {unit}, got {value}")
