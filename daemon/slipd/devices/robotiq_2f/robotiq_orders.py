"""Queue of register writes to a Robotiq gripper, and what the sent ones have set.

A newer order replaces an older one that it makes void. There are three kinds of motion: a full write sends the fingers
to a position, a write of the force register alone changes the force (and speed), and a write of the action register
alone stops the fingers.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto

from slipd.devices import modbus
from slipd.devices.robotiq_2f.robotiq_registers import ACTIVATE, FORCE_ADDRESS, GO, OUTPUT_ADDRESS


class OrderKind(Enum):
    """What an order does; `CLEAR` before `ACTIVATE` is an activation."""

    CLEAR = auto()
    ACTIVATE = auto()
    GO = auto()
    FORCE = auto()
    HALT = auto()


@dataclass(frozen=True, slots=True)
class Goal:
    """Where the fingers go: position byte and speed byte."""

    position: int
    speed: int


@dataclass(frozen=True, slots=True)
class Order:
    """One register write.

    Attributes:
        kind: What it does.
        request: The write.
        goal: Of a `GO`.
        force: The force byte that it sets; None where it sets none.
    """

    kind: OrderKind
    request: modbus.Request
    goal: Goal | None = None
    force: int | None = None

    def force_after(self, force: int | None) -> int | None:
        """Return the force byte in force once this is sent, where ``force`` was: an activation makes it void."""
        activates = self.kind in (OrderKind.CLEAR, OrderKind.ACTIVATE)
        return self.force if activates or self.force is not None else force


_WHOLE = {OrderKind.CLEAR, OrderKind.ACTIVATE, OrderKind.GO, OrderKind.HALT}
_VOID_BEHIND = {
    OrderKind.ACTIVATE: _WHOLE,
    OrderKind.GO: _WHOLE,
    OrderKind.HALT: _WHOLE,
    OrderKind.FORCE: {OrderKind.CLEAR, OrderKind.ACTIVATE, OrderKind.GO, OrderKind.FORCE},
}
"""An unanswered order is not repeated behind a newer one of these kinds; "clear" always is, with its "activate"."""


class Orders:
    """The orders that wait, in their order.

    Args:
        unit: Modbus address of the gripper.

    Attributes:
        waiting: Those not sent yet.
        requested: The position byte last sent since the activation; None where none was.
    """

    def __init__(self, unit: int) -> None:
        self._unit = unit
        self._clear = self._order(OrderKind.CLEAR, (0, 0, 0))
        self._activation = self._order(OrderKind.ACTIVATE, (ACTIVATE << 8, 0, 0))
        self._halt = self._order(OrderKind.HALT, (ACTIVATE << 8,))
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self.waiting: list[Order] = []
        self.requested: int | None = None
        self._begun = Goal(0, 0)  # of the last move that was sent
        self._force: int | None = None  # that was sent

    @property
    def force(self) -> int | None:
        """The force byte in force once all that waits is sent; None where none was sent since the activation."""
        force = self._force
        for order in self.waiting:
            force = order.force_after(force)
        return force

    def void(self) -> None:
        """Forget the force: the gripper is not active and no longer has one."""
        self._force = None

    def activate(self) -> None:
        """Queue an activation, and nothing else."""
        self.waiting = [self._clear, self._activation]

    def move(self, goal: Goal, force: int) -> None:
        """Queue a move, and nothing else."""
        self.waiting = [self._go(goal, force)]

    def set_force(self, force: int, unanswered: Order | None) -> None:
        """Queue a force; a move that waits, or is ``unanswered`` and would be repeated, goes with that force."""
        newest = self.waiting[-1] if self.waiting else unanswered
        goal = None if newest is None else newest.goal
        halts = [order for order in self.waiting if order.kind is OrderKind.HALT]
        self.waiting = [*halts, self._set(force) if goal is None else self._go(goal, force)]

    def halt(self) -> None:
        """Queue a halt before all else; a force that waits stays, but not that of a move that never began."""
        forces = [order.force for order in self.waiting if order.force is not None]
        begins = any(order.goal and order.goal.position != self._begun.position for order in self.waiting)
        self.waiting = [self._halt] if begins else [self._halt, *map(self._set, forces[-1:])]

    def drop(self) -> bool:
        """Drop what waits, except a halt; return whether there was anything."""
        kept = [order for order in self.waiting if order.kind is OrderKind.HALT]
        dropped = len(kept) < len(self.waiting)
        self.waiting = kept
        return dropped

    def give_up(self) -> None:
        """Forget all that waits."""
        self.waiting = []

    def send(self) -> Order:
        """Take out the next order, which is sent now."""
        order = self.waiting.pop(0)
        self._force = order.force_after(self._force)
        if order.kind is OrderKind.CLEAR:
            self.requested = None
        elif order.goal is not None:
            self.requested, self._begun = order.goal.position, order.goal
        return order

    def repeat(self, order: Order) -> bool:
        """Queue an unanswered order again; False where a newer one makes it void."""
        if order.kind is OrderKind.CLEAR:
            self.activate()
            return True
        if any(newer.kind in _VOID_BEHIND[order.kind] for newer in self.waiting):
            return False
        self.waiting.append(order)
        return True

    def _go(self, goal: Goal, force: int) -> Order:
        registers = (ACTIVATE | GO) << 8, goal.position, goal.speed << 8 | force
        return self._order(OrderKind.GO, registers, goal=goal, force=force)

    def _set(self, force: int) -> Order:
        return self._order(OrderKind.FORCE, (self._begun.speed << 8 | force,), FORCE_ADDRESS, force=force)

    def _order(
        self,
        kind: OrderKind,
        registers: tuple[int, ...],
        address: int = OUTPUT_ADDRESS,
        *,
        goal: Goal | None = None,
        force: int | None = None,
    ) -> Order:
        request = modbus.Request(self._unit, modbus.WRITE, write_address=address, registers=registers)
        return Order(kind, request, goal, force)
