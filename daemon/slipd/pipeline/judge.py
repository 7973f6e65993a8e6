"""The verdict on one contact: what force and image together say of it, reading by reading."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from slipd.config import Finger as FingerConfig
from slipd.config import Levels
from slipd.fusion import Contact, Loads, SlipDetector, SlipSettings, Utilisation, utilisation_of
from slipd.pipeline.decision import NAMES, STABLE, LevelGate, Verdict, danger_reasons
from slipd.pipeline.image import Shares
from slipd.samples import Array

#: The spin is most of the load where translation alone explains less than this share of the utilisation.
ROTATION_SHARE = 0.7
#: Relative gap of the bounds of utilisation: far below what a threshold, or a message, can tell apart.
DECISION_GAP = 1e-6
HOLDS = Verdict("stable", ())


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

    def judge(
        self, state: State, contact: Contact, shares: Shares | None, doubt: tuple[float, ...] = (0.0, 0.0)
    ) -> None:
        """Fills in what a valid contact means.

        Args:
            state: Of the reading; its time is set.
            contact: The contact, valid; without torque, its centroid and spin are NaN.
            shares: Of a fresh image; None where there is none.
            doubt: Force, N, and torque, N·m, that the readings may hold beside the contact's.
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
        normal_n = contact.normal_n
        used = utilisation_of(
            shares.x,
            shares.y,
            shares.loads.loads,
            mu,
            (contact.fx_n / normal_n, contact.fy_n / normal_n),
            contact.spin_nm / normal_n,
            (contact.cx_m, contact.cy_m),
            start=self._twist,
            gap=DECISION_GAP,
        )
        self._twist = used.twist
        state.utilisation = used
        slips = self._slips(state.t_ns, contact, used.value, translation)
        doubted = self._doubted(shares, contact, mu, doubt) if doubt[0] > 0.0 else 0.0
        upper = math.inf if math.isnan(used.upper) else used.upper + doubted  # no number is no safety
        state.verdict = self._with_image(used, upper, self._tips(state, contact), translation, slips)

    def _doubted(self, shares: Shares, contact: Contact, mu: float, doubt: tuple[float, ...]) -> float:
        """Most that an unknown force and torque add to λ, which is a gauge and so grows by no more than its parts."""
        shift = doubt[0] * math.hypot(1.0, contact.friction_ratio) / (mu * contact.normal_n)
        at = (contact.cx_m, contact.cy_m)
        turn = utilisation_of(shares.x, shares.y, shares.loads.loads, mu, (0.0, 0.0), doubt[1] / contact.normal_n, at)
        return shift + turn.upper

    def _with_image(self, used: Utilisation, upper: float, tips: int, translation: float, slips: bool) -> Verdict:
        step = self._gate.update(upper)
        if step == tips == STABLE and not slips:
            return HOLDS
        reasons = danger_reasons(used.value, translation, self._caution) if step > STABLE else ()
        if tips > STABLE:
            step, reasons = max(step, tips), (*reasons, "tipping")
        if step > STABLE and used.upper < self._caution and "tipping" not in reasons:
            reasons = (*reasons, "weight_unknown")
        if slips:
            return Verdict("slipping", ("slip_detected", *reasons))
        return Verdict(NAMES[step], reasons)

    def _without_rotation(self, translation: float, slips: bool) -> Verdict:
        """Translation alone can only prove a grip unsafe, never safe."""
        unsafe = self._gate.update(translation) == len(NAMES) - 1
        reasons = ("translation",) if unsafe else ("rotation_unobserved",)
        if slips:
            return Verdict("slipping", ("slip_detected", *reasons))
        return Verdict("warning" if unsafe else "unknown", reasons)

    def _tips(self, state: State, contact: Contact) -> int:
        """Step that the tipping margin asks for: taxels sense over a cell, so the hull is uncertain by half a pitch."""
        noise_m = 2.0 * max(contact.cx_std_m, contact.cy_std_m)
        outside = -(state.tipping_margin_m + noise_m) / (0.5 * self._pitch_m)
        return STABLE + (outside > 0.0) + (outside > 1.0)

    def _slips(self, t_ns: int, contact: Contact, used: float, translation: float) -> bool:
        """Watches force and spin; the spin only where it is most of the load, for else its fall is noise."""
        t_s = t_ns * 1e-9
        normal_n = contact.normal_n
        turning = used if translation < ROTATION_SHARE * used else math.nan
        translates = self._translation_slip.update(t_s, contact.tangential_norm_n, normal_n, used)
        rotates = self._rotation_slip.update(t_s, abs(contact.spin_nm), normal_n, turning)
        return translates or rotates
