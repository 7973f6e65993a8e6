"""What the level of one contact depends on: its settings, the uncertainty of the readings, and what kernels remember.

A level rises at once where noise allows, that of a growing load a little earlier, and falls only when the load stayed
lower for a while by more than its noise, so that a vibration changes it once. The kernels that find it are in
`slipd.fusion.load_drop` (what the load shows of motion), `slipd.fusion.level_hysteresis` (how a level follows the load)
and `slipd.fusion.assess` (both together).
"""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

import numpy as np

from slipd.fusion.load_blocks import BLOCK_S, RING
from slipd.fusion.load_drop import LOOKS
from slipd.fusion.rows import BLOCK, CONDITIONS, DROP, FORCES, MEMORY, STABLE, new_rows

CONTACT_HYSTERESIS = 0.8
"""A contact lasts down to this share of the normal force at which it begins."""

CONTACT_STATE = np.dtype(
    [("conditions", CONDITIONS), ("memory", MEMORY), ("drop", DROP), ("ring", BLOCK, (RING,)), ("forces", FORCES)],
    align=True,
)
"""All that the kernels know of one contact: what is in force for its readings, and what they keep from read to read."""


class SlipSettings(Protocol):
    """When a fall of the load counts as a slip, see `slipd.fusion.load_drop`: ``[finger.X.slip]``.

    Attributes:
        drop: Least relative fall; noise may ask for more.
        window_s: Longest fall; setting an object down takes longer, s.
        hold_s: Longest time for which a slip is reported without new evidence, s.
    """

    drop: float
    window_s: float
    hold_s: float


class LevelSettings(Protocol):
    """When levels change: ``[levels]``.

    Attributes:
        caution: Utilisation at which CAUTION begins.
        warning: Likewise WARNING.
        hysteresis: Each ends so far below.
        false_alarms_per_hour: How often noise alone may look like a fall, 1/h.
    """

    caution: float
    warning: float
    hysteresis: float
    false_alarms_per_hour: float


class WrenchUncertainty(NamedTuple):
    """How far a reading may be off: noise, and what an unknown load may add.

    Attributes:
        force_std_n: Standard deviation of each force component, N.
        torque_std_nm: Standard deviation of each torque component, N·m.
        unknown_n: Most that the unknown load adds to the force, N.
        unknown_nm: Most that it adds to the torque, N·m.
    """

    force_std_n: float = 0.0
    torque_std_nm: float = 0.0
    unknown_n: float = 0.0
    unknown_nm: float = 0.0


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


class ContactState:
    """What the kernels know of one contact: the conditions in force, and what they keep from read to read.

    Args:
        levels: Thresholds of the utilisation.
        slip: When a fall of the load counts as a slip.
        half_pitch_m: Half the distance between taxels, the uncertainty of an image's outline, m; NaN without image.
        begins_n: Normal force at which a contact begins, N.

    Attributes:
        row: One row of CONTACT_STATE, shape (1,).
    """

    def __init__(self, levels: LevelSettings, slip: SlipSettings, half_pitch_m: float, begins_n: float) -> None:
        self.row = new_rows(CONTACT_STATE, 1)
        conditions, drop, forces = self.row["conditions"], self.row["drop"], self.row["forces"]
        for name in ("caution", "warning", "hysteresis"):
            conditions[name] = getattr(levels, name)
        conditions["matrix"], conditions["zero_known"], conditions["spin_scale"] = np.eye(6), True, 1.0
        conditions["pulled_n"], conditions["mu"], conditions["half_pitch_m"] = math.inf, math.nan, half_pitch_m
        conditions["gravity_s"] = -math.inf
        conditions["begins_n"], conditions["lasts_n"] = begins_n, CONTACT_HYSTERESIS * begins_n
        drop["least_drop"], drop["window_s"], drop["hold_s"] = slip.drop, slip.window_s, slip.hold_s
        forces["low_n"], forces["high_n"] = math.inf, -math.inf
        drop["least_surprise"] = math.log(LOOKS * 3600.0 / BLOCK_S / levels.false_alarms_per_hour)
        self.row["memory"]["pulled_s"] = -math.inf
        self._forget_steps()
        self.reset()

    def reset(self) -> None:
        """Forget everything: the contact ended."""
        memory = self.row["memory"]
        memory["in_contact"], memory["twist"], memory["settled"] = False, math.nan, 0.0
        memory["step"], memory["tipping_step"], memory["moving_until_s"] = STABLE, STABLE, -math.inf
        self.forget_load()

    def forget_load(self) -> None:
        """Forget the course of the load: what was before the next reading shows no fall."""
        drop = self.row["drop"]
        drop["last_s"], drop["sliding"] = -math.inf, False

    def note_motion(self, until_s: float, evidence: int) -> None:
        """Report slip until a time, because other evidence than the load shows motion.

        Args:
            until_s: Time of the readings until which the object is taken to move, s.
            evidence: Its kinds: bits of `slipd.motion.evidence.EVIDENCE`.
        """
        memory = self.row["memory"]
        memory["moving_until_s"], memory["moving_evidence"] = until_s, evidence

    def set_friction(self, mu: float, spin_scale: float = 1.0) -> None:
        """Put a coefficient of static friction in force, NaN if unknown; and how much more of it a spin uses."""
        conditions = self.row["conditions"]
        if mu != conditions["mu"][0]:
            self._forget_steps()
        conditions["mu"], conditions["spin_scale"] = mu, spin_scale

    def set_uncertainty(self, uncertainty: WrenchUncertainty) -> None:
        """Put the uncertainty of the readings in force."""
        conditions = self.row["conditions"]
        if uncertainty.unknown_n < conditions["unknown_n"][0]:
            self._forget_steps()
        for name, value in zip(WrenchUncertainty._fields, uncertainty, strict=True):
            conditions[name] = value

    def _forget_steps(self) -> None:
        """Let each step end at once: it was reached by another friction or uncertainty, not by the load."""
        memory = self.row["memory"]
        memory["held_s"], memory["tipping_held_s"] = -math.inf, -math.inf
