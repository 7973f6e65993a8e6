"""The zero of one pad: its offset, whether it is right, and what follows from a new one.

Raw counts may have any offset. A pad in front of a force sensor that reads nothing while that sensor measures no
contact has a right zero; one that reads a load then has a wrong one.
"""

from __future__ import annotations

import numpy as np

from slipd.config import Pad
from slipd.signals.charge_reconstruction import ChargeReconstruction
from slipd.signals.tare import Offset, Tare
from slipd.types.arrays import Array

HELD_NS = 200_000_000
"""Time for which a free pad must read the same: it may show a touch before the force sensor measures it, ns."""
MANY_THRESHOLDS = 10.0
"""A free pad with a right zero reads less than this multiple of the threshold on half of its taxels, drift included."""
NOISE_STDS = 6.0
"""A reading within this many standard deviations of its tare shows no contact, whatever the threshold."""


class PadZero:
    """Offset of the readings of one pad, and how it is known.

    Args:
        pad: ``[finger.X.pad]``.
        shape: Shape of an image: (n,) of n taxels, or (n, 3) of three-axis ones.
        scale: Force on a taxel per count, a number or by axis.
        charge: Reconstruction of the charge, which finds the zero each time the pad is free; None for other pads.

    Attributes:
        tare: Offset of the readings, in counts.
        tared: The offset is right: by the config, by a tare, or as the pad was seen to be free.
        known: The offset is right, or the pad finds its zero each time it is free, as charge pads do.
        noise: Normal force on each taxel that the tare saw as noise, shape (n,); 0 where it is not known, as of an
            offset of the config, or of a charge pad, whose noise adds up.
    """

    def __init__(self, pad: Pad, shape: tuple[int, ...], scale: Array, charge: ChargeReconstruction | None) -> None:
        self.tare = Tare(np.reshape(pad.tare, shape) if pad.tare else np.zeros(shape))
        self._scale, self._charge, self._threshold = scale, charge, pad.threshold
        self._stated = bool(pad.tare)
        self._reads, self._since_ns = "", 0
        self.tare.on_change.append(self._follow_tare)
        self._follow_tare(self.tare.current, self.tare.current)

    def judge(self, readings: Array, t_ns: int, *, free: bool) -> None:
        """Confirm a zero that is not known, or reject a stored one, by an image of a pad that may be free.

        Args:
            readings: Normal force on each taxel, shape (n,).
            t_ns: When the image was acquired, CLOCK_MONOTONIC.
            free: The force sensor, whose zero is known, measures no contact.
        """
        reads = self._kind(readings) if free else ""
        if reads != self._reads:
            self._reads, self._since_ns = reads, t_ns
        if t_ns - self._since_ns <= HELD_NS:
            return
        if reads == "load":
            self.tare.reject("the pad reads a load while the force sensor measures none")
        elif reads == "nothing" and not self.known:
            self.tare.observe(t_ns)

    def _kind(self, readings: Array) -> str:
        """Return what a free pad reads: "nothing", "load", or "" where it is neither."""
        size = np.abs(readings)
        if (size <= self._threshold).all():
            return "nothing"
        many = 2 * int(np.count_nonzero(size > MANY_THRESHOLDS * self._threshold)) > size.size
        return "load" if many and self._threshold > 0.0 else ""

    @property
    def origin(self) -> str | None:
        """Where the zero comes from: "config", "measured", "stored" or "observed"; None: it is not known."""
        if self._charge is not None and not self.tare.known:
            return "observed"
        return self.tare.current.origin if self.known else None

    def _follow_tare(self, now: Offset, before: Offset) -> None:
        """Follow a change of the tare; the charge that was found with another offset is shifted."""
        self.tared = self._stated or self.tare.known
        self.known = self.tared or self._charge is not None
        self.noise: Array | float = 0.0 if now.std is None or self._charge is not None else self._noise_of(now.std)
        if self._charge is not None and now is not before:
            self._charge.shift(self._scale * (now.value - before.value))

    def _noise_of(self, std: Array) -> Array:
        scaled = NOISE_STDS * np.abs(self._scale * std)
        return scaled[:, 2] if scaled.ndim == 2 else scaled
