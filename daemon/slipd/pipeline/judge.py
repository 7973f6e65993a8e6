"""The verdict on one contact: what force and image together say of it, reading by reading."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from slipd.config import Finger as FingerConfig
from slipd.config import Levels
from slipd.fusion import Contact, Loads, SlipDetector, SlipSettings, Utilisation, utilisation_of, utilisations_of
from slipd.pipeline.decision import CAUTION, NAMES, STABLE, LevelGate, Verdict, danger_reasons
from slipd.pipeline.force import Doubt
from slipd.pipeline.image import Shares
from slipd.samples import Array

#: The spin is most of the load where translation alone explains less than this share of the utilisation.
ROTATION_SHARE = 0.7
#: Relative gap of the bounds of utilisation: far below what a threshold, or a message, can tell apart.
DECISION_GAP = 1e-6
HOLDS = Verdict("stable", ())


class Ahead:
    """The utilisation of the readings of one read, found together when the first of them needs it.

    Args:
        wrenches: Force and torque on the pad of each reading, six numbers each.
        contact_n: Normal force at which a contact begins, and down to which it lasts, N.

    Attributes:
        at: The reading whose turn it is.
    """

    def __init__(self, wrenches: list[tuple[float, ...]], contact_n: tuple[float, float]) -> None:
        self._wrenches, self._contact_n = wrenches, contact_n
        self.at = 0
        self._first = 0
        self._found: list[Utilisation] = []

    def utilisation(self, shares: Shares, mu: float, twist: tuple[float, float, float] | None) -> Utilisation:
        """λ of the reading, which is in contact; the image and μ are those of the whole read."""
        if not self._found:
            self._first = self.at
            wrenches = np.array(self._wrenches[self.at :])
            loads = shares.loads.loads
            self._found = utilisations_of(
                shares.x, shares.y, loads, mu, wrenches, self._contact_n, True, twist, DECISION_GAP
            )
        return self._found[self.at - self._first]


@dataclass(slots=True)
class State:
    """What is known of a finger after its newest force reading; None or NaN is unknown.

    Attributes:
        t_ns: When the reading was acquired, CLOCK_MONOTONIC.
        verdict: Level and reasons.
        wrench: Force on the finger in the pad frame, N, and torque about the pad's origin, N·m: six numbers.
        contact: What the force sensor alone sees; not valid without contact.
        shares: How the image shares the normal force among its taxels.
        utilisation: λ of the load, with its bounds.
        tipping_margin_m: Signed distance of the centroid to the outline of the image, m.
        model: "none", "translation" or "exact": the most that was needed.
        status: Conditions that the device reported with the reading.
    """

    t_ns: int
    verdict: Verdict
    wrench: tuple[float, ...] | None = None
    contact: Contact | None = None
    shares: Shares | None = None
    utilisation: Utilisation | None = None
    tipping_margin_m: float = math.nan
    model: str = "none"
    status: tuple[str, ...] = ()

    @property
    def force_n(self) -> Array | None:
        """Force on the finger in the pad frame, shape (3,), N."""
        return None if self.wrench is None else np.array(self.wrench[:3])

    @property
    def torque_nm(self) -> Array | None:
        """Torque about the pad's origin, shape (3,), N·m."""
        return None if self.wrench is None else np.array(self.wrench[3:])

    @property
    def loads(self) -> Loads | None:
        """Normal forces on the active taxels, N."""
        if self.shares is None or self.contact is None:
            return None
        shares = self.shares.loads
        return Loads(shares.loads * self.contact.normal_n, shares.centroid_residual_m, shares.status)


class Judge:
    """Judges the readings of one contact.

    Args:
        config: ``[finger.X]``.
        levels: ``[levels]``.
    """

    def __init__(self, config: FingerConfig, levels: Levels) -> None:
        self._mu = config.mu
        self._caution = levels.caution
        self._pitch_m = config.pad.pitch_m if config.pad is not None else math.nan
        self._gate = LevelGate(levels)
        settings = SlipSettings(**config.slip.model_dump())
        self._translation_slip, self._rotation_slip = SlipDetector(settings), SlipDetector(settings)
        self._twist: tuple[float, float, float] | None = None

    def end_contact(self) -> None:
        """The contact ended, or is not known any more."""
        self._gate.reset()
        self._translation_slip.reset()
        self._rotation_slip.reset()
        self._twist = None

    def judge(self, state: State, contact: Contact, shares: Shares | None, ahead: Ahead, doubt: Doubt) -> None:
        """Fills in what a valid contact means.

        Args:
            state: Of the reading; its time is set.
            contact: The contact, valid; without torque, its centroid and spin are NaN.
            shares: Of a fresh image; None where there is none.
            ahead: The utilisation of this reading and of those read with it.
            doubt: What the readings may hold beside the contact's load.
        """
        mu = self._mu
        state.shares = shares
        if shares is not None:
            state.tipping_margin_m = shares.outline.margin_m(contact.cx_m, contact.cy_m)
        if mu is None:
            state.verdict = Verdict("unknown", ("no_mu",))
            return
        translation = contact.friction_ratio / mu
        if shares is None or math.isnan(contact.spin_nm):
            state.model = "translation"
            slips = self._slips(state.t_ns, contact, translation, translation)
            state.verdict = self._without_rotation(translation, slips)
            return
        state.model = "exact"
        used = ahead.utilisation(shares, mu, self._twist)
        self._twist = used.twist
        state.utilisation = used
        slips = self._slips(state.t_ns, contact, used.value, translation)
        upper = math.inf if math.isnan(used.upper) else used.upper  # no number is no safety
        if doubt.force_n > 0.0:
            upper = self._doubted(shares, contact, mu, upper, doubt)
        state.verdict = self._with_image(used, upper, self._tips(state, contact, doubt), translation, slips)

    def _doubted(self, shares: Shares, contact: Contact, mu: float, upper: float, doubt: Doubt) -> float:
        """Largest λ with an unknown force and torque beside the load: the gauge grows by no more than its parts."""
        normal_n, force_n = contact.normal_n, doubt.force_n
        if normal_n <= force_n:
            return math.inf
        at = (contact.cx_m, contact.cy_m)
        turn = utilisation_of(shares.x, shares.y, shares.loads.loads, mu, (0.0, 0.0), doubt.torque_nm / normal_n, at)
        return (upper * normal_n + force_n / mu + turn.upper * normal_n) / (normal_n - force_n)

    def _with_image(
        self, used: Utilisation, upper: float, tips: tuple[int, tuple[str, ...]], translation: float, slips: bool
    ) -> Verdict:
        step = self._gate.update(upper)
        tipping, why = tips
        if step == tipping == STABLE and not slips:
            return HOLDS
        reasons = danger_reasons(used.value, translation, self._caution) if step > STABLE else ()
        if step > STABLE and used.upper < self._caution and "weight_unknown" not in why:
            reasons = (*reasons, "weight_unknown") if upper > used.upper else reasons
        if slips:
            return Verdict("slipping", ("slip_detected", *reasons, *why))
        return Verdict(NAMES[max(step, tipping)], (*reasons, *why))

    def _without_rotation(self, translation: float, slips: bool) -> Verdict:
        """Translation alone can only prove a grip unsafe, never safe."""
        unsafe = self._gate.update(translation) == len(NAMES) - 1
        reasons = ("translation",) if unsafe else ("rotation_unobserved",)
        if slips:
            return Verdict("slipping", ("slip_detected", *reasons))
        return Verdict("warning" if unsafe else "unknown", reasons)

    def _tips(self, state: State, contact: Contact, doubt: Doubt) -> tuple[int, tuple[str, ...]]:
        """Step that the tipping margin asks for: taxels sense over a cell, so the hull is uncertain by half a pitch.

        Noise excuses a centroid that lies outside; a doubt of the weight does not, for it may as well hide one.
        """
        std_m = math.hypot(doubt.torque_std_nm, math.hypot(contact.cx_m, contact.cy_m) * doubt.force_std_n)
        outside = -(state.tipping_margin_m + 2.0 * std_m / contact.normal_n) / (0.5 * self._pitch_m)
        step = STABLE + (outside > 0.0) + (outside > 1.0)
        if step > STABLE or doubt.force_n == 0.0:
            return step, ("tipping",) if step > STABLE else ()
        arm_nm = doubt.torque_nm + math.hypot(contact.cx_m, contact.cy_m) * doubt.force_n
        shift_m = arm_nm / max(contact.normal_n - doubt.force_n, 1e-9)
        hidden = state.tipping_margin_m < shift_m - 0.5 * self._pitch_m
        return (CAUTION, ("tipping", "weight_unknown")) if hidden else (STABLE, ())

    def _slips(self, t_ns: int, contact: Contact, used: float, translation: float) -> bool:
        """Watches force and spin; the spin only where it is most of the load, for else its fall is noise."""
        t_s = t_ns * 1e-9
        normal_n = contact.normal_n
        turning = used if translation < ROTATION_SHARE * used else math.nan
        translates = self._translation_slip.update(t_s, contact.tangential_norm_n, normal_n, used)
        rotates = self._rotation_slip.update(t_s, abs(contact.spin_nm), normal_n, turning)
        return translates or rotates
