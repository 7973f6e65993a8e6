"""Control of one gripper: intents in, permitted commands out, and the state that the gripper reports.

`slipd.gripper.grip_gate` decides whether a motion may happen; only what it permits is sent.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import cast

from slipd.config import Gripper as GripperConfig
from slipd.devices import GripperSession
from slipd.finger.finger import Finger
from slipd.gripper.grip_gate import judge, why_not_sent
from slipd.gripper.grip_in_force import GripInForce, not_free, pressed_n
from slipd.gripper.grip_policy import GripLimits, GripPolicy
from slipd.gripper.grip_rules import PUT_DOWN
from slipd.gripper.gripper_watch import (
    ARRIVED_M,
    COMMAND_LOST,
    LINK_LOST,
    MOTION_IGNORED,
    NO_ANSWER,
    STILL_NS,
    CommandedMotion,
    GripperFaultDetector,
)
from slipd.gripper.intent import GripperState, Intent, IntentKind, Situation
from slipd.types.arrays import finite_or_none
from slipd.types.permit import Permit, Refusal
from slipd.types.samples import GripperSample
from slipd_client.messages.names import GRIP_UNKNOWN, Health

SILENCE_NS, SILENT_PERIODS = 400_000_000, 3.0
"""A gripper that sends no reading for this time, or for three of its periods, does not answer. A session gives up
an unanswered command earlier, after two repeats."""

LONGEST_PAUSE_NS = 50_000_000
"""Longest pause between two events: after a longer one the daemon stalled. Readings wait to be read, and
unsent commands were meant for another situation."""


class GripperControl:
    """One gripper: turns what the grip gate permits into commands of its session.

    Args:
        config: ``[gripper]``.
        session: Session with the gripper.
        fingers: The fingers by name; their contact state is an input of the grip gate.

    Attributes:
        policy: The lease, the limits, the force in force and the latched fault.
        session: As given.
        grip: The grip in force.
        sample: The newest reading; None while nothing is known.
        width_m: Width between the pads, m; None if not known.
    """

    def __init__(self, config: GripperConfig, session: GripperSession, fingers: Mapping[str, Finger]) -> None:
        self._config = config
        self.session = session
        self._fingers = fingers
        self._faults = GripperFaultDetector()
        self._silence_ns = max(SILENCE_NS, round(SILENT_PERIODS * 1e9 / config.rate_hz))
        self.policy = GripPolicy(
            _limits(config),
            config.max_lease_ms,
            lambda: not self.grip.lost and session.force_acknowledged_n != session.force_sent_n,
        )
        self.grip = GripInForce(self.policy, session, self._fingers)
        self.sample: GripperSample | None = None
        self.width_m: float | None = None
        self._motion = CommandedMotion(config.rate_hz)
        self._heard_ns = 0  # later by the time in which the daemon stalled
        self._command_lost = False
        self._reported_fault = ""

    def update(self, sample: GripperSample) -> None:
        """Update with a status reading."""
        self.sample, self._heard_ns, self.width_m = sample, sample.t_ns, finite_or_none(sample.width_m)
        self.policy.latch(self._faults.update(sample, self.grip.command_n if self.policy.grips else None))
        ignored = self._motion.update(sample, self.width_m, self.session.width_range_m)
        if ignored and all(finger.presence.is_pressed() is False for finger in self._fingers.values()):
            self.policy.latch(MOTION_IGNORED)
        self.grip.update(sample, answers_command=sample.t_ns > self._motion.sent_ns)
        shown_n = min(pressed_n(self._fingers, sample.t_ns) or 0.0, self.policy.force_n or 0.0) if self.holds else 0.0
        for finger in self._fingers.values():
            finger.note_grip(shown_n)

    def drop_after_pause(self, pause_ns: int) -> None:
        """Drop unsent commands after a pause of the daemon longer than `LONGEST_PAUSE_NS`, before any is written."""
        self._heard_ns += pause_ns - LONGEST_PAUSE_NS
        self._motion.excuse()
        self._drop()

    def wake(self) -> None:
        """Handle the end of a suspend: unsent commands are dropped, the lease ends, and all readings are old."""
        self._drop()
        self.policy.lease.end()
        self._lose_sight()

    @property
    def deadline_ns(self) -> int:
        """When `on_time` may find a change, unless something else comes before."""
        if self.session.command_lost is not self._command_lost or self.policy.fault != self._reported_fault:
            return 0
        lease_ns = self.policy.lease.deadline_ns
        return lease_ns if self.sample is None else min(lease_ns, self._heard_ns + self._silence_ns + 1)

    def on_time(self, t_ns: int) -> bool:
        """Update with the time; return True if the latched fault changed or a lease expired."""
        before_lost, self._command_lost = self._command_lost, self.session.command_lost
        if self._command_lost and not before_lost:
            self.grip.lost = True
            self.policy.latch(COMMAND_LOST)
        if self.sample is not None and t_ns - self._heard_ns > self._silence_ns:
            self._forget(NO_ANSWER)
        lapsed = self.policy.lease.lapsed(t_ns)
        if lapsed:
            self.carry_out("lease_end", t_ns)
        before, self._reported_fault = self._reported_fault, self.policy.fault
        return lapsed or self._reported_fault != before

    def lose(self) -> None:
        """Handle the loss of the link: the state of the gripper is unknown, and the lease ends."""
        self._forget(LINK_LOST)
        self.policy.lease.end()

    def carry_out(
        self,
        kind: IntentKind,
        t_ns: int,
        who: bytes | None = None,
        *,
        force_n: float | None = None,
        width_m: float | None = None,
        speed_mps: float | None = None,
        drop: bool = False,
    ) -> Refusal | None:
        """Carry out an intent if the grip gate permits it; see `Intent` for the arguments.

        Returns:
            Why it was refused, and then nothing has changed; None where it was carried out.
        """
        situation = self._situation(t_ns)
        # settings may be steps
        applied_n = None if force_n is None or not math.isfinite(force_n) else self.session.applied_n(force_n)
        # a close before a release is confirmed is a change of the force that may still act
        held_n = situation.grip.force_n if kind == "close" else self.policy.force_n
        intent = Intent(kind, who, self.width_m, width_m, held_n, force_n, applied_n, speed_mps, drop)
        found = judge(intent, situation)
        if isinstance(found, Refusal):
            return found
        if found is not None and not self._carry_out(found, kind, t_ns):
            return why_not_sent(situation)
        return None

    @property
    def active(self) -> bool | None:
        """Whether the gripper is active; not while an activation is queued or under way. None: it has not answered."""
        return None if self.sample is None else self.sample.active and not self.session.activating

    @property
    def holds(self) -> bool:
        """An object stopped the fingers, and no motion is under way."""
        sample = self.sample
        return sample is not None and sample.object == "contact_closing" and not self._motion.moving

    @property
    def command(self) -> tuple[float | None, float | None]:
        """Force, N, and width, m, last sent to the gripper; None where none was."""
        return self.grip.command_n, self.grip.closed_to_m

    def acknowledge(self) -> Refusal | None:
        """Clear the latched fault; refused while a gripper with a grip in force does not answer."""
        if self.sample is None and self.policy.grips:
            return Refusal("not_ready", "the gripper had a grip in force and does not answer: wait until it answers")
        self.policy.acknowledge()
        self._faults.acknowledge()
        self.session.acknowledge()
        return None

    def conditions(self) -> list[tuple[Health, str]]:
        """Return a grip of unknown force, the latched fault, a wrong width or motion, for the status of the stream."""
        fault, sample, found = self.policy.fault, self.sample, []
        if self.policy.unknown:
            found.append((Health.ERROR, f"{GRIP_UNKNOWN}, and stays as it is: {PUT_DOWN}"))
        if fault:
            found.append((Health.ERROR, f"{fault} is latched: look at the gripper, then: slipctl grip ack (fault.ack)"))
        opened = (
            sample is not None
            and sample.object == "none"
            and (self.width_m or 0.0) >= self.session.width_range_m[1] - ARRIVED_M
        )
        if opened and all(finger.presence.is_pressed() for finger in self._fingers.values()):
            found.append((Health.WARN, "it reports open fingers, and every finger measures a contact"))
        if sample is not None and sample.t_ns - self._motion.still_ns > STILL_NS:
            found.append((Health.WARN, "it reports that its fingers move, and they stay where they are"))
        return found

    def _forget(self, fault: str) -> None:
        """Forget the state of a gripper that does not answer; that is a fault only while a grip is in force."""
        if self.policy.grips:
            self.policy.latch(fault)
        self._faults.forget()
        self._lose_sight()

    def _lose_sight(self) -> None:
        """Forget the reported state: others may move the gripper from here on."""
        self.grip.lose_sight()
        self._motion.forget()
        self.sample = self.width_m = None

    def _situation(self, t_ns: int) -> Situation:
        """Return the input of the grip gate."""
        sample, session, policy, fingers = self.sample, self.session, self.policy, self._fingers
        gripper = GripperState(
            answers=sample is not None,
            active=bool(self.active),
            activating=session.activating,
            fault="" if sample is None else sample.fault,
            moving=self._motion.moving,
            goals_m=self._motion.goals_m,
            closed_to_m=self.grip.closed_to_m,
            width_range_m=session.width_range_m,
            speed_range_mps=session.speed_range_mps,
            force_range_n=session.force_range_n,
            force_acknowledged_n=session.force_acknowledged_n,
            stops_at_lease_end=self._config.lease_end == "stop",
        )
        blind = tuple(name for name, finger in fingers.items() if not finger.trust.for_raise(t_ns))
        return Situation(policy.limits, policy.state(t_ns), gripper, blind, not_free(fingers, t_ns))

    def _carry_out(self, permit: Permit, kind: IntentKind, t_ns: int) -> bool:
        """Hand a permit to the session and record its effect; return False if nothing will be sent."""
        if permit.kind == "halt":
            self._motion.excuse()
            return self.grip.undo(lambda: self.session.execute(permit, t_ns))
        self.grip.prepare()
        if not self.session.execute(permit, t_ns):
            return False
        if permit.kind == "activate":
            self._faults.activate(t_ns)
            self.grip.renew()
            self._motion.forget()
            return True
        self.grip.record_sent(permit, kind, t_ns)
        if permit.kind == "move":
            self._motion.begin(
                goal_m=cast("float", permit.width_m),
                from_m=self.width_m,
                slowest_mps=permit.speed_mps or (self.session.speed_range_mps or (math.inf,))[0],
                t_ns=t_ns,
            )
        return True

    def _drop(self) -> None:
        """Drop unsent commands; a dropped command is a fault."""
        if self.grip.undo(self.session.drop):
            self.grip.lost = True
            self.policy.latch(COMMAND_LOST)


def _limits(config: GripperConfig) -> GripLimits:
    return GripLimits(
        min_n=config.min_force_n or 0.0,
        max_n=config.max_force_n,
        step_n=config.step_n,
        raise_n_per_s=config.raise_n_per_s,
        lower_n_per_s=config.lower_n_per_s,
        budget_n=(config.max_force_n if config.budget_n is None else config.budget_n) or 0.0,
    )
