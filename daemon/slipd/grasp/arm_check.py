"""Find faults of an arm stream that the load on the fingers shows: sign, frame and timing.

Whatever the fingers carry, an object or only themselves, follows the apparent gravity γ as F = m γ + constant with
m > 0. Over several spans of time, that is compared with F = m R γ, where R turns, swaps or reverses axes, and with
F = m γ at other times. A stream is at fault where it explains the load badly, and the same one of these explains it
well in two spans: a touch that changes the load as the motion would may fit one of them by chance, but hardly twice. A
load that none explains changes for another reason, such as a grip or a touch, and shows nothing of the stream.
"""

from __future__ import annotations

from itertools import permutations, product

import numpy as np

from slipd.types.arrays import Array

SPANS, LEAST_TIMED = (15, 25, 50), 25
"""The last so many readings are compared, 0.3 s to 1 s: a short span holds less that has another cause, a long one
enough of a gentle motion. Times are compared over LEAST_TIMED or more: a move that brakes looks like a later one that
begins."""
EVERY = 2
"""At every so many readings."""
AGAIN, RECENT = 15, 100
"""What fits in a span must fit again so many readings later at least (0.3 s) and at most (2 s)."""
SHIFTS_NS = tuple(ms * 1_000_000 for ms in (0, -100, -75, -50, -25, 25, 50, 75, 100))
"""Times from the load to the reading of the arm that may belong to it."""
LEAST_SHIFT_NS = 50_000_000
"""A smaller one is the lag of a controller or a filter."""
LEAST_MOTION_MPS2 = 0.35
"""Smallest deviation of the apparent gravity, root mean square, that shows anything."""
LEAST_GAIN = 30.0
"""What fits explains more of the load than the stream by at least so many variances of its noise, summed over the
span."""
LASTING = 0.2
"""The deviation lasts for at least this part of the span; a collision is shorter."""
GOOD, BAD = 0.95, 0.98
"""Parts of the load's variance without noise: at least GOOD is explained by what fits, at most BAD by a stream at
fault, which is off by 8° or more."""
TIE = 0.02
"""Of frames that explain as much within this part, the first of `FRAMES` is named."""
BETTER = 4.0
"""What fits leaves so many times less unexplained than the stream as it is."""

IDENTITY = np.eye(3)


def _frames() -> list[Array]:
    """Return all ways to exchange and reverse axes, the identity first, then its negative, then rotations."""
    found = []
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        found.append(np.array(signs)[:, None] * IDENTITY[list(order)])
    return sorted(found, key=lambda r: (not (r == IDENTITY).all(), not (r == -IDENTITY).all(), np.linalg.det(r) < 0.0))


FRAMES = _frames()
"""The first is that of the stream, the second its reverse."""
_STACK = np.array(FRAMES)


class ArmCheck:
    """Compares the load with the arm stream.

    Args:
        noise_n: Deviation of the noise of each component of the load.

    Attributes:
        fault: What is wrong with the stream, for people; "" where nothing is known to be.
    """

    def __init__(self, noise_n: float) -> None:
        self.fault = ""
        self._variance = noise_n**2
        self._believed, self._count = 0, 0
        self._seen: dict[int, int] = {}  # what fitted better than what is believed: at which count first
        self._loads, self._gravities = np.zeros((SPANS[-1], 3)), np.zeros((SPANS[-1], len(SHIFTS_NS), 3))

    def update(self, load_n: Array, gravities_mps2: Array) -> None:
        """Compare one more reading.

        Args:
            load_n: Force on the fingers with what they carry, shape (3,), N.
            gravities_mps2: Apparent gravity at each of `SHIFTS_NS` from its time, shape (9, 3).
        """
        for kept, newest in ((self._loads, load_n), (self._gravities, gravities_mps2)):
            kept[:-1] = kept[1:]
            kept[-1] = newest
        self._count += 1
        if self._count % EVERY != 0:
            return
        for span in SPANS:
            better = self._compare(span) if self._count >= span else None
            if better is not None and self._is_seen_again(better):
                self._believed, self.fault = better, _fault_of(better)
                self._seen.clear()
                return

    def _is_seen_again(self, better: int) -> bool:
        self._seen = {index: first for index, first in self._seen.items() if self._count - first <= RECENT}
        return self._count - self._seen.setdefault(better, self._count) >= AGAIN

    def _compare(self, span: int) -> int | None:
        """Return what explains the last readings much better than what is believed of the stream; None: nothing.

        It is an index of `FRAMES`, or of `SHIFTS_NS` behind these.
        """
        load = self._loads[-span:] - self._loads[-span:].mean(axis=0)
        power = np.einsum("ni,ni->n", load, load)
        whole = float(power.sum())
        signal = whole / self._variance - 3.0 * (span - 1)
        if signal < LEAST_GAIN or whole**2 < LASTING * span * float(power @ power):
            return None
        gravity = self._gravities[-span:]
        motion = span * gravity.var(axis=0).sum(axis=1)
        if motion[0] < span * LEAST_MOTION_MPS2**2:
            return None
        by_frame = self._explained(np.einsum("fij,ij->f", _STACK, load.T @ gravity[:, 0]), motion[0]) / signal
        by_time = self._explained(np.einsum("nki,ni->k", gravity, load), motion) / signal
        believed = float(np.concatenate((by_frame, by_time))[self._believed])
        least = max(GOOD, believed + LEAST_GAIN / signal, 1.0 - (1.0 - believed) / BETTER)
        if believed > BAD:
            return None
        frame, shift = int(np.argmax(by_frame > by_frame.max() - TIE)), int(by_time.argmax())
        if by_frame[frame] > least:
            return frame
        timed = span >= LEAST_TIMED and abs(SHIFTS_NS[shift]) >= LEAST_SHIFT_NS
        return len(FRAMES) + shift if timed and by_time[shift] > least else None

    def _explained(self, common: Array, motion: Array) -> Array:
        """Return the variances of noise that each explains with a positive mass, without those that noise would."""
        found: Array = np.maximum(common, 0.0) ** 2 / (np.maximum(motion, 1e-12) * self._variance) - 1.0
        return found


def _fault_of(index: int) -> str:
    """Return the fault for people; "" for a stream that fits as it is."""
    if index == 0:
        return ""
    if index == 1:
        return "its sign is wrong: gravity_mps2 must point down at rest"
    if index >= len(FRAMES):
        late_ns = SHIFTS_NS[index - len(FRAMES)]
        return f"its times are about {abs(late_ns) / 1e6:.0f} ms {'late' if late_ns > 0 else 'early'}"
    axes = []
    for row, axis in zip(FRAMES[index], "xyz", strict=True):
        k = int(np.abs(row).argmax())
        axes.append(f"{axis} of the gripper is {'-' if row[k] < 0.0 else ''}{'xyz'[k]} of the stream")
    return f"its frame is wrong: {', '.join(axes)}"
