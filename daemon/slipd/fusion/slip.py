"""The slip decision of one contact, reading by reading: how near the limit, over the edge, or slipping already.

Slip is told by the drop of R from the static to the dynamic friction coefficient (paper, after eq. (4)). R also falls
when the grip is tightened, and the load falls when an object is set down. A drop counts as slip only when the load
itself gives way, quickly, and came from near the friction limit.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slipd.fusion.compiled import compiled

Array = NDArray[np.float64]

#: Readings of the window that are kept at first; the ring grows when they come faster.
FIRST_CAPACITY = 64
#: The spin is most of the load where translation alone explains less than this share of the utilisation.
ROTATION_SHARE = 0.7
STABLE, CAUTION, WARNING = range(3)
#: Codes of a level: those of STABLE, CAUTION and WARNING lie one above them.
NO_CONTACT, SLIPPING, UNKNOWN = 0, 4, 5
#: Among the numbers that the kernel is told: what is kept of a load that slips; what changes from read to read.
KEPT, TOLD = 3, 9


@dataclass(frozen=True, slots=True)
class SlipSettings:
    """When a drop is a slip.

    Attributes:
        drop: Least relative fall of R and of the load, below the ratio of dynamic to static friction of most pairs.
        window_s: The fall happens within this time; setting an object down takes longer, s.
        armed_at: Least utilisation within the window: slip begins at 1, and the estimate of μ is a safe one.
        hold_s: A slip told stays told this long, s.
    """

    drop: float = 0.12
    window_s: float = 0.04
    armed_at: float = 0.7
    hold_s: float = 0.25


@dataclass(frozen=True, slots=True)
class Thresholds:
    """Utilisation at which a step is reached; it is left ``hysteresis`` below."""

    caution: float = 0.70
    warning: float = 0.85
    hysteresis: float = 0.05


class Doubt(NamedTuple):
    """How far a reading may be off: noise, and what an unknown load may add.

    Attributes:
        force_std_n: Standard deviation of each force component, N.
        torque_std_nm: Likewise of each torque component, N·m.
        force_n: Most that the unknown load adds, N.
        torque_nm: Likewise, N·m.
    """

    force_std_n: float = 0.0
    torque_std_nm: float = 0.0
    force_n: float = 0.0
    torque_nm: float = 0.0


class Found(NamedTuple):
    """What is found of one reading, as a row of numbers.

    Attributes:
        level: NO_CONTACT, STABLE + 1, CAUTION + 1, WARNING + 1, SLIPPING or UNKNOWN.
        step: What the utilisation asks for: STABLE, CAUTION or WARNING.
        slips: It slips, or did within ``hold_s``.
        tipping: What the tipping margin asks for.
        weighed: It asks for it only because of the unknown load.
        upper: Upper bound of the utilisation with what the unknown load may add.
    """

    level: float
    step: float
    slips: float
    tipping: float
    weighed: float
    upper: float


class ContactWatch:
    """Watches one contact; keeps what hysteresis and the windows of the slip need.

    Args:
        thresholds: Of the utilisation.
        slip: When a drop is a slip.
        half_pitch_m: Half the distance of the taxels: so far is the outline of an image uncertain. NaN without image.
        least_n: Normal force at which a contact begins, N.
    """

    def __init__(self, thresholds: Thresholds, slip: SlipSettings, half_pitch_m: float, least_n: float) -> None:
        fixed = (*astuple(thresholds), 1.0 - slip.drop, *astuple(slip)[1:], half_pitch_m, least_n)
        self._settings = np.array((*fixed, *[math.nan] * 6))  # and what `follow` is told beside the readings
        self._told: tuple[float, Doubt, float] | None = None
        self._most_kept = 0  # in a ring; no more than so many
        self._capacity = FIRST_CAPACITY
        self._rings = np.empty((2, FIRST_CAPACITY, 4))  # of force and of spin: time s, load, ratio, utilisation
        self._windows = np.zeros((2, 2), np.int64)  # of each ring: first reading, how many
        self._memory = np.zeros(3)  # step; until when a slip of force, of spin, is told
        self.reset()

    def reset(self) -> None:
        """Forgets everything: the contact ended."""
        self._windows[:] = 0
        self._memory[:] = STABLE, -math.inf, -math.inf

    def set_drop(self, drop: float) -> None:
        """Takes another least fall: the friction coefficients are known better now."""
        self._settings[KEPT] = 1.0 - drop

    def follow(
        self,
        contacts: Array,
        used: Array,
        margins_m: Array,
        mu: float,
        doubt: Doubt,
        turn: float,
    ) -> Array:
        """Takes the readings of one read.

        Args:
            contacts: As from `find_contacts`, shape (n, 15); the times rise.
            used: As from `follow_readings`, shape (n, 9); shape (0, 9) where no image tells of the rotation.
            margins_m: Tipping margin of each, shape (n,), m; shape (0,) where no image tells it.
            mu: Coefficient of static friction; NaN: not known.
            doubt: Of all of them.
            turn: λ that the doubt of the torque alone has at a normal force of 1 N.

        Returns:
            `Found` of each, shape (n, 6).
        """
        if self._told != (mu, doubt, turn):
            self._told = mu, doubt, turn
            self._settings[TOLD:] = (mu, *doubt, turn)
        count = len(contacts)
        self._most_kept += count
        while self._most_kept > self._capacity:
            self._most_kept = int(self._windows[:, 1].max()) + count
            if self._most_kept > self._capacity:
                self._grow()
        out = np.zeros((count, 6))
        _follow(out, self._memory, self._rings, self._windows, contacts, used, margins_m, self._settings)
        return out

    def _grow(self) -> None:
        """Doubles the rings, each begun anew at its first place."""
        size = self._rings.shape[1]
        grown = np.empty((2, 2 * size, 4))
        for ring in range(2):
            grown[ring, :size] = np.roll(self._rings[ring], -self._windows[ring, 0], axis=0)
        self._rings, self._capacity, self._windows[:, 0] = grown, 2 * size, 0


@compiled
def _follow(
    out: Array, memory: Array, rings: Array, windows: NDArray[np.int64], contacts: Array, used: Array, margins: Array,
    settings: Array,
) -> None:  # fmt: skip
    """The work of `ContactWatch.follow`."""
    (caution, warning, hysteresis, kept, window_s, armed_at, hold_s, half_pitch, least, mu, force_std, torque_std,
     doubt_n, doubt_nm, turn) = (
        settings[0], settings[1], settings[2], settings[3], settings[4], settings[5], settings[6], settings[7],
        settings[8], settings[9], settings[10], settings[11], settings[12], settings[13], settings[14],
    )  # fmt: skip
    for k in range(len(contacts)):
        normal, touch, t_s = contacts[k, 4], contacts[k, 10], contacts[k, 14]
        out[k, 0], out[k, 5] = UNKNOWN, math.nan
        if touch == 0:  # UNTRUSTED
            continue
        if touch != 2:  # not TOUCHING
            windows[:] = 0
            memory[0], memory[1], memory[2] = STABLE, -math.inf, -math.inf
            if touch == 1 and normal + doubt_n < least:
                out[k, 0] = NO_CONTACT
            continue
        if math.isnan(mu):
            continue
        spin, translation = contacts[k, 7], contacts[k, 8] / mu
        exact = len(used) > 0 and not math.isnan(spin)
        value = used[k, 1] if exact else translation
        upper = translation
        if exact:
            upper = math.inf if math.isnan(used[k, 3]) else used[k, 3]  # no number is no safety
            if doubt_n > 0.0:  # the gauge grows by no more than its parts
                free = normal - doubt_n
                upper = (upper * normal + doubt_n / mu + turn) / free if free > 0.0 else math.inf
        step = _gate(upper, int(memory[0]), caution, warning, hysteresis)
        memory[0] = step
        for ring in range(2):
            load = math.hypot(contacts[k, 5], contacts[k, 6]) if ring == 0 else abs(spin)
            armed = value if ring == 0 or translation < ROTATION_SHARE * value else math.nan
            fell = _fell(
                rings[ring], windows[ring], t_s, window_s, load, load / normal, armed, kept, armed_at
            )  # fmt: skip
            if fell:
                memory[1 + ring] = t_s + hold_s
        slips = t_s < max(memory[1], memory[2])
        out[k, 1], out[k, 2], out[k, 5] = step, slips, upper
        if exact:
            reach = math.hypot(contacts[k, 0], contacts[k, 1])
            std = math.hypot(torque_std, reach * force_std) / normal
            tipping, weighed = _tips(
                margins[k], 2.0 * std, half_pitch, (doubt_nm + reach * doubt_n) / max(normal - doubt_n, 1e-9)
            )
            out[k, 3], out[k, 4] = tipping, weighed
            out[k, 0] = SLIPPING if slips else max(step, tipping) + 1
        elif slips or step == WARNING:  # translation alone can only prove a grip unsafe, never safe
            out[k, 0] = SLIPPING if slips else WARNING + 1


@compiled
def _gate(used: float, step: int, caution: float, warning: float, hysteresis: float) -> int:
    """Step of a utilisation that follows one of ``step``; infinity counts as over every threshold."""
    reached = int(used >= caution) + int(used >= warning)
    while reached < step and used >= (caution if reached == 0 else warning) - hysteresis:
        reached += 1
    return reached


@compiled
def _tips(margin: float, noise: float, half_pitch: float, shift: float) -> tuple[int, bool]:
    """Step that the tipping margin asks for, and whether only the shift by an unknown load does.

    Taxels sense over a cell, so the outline is uncertain by half a pitch. Noise excuses a centroid that lies outside;
    an unknown load does not, for it may as well hide one.
    """
    outside = -(margin + noise) / half_pitch
    step = int(outside > 0.0) + int(outside > 1.0)
    if step == STABLE and shift > 0.0 and margin < shift - half_pitch:
        return CAUTION, True
    return step, False


@compiled
def _fell(
    ring: Array, window: NDArray[np.int64], t_s: float, window_s: float, load: float, ratio: float, used: float,
    kept: float, armed_at: float,
) -> bool:  # fmt: skip
    """Drops what is older than the window, looks for a fall, and adds the reading; a fall forgets all before."""
    size = len(ring)
    while window[1] > 0 and ring[window[0], 0] < t_s - window_s:
        window[0] = (window[0] + 1) % size
        window[1] -= 1
    fell = False
    at = window[0]
    for _k in range(window[1]):
        if ring[at, 3] >= armed_at and load <= kept * ring[at, 1] and ratio <= kept * ring[at, 2]:
            fell = True
            break
        at += 1
        if at == size:
            at = 0
    end = (window[0] + window[1]) % size
    ring[end, 0], ring[end, 1], ring[end, 2], ring[end, 3] = t_s, load, ratio, used
    if fell:
        window[0], window[1] = end, 0
    window[1] += 1
    return fell
