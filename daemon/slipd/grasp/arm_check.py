"""Find faults of an arm stream that the load on the fingers shows: sign, frame and timing.

Whatever the fingers carry, an object or only themselves, follows the apparent gravity γ as F = m γ + constant with
m > 0. Over the last second of motion, and the last half of it, that is compared with F = m R γ, where R turns, swaps or
reverses axes, and with F = m γ at other times. A stream is at fault where it explains the load badly, and one of these
explains it well. A load that none explains changes for another reason, such as a grip or a touch, and says nothing of
the stream.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations, product

import numpy as np

from slipd.types.arrays import Array

SPANS = (25, 50)
"""The last so many readings are compared, 0.5 s and 1 s: the shorter span holds less that has another cause."""
EVERY = 5
"""At every so many readings."""
SHIFTS_NS = tuple(ms * 1_000_000 for ms in (0, -100, -75, -50, -25, 25, 50, 75, 100))
"""Times from the load to the reading of the arm that may belong to it."""
LEAST_SHIFT_NS = 50_000_000
"""A smaller one is the lag of a controller or a filter."""
LEAST_MOTION_MPS2 = 0.7
"""Smallest deviation of the apparent gravity, root mean square, that shows anything."""
NOISES = 6.0
"""The load deviates by at least so many times its noise."""
LASTING = 10.0
"""The deviation lasts for at least so many readings; a collision is shorter."""
GOOD, BAD_FRAME, BAD_TIME = 0.9, 0.5, 0.95
"""Parts of the load's variance: at least GOOD is explained by what fits, at most BAD_FRAME or BAD_TIME by a stream at
fault."""
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
"""The first is what the stream says, the second its reverse."""
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
        self._noise_n = noise_n
        self.forget()

    def forget(self) -> None:
        """Forget the load, because it changes for another reason; a fault stays."""
        self._loads: list[Array] = []
        self._gravities: list[Array] = []
        self._count = 0

    def update(self, load_n: Array, gravities_mps2: Sequence[Array]) -> None:
        """Compare one more reading.

        Args:
            load_n: Force on the fingers with what they carry, shape (3,), N.
            gravities_mps2: Apparent gravity at each of `SHIFTS_NS` from its time.
        """
        self._loads.append(load_n)
        self._gravities.append(np.array(gravities_mps2))
        del self._loads[: -SPANS[-1]], self._gravities[: -SPANS[-1]]
        self._count += 1
        if self._count % EVERY == 0:
            for span in SPANS:
                if len(self._loads) >= span and (fault := self._compare(span)) is not None:
                    self.fault = fault
                    return

    def _compare(self, span: int) -> str | None:
        """Return the fault that the last readings show, "" where the stream fits; None where they show neither."""
        load, gravity = np.array(self._loads[-span:]), np.array(self._gravities[-span:])
        load = load - load.mean(axis=0)
        gravity = gravity - gravity.mean(axis=0)
        power = (load**2).sum(axis=1)
        whole, motion = float(power.sum()), (gravity**2).sum(axis=(0, 2))
        if motion[0] < span * LEAST_MOTION_MPS2**2 or whole < span * (NOISES * self._noise_n) ** 2:
            return None
        if whole**2 < LASTING * float((power**2).sum()):
            return None
        by_frame = _explained(np.einsum("fij,nj,ni->f", _STACK, gravity[:, 0], load), motion[0], whole)
        by_time = _explained(np.einsum("nki,ni->k", gravity, load), motion, whole)
        return _judge(by_frame, by_time)


def _judge(by_frame: Array, by_time: Array) -> str | None:
    """Return the fault that fits, "" where the stream fits as it is, None where neither does."""
    as_is, frame, shift = float(by_frame[0]), int(np.argmax(by_frame > by_frame.max() - TIE)), int(by_time.argmax())
    left = (1.0 - as_is) / BETTER
    if as_is < BAD_FRAME and by_frame[frame] >= GOOD and 1.0 - by_frame[frame] < left:
        return _frame_fault(frame)
    late_ns = SHIFTS_NS[shift]
    better = by_time[shift] >= GOOD and 1.0 - by_time[shift] < left and abs(late_ns) >= LEAST_SHIFT_NS
    if as_is < BAD_TIME and better:
        return f"its times are about {abs(late_ns) / 1e6:.0f} ms {'late' if late_ns > 0 else 'early'}"
    return "" if as_is >= GOOD else None


def _explained(common: Array, motion: Array | float, whole: float) -> Array:
    """Return the part of the variance that each explains with a positive mass."""
    part: Array = np.maximum(common, 0.0) ** 2 / (np.maximum(motion, 1e-12) * whole)
    return part


def _frame_fault(frame: int) -> str:
    if frame == 1:
        return "its sign is wrong: gravity_mps2 must point down at rest"
    axes = []
    for row, axis in zip(FRAMES[frame], "xyz", strict=True):
        k = int(np.abs(row).argmax())
        axes.append(f"{axis} of the gripper is {'-' if row[k] < 0.0 else ''}{'xyz'[k]} of the stream")
    return f"its frame is wrong: {', '.join(axes)}"
