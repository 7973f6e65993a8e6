"""Level of one contact, reading by reading: utilisation against thresholds with hysteresis, tipping, and slip.

A level rises at once where noise allows, that of a growing load a little earlier, and falls only when the load stayed
lower for a while by more than its noise, so that a vibration changes it once. `slipd.fusion.load_drop` has what the
load shows of motion, `slipd.fusion.level_steps` how a level follows the load, `slipd.fusion.assess` both together.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from slipd.fusion.assess import assess_readings
from slipd.fusion.load_blocks import BLOCK_S, RING
from slipd.fusion.load_drop import LOOKS
from slipd.fusion.rows import BLOCK, DROP, STABLE, WATCH, Rows, new_rows


@dataclass(frozen=True, slots=True)
class SlipSettings:
    """When a fall of the load counts as a slip, see `slipd.fusion.load_drop`.

    Attributes:
        drop: Least relative fall; noise may ask for more.
        window_s: Longest fall; setting an object down takes longer, s.
        hold_s: Longest time for which a slip is reported without new evidence, s.
        false_alarms_per_hour: How often noise alone may look like a fall, 1/h.
    """

    drop: float = 0.03
    window_s: float = 0.04
    hold_s: float = 3.0
    false_alarms_per_hour: float = 1.0


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
        slips: It slips.
        tipping_by_unknown_load: The tipping margin asks for its step only because of the unknown load.
        evidence: What shows that it slips: bits of `slipd.motion.evidence.EVIDENCE`; 0 where it does not slip.
        required_friction: q, the coefficient of friction at which the load would just slip; NaN where unknown.
        peak_required: While the load shows that it slides: q just before the fall; NaN after a jump, and else.
        plateau_required: While the load shows that it slides: q on the plateau; NaN else.
        drop_surprise: While the load shows that it slides: −ln of the probability of such a fall by noise; else 0.
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
    """Assesses the readings of one contact; keeps what hysteresis, dwell and the detection of slip need.

    Args:
        thresholds: Of the utilisation.
        slip: When a fall of the load counts as a slip.
        half_pitch_m: Half the distance between taxels, the uncertainty of an image's outline, m; NaN without image.
        least_n: Normal force at which a contact begins, N.
    """

    def __init__(self, thresholds: Thresholds, slip: SlipSettings, half_pitch_m: float, least_n: float) -> None:
        self._watch, self._drop, self._ring = new_rows(WATCH, 1), new_rows(DROP, 1), new_rows(BLOCK, RING)
        for name in ("caution", "warning", "hysteresis"):
            self._watch[name] = getattr(thresholds, name)
        for name in ("window_s", "hold_s"):
            self._drop[name] = getattr(slip, name)
        self._drop["least_surprise"] = math.log(LOOKS * 3600.0 / BLOCK_S / slip.false_alarms_per_hour)
        self._watch["half_pitch_m"], self._watch["least_n"] = half_pitch_m, least_n
        self._in_force: tuple[float, Uncertainty, float] | None = None  # friction and uncertainty in the row
        self.set_drop(slip.drop)
        self.reset()

    def reset(self) -> None:
        """Forget everything: the contact ended."""
        self._watch["step"], self._watch["tipping_step"], self._watch["moving_until_s"] = STABLE, STABLE, -math.inf
        self._watch["settled"] = 0.0
        self.forget_load()

    def forget_load(self) -> None:
        """Forget the course of the load: what was before the next reading shows no fall."""
        self._drop["last_s"], self._drop["sliding"] = -math.inf, False

    def set_drop(self, drop: float) -> None:
        """Set another least relative fall: the friction coefficients are known better now."""
        self._drop["least_drop"] = drop

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
            if self._in_force is None or mu != self._in_force[0] or uncertainty.force_n < self._in_force[1].force_n:
                self._watch["held_s"], self._watch["tipping_held_s"] = -math.inf, -math.inf  # not by the load
            self._in_force = mu, uncertainty, spin_utilisation_1n
            self._watch["mu"], self._watch["spin_utilisation_1n"] = mu, spin_utilisation_1n
            for name, value in zip(Uncertainty._fields, uncertainty, strict=True):
                self._watch[name] = value
        assess_readings(readings, self._watch, self._drop, self._ring)
