"""The grip in force: how it began, whether it holds an object, and what remains after a dropped command."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple, cast

from slipd.devices import GripperSession
from slipd.finger.finger import Finger
from slipd.gripper.grip_policy import GripPolicy
from slipd.gripper.intent import IntentKind
from slipd.gripper.stored_state import StoredGrip
from slipd.types.arrays import finite_or_none
from slipd.types.permit import Permit
from slipd.types.samples import GripperSample

SAME_WIDTH_M, SAME_FORCE_N = 1e-3, 1.0
"""A gripper that holds what it held reports the same width and force within this."""


def pressed_n(fingers: Mapping[str, Finger], t_ns: int) -> float | None:
    """Return the largest normal force of the trusted contacts, N; None without a trusted contact."""
    forces_n = (finger.presence.contact_force_n(t_ns) for finger in fingers.values())
    return max((force_n for force_n in forces_n if force_n is not None), default=None)


def not_free(fingers: Mapping[str, Finger], t_ns: int) -> tuple[str, ...]:
    """Return the fingers that are pressed, or not known to be free."""
    return tuple(
        name
        for name, finger in fingers.items()
        if finger.presence.is_pressed() is not False or not finger.trust.for_opening(t_ns)
    )


class _Before(NamedTuple):
    """The grip in force before the session sent any force.

    Attributes:
        force_n: Force of the grip, N; None: no grip, or not known.
        unknown: There was a grip with an unknown force.
        claimed: As `GripInForce._claimed`.
    """

    force_n: float | None
    unknown: bool
    claimed: bool


class GripInForce:
    """Keeps the force in force of the policy consistent with what the gripper was sent and reports.

    A grip begins with a command of this run, or it is found: after a start, or after the gripper did not answer, a grip
    that no command of this run began may hold an object. Such a grip counts as in force.

    Args:
        policy: Keeps the force in force.
        session: Session with the gripper.
        fingers: The fingers by name.

    Attributes:
        command_n: Force last sent to the gripper, N, by the run before where its grip lasts; None if none was sent or
            the gripper is inactive.
        closed_to_m: Commanded width of the grip in force, m; None: no grip, or not known.
        lost: A command was lost, and none was sent since: only the force that was acknowledged surely acts.
    """

    def __init__(self, policy: GripPolicy, session: GripperSession, fingers: Mapping[str, Finger]) -> None:
        self._policy, self._session, self._fingers = policy, session, fingers
        self.command_n: float | None = None
        self.closed_to_m: float | None = None
        self.lost = False
        # held: in this grasp, an object stopped the gripper or pressed on a finger;
        # claimed: a command of this run decided what the gripper holds, or that it holds nothing
        self._held = self._claimed = False
        self._before = _Before(None, unknown=False, claimed=False)
        self._newest: GripperSample | None = None
        self._stored: StoredGrip | None = None
        self._confirmed: Callable[[], None] = lambda: None

    def restore(self, grip: StoredGrip, confirmed: Callable[[], None]) -> None:
        """Keep the grip of the run before until the gripper confirms or contradicts it.

        Args:
            grip: The grip.
            confirmed: Called once the gripper confirms it.
        """
        self._stored, self._confirmed = grip, confirmed

    def kept(self) -> StoredGrip | None:
        """Return the grip in force for the next run; None without one, or where its force is not known.

        While the gripper does not answer, it is the grip as of the last reading: the next run asks whether it lasts.
        """
        policy, sample, force_n = self._policy, self._newest, self._policy.force_n
        if force_n is None or sample is None:
            return self._stored
        acknowledged_n = self._session.force_acknowledged_n
        return StoredGrip(
            force_n=acknowledged_n if self.lost and acknowledged_n is not None else force_n,
            requested_n=policy.requested_n,
            raised_n=policy.raised_n,
            reflexed_n=policy.reflexed_n,
            closed_to_m=self.closed_to_m,
            width_m=finite_or_none(sample.width_m),
            object=sample.object,
            reported_n=finite_or_none(sample.force_n),
        )

    def update(self, sample: GripperSample, *, answers_command: bool) -> None:
        """Update with a status reading; while a finger is pressed, no report of the gripper ends a grasp.

        Args:
            sample: The reading.
            answers_command: The reading came after the last motion was sent.
        """
        self._newest = sample
        if not sample.active:
            self._end_grasp()
            self.command_n = None
        elif answers_command and self._policy.releasing:
            if self._is_released(sample):
                self._policy.end_grasp()
        elif answers_command:
            if sample.object.startswith("contact"):
                self._held = True
            elif (
                self._held
                and sample.object == "none"
                and not any(finger.presence.is_pressed() for finger in self._fingers.values())
            ):
                self._end_grasp()
            if not self._claimed:
                self._adopt(sample)

    def lose_sight(self) -> None:
        """Record that the gripper does not answer: others may move it, and grip if no grip is in force."""
        self._claimed = self._claimed and self._policy.grips

    def prepare(self) -> None:
        """Record the grip in force before a command; a new session knows nothing of an earlier grip."""
        if self._session.force_sent_n is None:
            self._before = _Before(self._policy.force_n, self._policy.unknown, self._claimed)

    def record_sent(self, permit: Permit, kind: IntentKind, t_ns: int) -> None:
        """Record that the session accepted a permit for a motion or a force."""
        self.command_n = applied_n = cast("float", self._session.force_sent_n)
        if permit.kind == "move":
            self._held = self._held and self._policy.grips
        if kind == "open":
            self._held = False
            self._policy.begin_release(applied_n)
        else:
            self.closed_to_m = permit.width_m if permit.kind == "move" else self.closed_to_m
            self._policy.record_force(applied_n, t_ns, reflex=kind == "reflex")
        self._claimed, self._stored, self.lost = True, None, False

    def renew(self) -> None:
        """Forget what was sent: an activation voids it, and the gripper decides what becomes of its grip."""
        self._held = self._claimed = False
        self._stored = None
        self._policy.begin_release()
        self.command_n = None

    def undo(self, forget: Callable[[], bool]) -> bool:
        """Let the session forget unsent commands, and restore the force that they would have changed."""
        to_be_n = self._session.force_sent_n
        done = forget()
        sent_n = self._session.force_sent_n
        if sent_n != to_be_n and sent_n is not None:
            self.command_n = sent_n
            self._policy.restore(sent_n)
        elif sent_n != to_be_n:
            force_n, unknown, self._claimed = self._before
            self.command_n = force_n if self._claimed else None
            self._policy.restore(force_n, unknown=unknown)
        return done

    def _is_released(self, sample: GripperSample) -> bool:
        """Return whether the release is confirmed; while the fingers move, only fingers known to be free confirm it."""
        if sample.object == "contact_closing" or pressed_n(self._fingers, sample.t_ns) is not None:
            return False
        return not sample.moving or not not_free(self._fingers, sample.t_ns)

    def _end_grasp(self) -> None:
        """End the grasp, its force and its budget."""
        self._policy.end_grasp()
        self._held = self._claimed = False
        self._stored = None
        self.closed_to_m = None

    def _adopt(self, sample: GripperSample) -> None:
        """Adopt a grip that no command of this run began as the one in force.

        Until a command changes it, its force is what the session knows to have been sent last, or else what the gripper
        reports, or else the larger force that the fingers measure.
        """
        stored, self._stored = self._stored, None
        if stored is not None and _confirms(sample, stored):
            self._claimed, self.closed_to_m, self.command_n = True, stored.closed_to_m, stored.force_n
            self._policy.resume(stored.force_n, stored.requested_n, stored.raised_n, stored.reflexed_n)
            self._confirmed()
            return
        measured_n = pressed_n(self._fingers, sample.t_ns)
        if not sample.object.startswith("contact") and measured_n is None:
            return
        self._held, self.closed_to_m = True, None
        sent_n = self._session.force_sent_n
        if sent_n is not None:
            self._policy.restore(sent_n)
            return
        reported_n = finite_or_none(sample.force_n) or 0.0
        self._policy.adopt(reported_n if reported_n > 0.0 else measured_n)


def _confirms(sample: GripperSample, stored: StoredGrip) -> bool:
    """Return whether the gripper still holds what it held: an object, at the same width and with the same force.

    A kept force that was never sent, because the daemon was killed before, is not what the gripper reports.
    """
    if not sample.object.startswith("contact") or sample.object != stored.object:
        return False
    if sample.width_m is None or stored.width_m is None or sample.moving:
        return False
    if not math.isclose(sample.width_m, stored.width_m, abs_tol=SAME_WIDTH_M):
        return False
    if sample.force_n is None:
        return True
    before_n = (stored.force_n, stored.force_n if stored.reported_n is None else stored.reported_n)
    return all(math.isclose(sample.force_n, force_n, abs_tol=SAME_FORCE_N) for force_n in before_n)
