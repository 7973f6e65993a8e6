"""The zero of one pad: its offset, whether it is right, and what follows from a new one."""

from __future__ import annotations

import numpy as np

from slipd.config import Pad
from slipd.signals.charge_reconstruction import ChargeReconstruction
from slipd.signals.observed_zero import ObservedZero
from slipd.signals.tare import Tare
from slipd.types.arrays import Array


class PadZero:
    """Offset of the readings of one pad, and how it is known.

    Args:
        pad: ``[finger.X.pad]``.
        shape: Shape of an image: (n,) of n taxels, or (n, 3) of three-axis ones.
        scale: Force on a taxel per count, a number or by axis.
        charge: Reconstruction of the charge, which finds the zero each time the pad is free; None for other pads.

    Attributes:
        tare: Offset of the readings, in counts.
    """

    def __init__(self, pad: Pad, shape: tuple[int, ...], scale: Array, charge: ChargeReconstruction | None) -> None:
        self.tare = Tare(np.reshape(pad.tare, shape) if pad.tare else np.zeros(shape))
        self._scale, self._charge = scale, charge
        self._stated = bool(pad.tare)
        self._observed = ObservedZero(pad.threshold)
        self._offset = self.tare.current
        self.tare.on_change.append(self._follow_offset)

    def apply(self, values: Array, t_ns: int, *, trusted: bool) -> Array:
        """Return an image without the offset, which a tare may take from it; see `Tare.apply`."""
        return self.tare.apply(values, t_ns, trusted=trusted)

    def judge(self, readings: Array, t_ns: int, *, free: bool) -> None:
        """Confirm a zero that is not known, or reject a stored one, by an image of a pad that may be free.

        Args:
            readings: Normal force on each taxel, shape (n,).
            t_ns: When the image was acquired, CLOCK_MONOTONIC.
            free: The force sensor measures no contact.
        """
        self._observed.update(readings, t_ns, free=free)
        if self._observed.wrong:
            self.tare.reject("the pad reads a load while the force sensor measures none")
        elif self._observed.right and not self.known:
            self.tare.observe(t_ns)

    @property
    def tared(self) -> bool:
        """The offset is right: by the config, by a tare, or as the pad was seen to be free."""
        return self._stated or self.tare.known

    @property
    def known(self) -> bool:
        """The zero is known: the offset is right, or the pad finds its zero each time it is free, as charge pads do."""
        return self.tared or self._charge is not None

    @property
    def origin(self) -> str | None:
        """Where the zero comes from: "config", "measured", "stored" or "observed"; None: it is not known."""
        if self._charge is not None and not self.tare.known:
            return "observed"
        return self.tare.current.origin if self.known else None

    def _follow_offset(self) -> None:
        """Shift the charge that was found with another offset than the one in force."""
        now, before = self.tare.current, self._offset
        self._offset = now
        if self._charge is not None and now is not before:
            self._charge.shift(self._scale * (now.value - before.value))
