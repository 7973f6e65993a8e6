"""The script of the demo: the loads on the object over time, including a hand that pulls like a spring.

Loads act on the object and are in the frame of the left pad: x points towards the fingertips, which point down, so
weight is along +x. Friction transmits them to the fingers. The spin torque is about the centre of the contact, below
which the weight of the object acts.
"""

from __future__ import annotations

from dataclasses import dataclass

from slipd.tools.sim.true_contact import Load

GRAVITY_MPS2 = 9.81


@dataclass(frozen=True)
class Script:
    """When each phase begins, in s from the start, and how much it loads the object.

    Attributes:
        lift_s: The object is lifted from the table; its weight increases over ``ramp_s``.
        ramp_s: How long the weight takes to move to the gripper, or back to the table.
        pour_s: Something is poured into the far end of the object until ``pour_until_s``; its weight grows, and with it
            the torque about the normal of the pads.
        pour_until_s: End of that growth; the poured weight stays.
        drain_s: The poured weight starts to drain, within ``drain_takes_s``.
        drain_takes_s: How long that takes; a load that vanishes faster looks like a slip.
        pour_n_per_s: Growth of the poured weight.
        lever_m: Horizontal distance of the poured weight from the centre of the contact.
        tug_s: A hand starts to pull the object along +y of the left pad.
        tug_speed_mps: Speed of the hand; a slower one lets the object stick and slip in turns.
        tug_stiffness_n_per_m: Stiffness of the hand: the pull grows by stiffness times speed until the object slips.
        tug_damping_ns_per_m: Damping of the hand, so that the object follows without bouncing.
        tug_slip_s: The hand lets go when the object has slipped for this long.
        set_down_s: The table takes over the load within ``ramp_s``; the hand lets go.
    """

    lift_s: float = 4.0
    ramp_s: float = 0.5
    pour_s: float = 6.0
    pour_until_s: float = 10.0
    drain_s: float = 11.5
    drain_takes_s: float = 1.0
    pour_n_per_s: float = 0.35
    lever_m: float = 0.06
    tug_s: float = 13.0
    tug_speed_mps: float = 0.03
    tug_stiffness_n_per_m: float = 750.0
    tug_damping_ns_per_m: float = 40.0
    tug_slip_s: float = 0.3
    set_down_s: float = 15.0

    def carried(self, t_s: float) -> float:
        """Return the share of the weight that the gripper carries, not the table, 0 to 1."""
        return _ramp(t_s, self.lift_s, self.ramp_s) - _ramp(t_s, self.set_down_s, self.ramp_s)

    def weight(self, t_s: float, mass_kg: float) -> Load:
        """Return the load of the weight of the object and of what was poured into it."""
        poured_s = max(min(t_s, self.pour_until_s) - self.pour_s, 0.0)
        poured_n = self.pour_n_per_s * poured_s * (1.0 - _ramp(t_s, self.drain_s, self.drain_takes_s))
        carried = self.carried(t_s)
        return carried * (mass_kg * GRAVITY_MPS2 + poured_n), 0.0, carried * poured_n * self.lever_m

    def tug_n(self, pulled_s: float, moved_m: float, speed_mps: float) -> float:
        """Return the pull of the hand, N, ``pulled_s`` after it gripped an object that has moved by ``moved_m``."""
        stretch_m = self.tug_speed_mps * pulled_s - moved_m
        return max(self.tug_stiffness_n_per_m * stretch_m - self.tug_damping_ns_per_m * speed_mps, 0.0)

    def phase(self, t_s: float) -> str:
        """Return the name of the phase at a time."""
        name = "approach"
        for begins_s, phase in (
            (self.lift_s, "lift"),
            (self.pour_s, "pour"),
            (self.pour_until_s, "hold"),
            (self.drain_s, "drain"),
            (self.tug_s, "tug"),
            (self.set_down_s, "set_down"),
            (self.set_down_s + self.ramp_s, "on_table"),
        ):
            if t_s >= begins_s:
                name = phase
        return name


def _ramp(t_s: float, begins_s: float, takes_s: float) -> float:
    return min(max((t_s - begins_s) / takes_s, 0.0), 1.0)
