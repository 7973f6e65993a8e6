"""Level of one contact, reading by reading: utilisation against thresholds with hysteresis, tipping, and slip.

At the onset of slip, R falls from the static to the dynamic friction coefficient (paper, after eq. (4)). R also falls
when the grip is tightened, and the load falls when an object is set down. A drop counts as slip only when the load
itself gives way, quickly, and from near the friction limit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from slipd.fusion.compiled import compiled
from slipd.fusion.load_drop import fell
from slipd.fusion.rows import (
    CAUTION,
    FREE,
    LOAD_DROP_BIT,
    NO_CONTACT,
    SLIPPING,
    STABLE,
    TOUCHING,
    UNKNOWN,
    UNSOLVED,
    UNTRUSTED,
    WARNING,
    WATCH,
    WINDOW,
    Rows,
    new_rows,
)

FIRST_CAPACITY = 64
"""Initial capacity of a window, in readings; it grows when they come faster."""
ROTATION_SHARE = 0.7
"""The load is mostly spin if translation alone explains less than this fraction of the utilisation."""


@dataclass(frozen=True, slots=True)
class SlipSettings:
    """When a drop counts as a slip.

    Attributes:
        drop: Minimum relative fall of R and of the load: less than the fall from static to dynamic friction of most
            material pairs.
        window_s: The fall happens within this time; setting an object down takes longer, s.
        armed_at: Minimum utilisation within the window: slip begins at 1, and the estimate of μ is a safe one.
        hold_s: A slip stays reported for this long, s.
    """

    drop: float = 0.12
    window_s: float = 0.04
    armed_at: float = 0.7
    hold_s: float = 0.25


@dataclass(frozen=True, slots=True)
class Thresholds:
    """Utilisation at which the steps CAUTION and WARNING begin; each ends ``hysteresis`` below that."""

    caution: float
    warning: float
    hysteresis: float


class Uncertainty(NamedTuple):
    """How far a reading may be off: noise, and what an unknown load may add.

    Attributes:
        force_std_n: Standard deviation of each force component, N.
        torque_std_nm: Standard deviation of each torque component, N·m.
        force_n: Most that the unknown load adds to the force, N.
        torque_nm: Most that it adds to the torque, N·m.
    """

    force_std_n: float = 0.0
    torque_std_nm: float = 0.0
    force_n: float = 0.0
    torque_nm: float = 0.0


class Assessment(NamedTuple):
    """Verdict on one reading: the fields of a row of ASSESSMENT.

    Attributes:
        level: NO_CONTACT, STABLE + 1, CAUTION + 1, WARNING + 1, SLIPPING or UNKNOWN.
        friction_step: Step that the utilisation asks for: STABLE, CAUTION or WARNING.
        tipping_step: Step that the tipping margin asks for.
        utilisation_upper: Upper bound of the utilisation with what the unknown load may add; NaN where unknown.
        slips: It slips, or did within ``hold_s``.
        tipping_by_unknown_load: The tipping margin asks for its step only because of the unknown load.
        evidence: What shows that it slips: bits of `slipd.motion.evidence.EVIDENCE`; 0 where it does not slip.
        required_friction: q, the coefficient of friction at which the load would just slip; NaN where unknown.
        peak_required: q just before the load dropped; NaN where it did not.
        plateau_required: q while it slides; NaN where it does not.
        drop_surprise: −ln of the probability of such a drop without motion; 0 without a drop.
    """

    level: int
    friction_step: int
    tipping_step: int
    utilisation_upper: float
    slips: bool
    tipping_by_unknown_load: bool
    evidence: int
    required_friction: float
    peak_required: float
    plateau_required: float
    drop_surprise: float


class ContactWatch:
    """Assesses the readings of one contact; keeps what the hysteresis and the windows of the slip need.

    Args:
        thresholds: Of the utilisation.
        slip: When a drop counts as a slip.
        half_pitch_m: Half the distance between taxels, the uncertainty of an image's outline, m; NaN without image.
        least_n: Normal force at which a contact begins, N.
    """

    def __init__(self, thresholds: Thresholds, slip: SlipSettings, half_pitch_m: float, least_n: float) -> None:
        self._watch = new_rows(WATCH, 1)
        for name in ("caution", "warning", "hysteresis"):
            self._watch[name] = getattr(thresholds, name)
        for name in ("window_s", "armed_at", "hold_s"):
            self._watch[name] = getattr(slip, name)
        self._watch["half_pitch_m"], self._watch["least_n"] = half_pitch_m, least_n
        self._in_force: tuple[float, Uncertainty, float] | None = None  # friction and uncertainty in the row
        self._most_kept = 0  # upper bound of the readings in a window
        self._capacity = FIRST_CAPACITY
        self._windows = np.zeros((2, FIRST_CAPACITY), WINDOW)  # rings, of force and of spin
        self.set_drop(slip.drop)
        self.reset()

    def reset(self) -> None:
        """Forget everything: the contact ended."""
        self._watch["count"], self._watch["first"] = 0, 0
        self._watch["step"], self._watch["slip_until_s"], self._watch["moving_until_s"] = STABLE, -math.inf, -math.inf

    def set_drop(self, drop: float) -> None:
        """Set another minimum fall: the friction coefficients are known better now."""
        self._watch["kept"] = 1.0 - drop

    def note_motion(self, until_s: float, evidence: int) -> None:
        """Report slip until a time, because other evidence than the load shows motion.

        Args:
            until_s: Time of the readings until which the object is taken to move, s.
            evidence: Its kinds: bits of `slipd.motion.evidence.EVIDENCE`.
        """
        self._watch["moving_until_s"], self._watch["moving_evidence"] = until_s, evidence

    def assess(self, readings: Rows, mu: float, uncertainty: Uncertainty, spin_utilisation_1n: float) -> None:
        """Fill in the assessment of readings in sequence.

        Args:
            readings: Rows of READING with contacts and, where an image shows the rotation, margins and utilisations,
                shape (n,); their times rise.
            mu: Coefficient of static friction; NaN: unknown.
            uncertainty: Of all of them.
            spin_utilisation_1n: λ of the uncertain torque alone at a normal force of 1 N.
        """
        if self._in_force != (mu, uncertainty, spin_utilisation_1n):
            self._in_force = mu, uncertainty, spin_utilisation_1n
            self._watch["mu"], self._watch["spin_utilisation_1n"] = mu, spin_utilisation_1n
            for name, value in zip(Uncertainty._fields, uncertainty, strict=True):
                self._watch[name] = value
        count = len(readings)
        self._most_kept += count
        while self._most_kept > self._capacity:
            self._most_kept = int(self._watch["count"].max()) + count
            if self._most_kept > self._capacity:
                self._grow()
        _assess(readings, self._watch, self._windows)

    def _grow(self) -> None:
        """Double the capacity of the windows, with each window's first reading in front."""
        grown = np.zeros((2, 2 * self._capacity), WINDOW)
        for which, first in enumerate(self._watch["first"][0].tolist()):
            grown[which, : self._capacity] = np.roll(self._windows[which], -first)
        self._windows, self._capacity, self._watch["first"] = grown, 2 * self._capacity, 0


@compiled
def _assess(readings: Rows, watches: Rows, windows: Rows) -> None:
    """Do the work of `ContactWatch.assess`."""
    watch = watches[0]
    mu, unknown_n, slip_until = watch["mu"], watch["force_n"], watch["slip_until_s"]
    for k in range(len(readings)):
        row = readings[k]
        contact, found = row["contact"], row["assessment"]
        normal, phase, t_s = contact["normal_n"], row["phase"], row["t_s"]
        found["level"], found["friction_step"], found["tipping_step"] = UNKNOWN, STABLE, STABLE
        found["utilisation_upper"], found["slips"], found["tipping_by_unknown_load"] = math.nan, False, False
        found["evidence"], found["drop_surprise"], found["required_friction"] = 0, 0.0, math.nan
        found["peak_required"], found["plateau_required"] = math.nan, math.nan
        if phase == UNTRUSTED:
            continue
        if phase != TOUCHING:
            _forget(watch)
            if phase == FREE and normal + unknown_n < watch["least_n"]:
                found["level"] = NO_CONTACT
            continue
        moves = t_s < watch["moving_until_s"]
        if moves:
            found["evidence"], found["slips"] = watch["moving_evidence"], True
        if math.isnan(mu):
            if moves:
                found["level"] = SLIPPING
            continue
        spin, translation = contact["spin_nm"], contact["friction_ratio"] / mu  # R / μ of paper eq. (4)
        exact = row["utilisation"]["kind"] != UNSOLVED and not math.isnan(spin)
        value = upper = translation
        if exact:
            value, upper = row["utilisation"]["value"], row["utilisation"]["upper"]
            upper = math.inf if math.isnan(upper) else upper  # an unknown bound is not a safe one
            if unknown_n > 0.0:  # the gauge of a sum is at most the sum of the gauges
                free = normal - unknown_n
                upper = (
                    (upper * normal + unknown_n / mu + watch["spin_utilisation_1n"]) / free if free > 0.0 else math.inf
                )
        step = _step_with_hysteresis(upper, watch["step"], watch["caution"], watch["warning"], watch["hysteresis"])
        watch["step"] = step
        for which in range(2):
            load = math.hypot(contact["fx_n"], contact["fy_n"]) if which == 0 else abs(spin)
            armed = value if which == 0 or translation < ROTATION_SHARE * value else math.nan
            if fell(windows[which], watch, which, t_s, load, load / normal, armed):
                slip_until[which] = t_s + watch["hold_s"]
        dropped = t_s < max(slip_until[0], slip_until[1])
        slips = dropped or moves
        if dropped:
            found["evidence"] |= LOAD_DROP_BIT
        found["friction_step"], found["slips"], found["utilisation_upper"] = step, slips, upper
        if exact:
            reach = math.hypot(contact["cx_m"], contact["cy_m"])
            std = math.hypot(watch["torque_std_nm"], reach * watch["force_std_n"]) / normal
            tipping, by_unknown = _tips(
                row["tipping_margin_m"],
                2.0 * std,
                watch["half_pitch_m"],
                (watch["torque_nm"] + reach * unknown_n) / max(normal - unknown_n, 1e-9),
            )
            found["tipping_step"], found["tipping_by_unknown_load"] = tipping, by_unknown
            found["level"] = SLIPPING if slips else max(step, tipping) + 1
        elif slips or step == WARNING:  # translation alone can prove a grip unsafe, never safe
            found["level"] = SLIPPING if slips else WARNING + 1


@compiled
def _forget(watch: Rows) -> None:
    """Forget a contact that ended."""
    watch["step"], watch["moving_until_s"] = STABLE, -math.inf
    first, count, slip_until = watch["first"], watch["count"], watch["slip_until_s"]
    for which in range(2):
        first[which], count[which], slip_until[which] = 0, 0, -math.inf


@compiled
def _step_with_hysteresis(used: float, step: int, caution: float, warning: float, hysteresis: float) -> int:
    """Return the step of a utilisation that follows one of ``step``; infinity exceeds every threshold."""
    reached = int(used >= caution) + int(used >= warning)
    while reached < step and used >= (caution if reached == 0 else warning) - hysteresis:
        reached += 1
    return reached


@compiled
def _tips(margin: float, noise: float, half_pitch: float, shift: float) -> tuple[int, bool]:
    """Return the step that the tipping margin asks for, and whether it does so only for the unknown load's shift.

    Taxels sense over a cell, so the outline is uncertain by half a pitch. Noise excuses a centroid outside it; an
    unknown load does not, because it may as well hide one.

    Source: paper Fig. 2c.
    """
    outside = -(margin + noise) / half_pitch
    step = int(outside > 0.0) + int(outside > 1.0)
    if step == STABLE and shift > 0.0 and margin < shift - half_pitch:
        return CAUTION, True
    return step, False
