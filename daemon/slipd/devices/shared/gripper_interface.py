"""Interface of a gripper's session. `slipd.devices` exports it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, runtime_checkable

from slipd.devices.shared.device_interface import Session

if TYPE_CHECKING:
    from slipd.types.permit import Permit


@runtime_checkable
class GripperSession(Session, Protocol):
    """Protocol session with a gripper, in metres between the pads and newtons on one pad.

    Nothing moves without a permit, and a permit that the gripper cannot accept sends nothing. A table in a module of
    its own (``<device>_states``) defines what the session accepts in each state.
    """

    @property
    def activating(self) -> bool:
        """Whether an activation is queued or in progress; until it is over no move and no force is accepted."""
        ...

    @property
    def command_lost(self) -> bool:
        """Whether the gripper refused the last command, or never acknowledged it."""
        ...

    @property
    def width_range_m(self) -> tuple[float, float]:
        """Smallest and largest width between the pads, m; (0, inf) until the gripper reports them."""
        ...

    @property
    def width_step_m(self) -> float:
        """Resolution of the reported width, m; 0: as fine as its numbers."""
        ...

    @property
    def speed_range_mps(self) -> tuple[float, float] | None:
        """Smallest and largest speed, m/s; None if the speed cannot be set."""
        ...

    @property
    def force_range_n(self) -> tuple[float, float]:
        """Smallest and largest force, N on one pad; (0, inf) until the gripper reports them."""
        ...

    @property
    def force_sent_n(self) -> float | None:
        """Force in effect after all queued commands, N on one pad; None if none was sent since the activation."""
        ...

    def applied_n(self, force_n: float) -> float:
        """Return the force that would be sent for ``force_n``; the gripper may only have discrete settings."""
        ...

    def execute(self, permit: Permit, now_ns: int) -> bool:
        """Carry out a permit, the only way to command the gripper.

        - "activate" makes the gripper ready; some grippers open and close fully meanwhile. All queued commands are
          dropped.
        - "move" moves the fingers to a width, with a force and a speed (None: the session's default).
        - "set_force" changes the force at the width sent last; a move that is not sent yet is sent with that force.
        - "halt" stops the fingers where they are, before all else. A move or an activation that is not sent yet is
          dropped; a force that is not sent yet may still be sent.

        Args:
            permit: Permit of the motion gate.
            now_ns: Time of the call.

        Returns:
            True if the permit is accepted: something will be sent, or, for "halt", something unsent was dropped.
            `force_sent_n` is then the new force, at most ``permit.force_n`` or else the gripper's smallest force.
            False if nothing will be sent, because the gripper is not known to be active, reports a fault, or is
            activating.

        Raises:
            ValueError: The width or speed is out of the gripper's range, or a value is missing or not finite.
        """
        ...

    def drop(self) -> bool:
        """Drop commands that are not sent yet, except a stop; return whether there were any.

        An unanswered command remains, but is not repeated.
        """
        ...

    def acknowledge(self) -> None:
        """Forget that a command was lost, and acknowledge the fault to the gripper; move nothing."""
        ...
