"""What must hold of every command that leaves for a gripper, whoever caused it."""

from __future__ import annotations

from gripper_peers import SentCommand
from motions.cell import MOST_N, Cell

EPS_N = 1e-3
MOTIONS = ("gripper.open", "gripper.close", "gripper.activate")


class WireOracle:
    """Looks at the commands on the wire of a cell.

    Attributes:
        cell: The cell.
        granted: The last motion that was granted; what it has sent is seen before its reply.
    """

    cell: Cell
    granted: str

    def look_at_wire(self, sent: SentCommand) -> None:
        """A command leaves for the gripper."""
        cell, jaws = self.cell, self.cell.jaws
        if sent.kind == "activate":
            assert self.granted == "gripper.activate", "activated, and who may was not granted it"
        if sent.width_m is not None and sent.width_m < jaws.width_m - jaws.RESOLUTION_M:
            assert self.granted == "gripper.close", f"narrows to {sent.width_m}, and nobody closes who may"
            assert cell.policy.force_n is not None, "narrows without a grip in force"
        if sent.width_m is not None and sent.width_m > jaws.width_m + jaws.RESOLUTION_M:
            assert self.granted == "gripper.open", f"widens to {sent.width_m}, and nobody opens who may"
        if sent.force_n is not None:
            assert jaws.forces_n[0] - EPS_N <= sent.force_n <= MOST_N + EPS_N
            in_force_n = cell.policy.state(cell.t_ns).force_n or jaws.forces_n[0]
            assert abs(sent.force_n - in_force_n) <= EPS_N, "another force than the one in force"
