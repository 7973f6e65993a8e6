"""Evidence "vibration": the high band of a force sensor is loud in the plane of the pad, as of a surface that slides.

Blocks of readings are whitened by linear prediction (a motor or a resonance predicts itself; friction does not), and
their unpredictable power is compared with that of the same grasp so far. A rise counts only as far as it exceeds that
of the normal force: an arm that shakes or collides shakes both.
"""

from __future__ import annotations

import math

import numpy as np

from slipd.fusion.compiled import compiled
from slipd.motion.evidence import Evidence, f_surprise
from slipd.types.arrays import Array

LEAST_HZ = 500.0
"""A slower sensor does not see the band of friction, 100 to 250 Hz."""
BLOCK = 32
"""Readings of a block; 32 ms at 1 kHz."""
ORDER = 4
"""Order of the prediction: two narrow bands are predicted."""
SETTLED_NS = 300_000_000
"""A contact this young still settles: its onset is loud."""
BACKGROUND_BLOCKS, LEAST_BLOCKS = 64, 8
"""Blocks over which the background is averaged, and with which it is known."""
WHITENED = 0.8
"""Share of the degrees of freedom of white noise that the power of predicted noise has."""
FREEDOM = WHITENED * (BLOCK - 2 - ORDER - 1)
"""Degrees of freedom of the power of a block in one direction."""
BURST_SHARE = 0.25
"""Share of a block's power in one reading beyond which it is a knock, not a noise that lasts."""

LOUD = 3.0
"""A block of less surprise is background, and no evidence."""
MOST_SUPPORT = 6.0
"""Largest surprise that is reported: less than any rule asks of one kind alone."""


class Vibration:
    """Finds the noise of sliding in the readings of a force sensor of at least ``LEAST_HZ``.

    False alarms: with noise of the sensor of any spectrum that lasts, and vibration that reaches the normal force as
    much as the tangential one, a surprise above s comes in less than exp(−s) of the looks. What shakes the finger in
    its plane alone is not told from sliding, so this evidence only supports others: it ends at ``MOST_SUPPORT``.

    Args:
        rate_hz: Rate of the readings.
    """

    def __init__(self, rate_hz: float) -> None:
        self.looks_per_hour = 3600.0 * rate_hz / BLOCK
        self._out = np.zeros(4)
        self.reset()

    def reset(self) -> None:
        """Forget everything: the contact ended."""
        self._since_ns: int | None = None
        self._blocks = 0
        self._background = np.zeros(3)

    def update(self, t_ns: int, wrenches: Array) -> Evidence | None:
        """Update with some readings of a contact.

        Args:
            t_ns: When the last was acquired, CLOCK_MONOTONIC.
            wrenches: Force, N, and torque, N·m, in the pad frame, shape (n, 6); the last ``BLOCK`` are a block.

        Raises:
            ValueError: There are fewer.
        """
        if len(wrenches) < BLOCK:
            raise ValueError(f"a block must have {BLOCK} readings, got {len(wrenches)}")
        if self._since_ns is None:
            self._since_ns = t_ns
        block = wrenches[-BLOCK:, :3]
        if t_ns - self._since_ns < SETTLED_NS:
            return None
        return self._look(t_ns, np.ascontiguousarray(block))

    def _look(self, t_ns: int, block: Array) -> Evidence | None:
        """Compare the power of a block with the background, and add it to that."""
        _powers(block, self._out)
        power, burst = self._out[:3], float(self._out[3])
        known, background = self._blocks, self._background
        surprise = 0.0
        if known >= LEAST_BLOCKS and background.all() and np.isfinite(power).all() and burst < BURST_SHARE:
            freedom = 0.5 * FREEDOM * known
            rises = power / background
            rise, normal = 0.5 * float(rises[0] + rises[1]), max(float(rises[2]), 1.0)
            surprise = min(
                f_surprise(rise, 2.0 * FREEDOM, freedom),
                f_surprise(rise / normal, 2.0 * FREEDOM, FREEDOM),
                f_surprise(min(float(rises[0]), float(rises[1])), FREEDOM, freedom) + math.log(2.0),
            )
        if surprise < LOUD:  # what is loud is not background
            share = 1.0 / min(known + 1, BACKGROUND_BLOCKS)
            self._background = background + share * (power - background)
            self._blocks = min(known + 1, BACKGROUND_BLOCKS)
        return Evidence("vibration", t_ns, min(surprise, MOST_SUPPORT)) if surprise >= LOUD else None


@compiled
def _powers(block: Array, out: Array) -> None:
    """Find the unpredictable power of three signals in the high band.

    Args:
        block: Readings, shape (n, 3).
        out: Filled with the power of each, and the largest share of one reading in the square of the tangential two.
    """
    count = len(block) - 2
    burst, squares = 0.0, np.zeros(count)
    for which in range(3):
        x = np.empty(count)
        for k in range(count):  # second differences: no force that a grip or a load makes is as fast
            x[k] = block[k + 2, which] - 2.0 * block[k + 1, which] + block[k, which]
            if which < 2:
                squares[k] += x[k] * x[k]
        out[which] = _unpredictable(x)
    total = squares.sum()
    for k in range(count):
        burst = max(burst, squares[k])
    out[3] = burst / total if total > 0.0 else 1.0


@compiled
def _unpredictable(x: Array) -> float:
    """Return the mean square of what linear prediction leaves of a signal.

    Source: J. P. Burg, Maximum entropy spectral analysis, 1967 (the recursion on forward and backward errors).
    """
    count = len(x)
    forward, backward = x.copy(), x.copy()
    power = 0.0
    for k in range(count):
        power += x[k] * x[k]
    power /= count
    for order in range(ORDER):
        above, below = 0.0, 0.0
        for k in range(order + 1, count):
            above += forward[k] * backward[k - 1]
            below += forward[k] * forward[k] + backward[k - 1] * backward[k - 1]
        reflection = 2.0 * above / below if below > 0.0 else 0.0
        for k in range(count - 1, order, -1):
            ahead = forward[k]
            forward[k] = ahead - reflection * backward[k - 1]
            backward[k] = backward[k - 1] - reflection * ahead
        power *= 1.0 - reflection * reflection
    return power
