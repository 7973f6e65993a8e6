"""The counter of OptoForce's serial frames, whose step depends on the DAQ: one per frame, or one per millisecond.

Sources: the DAQ in a capture of a three-axis sensor (alknemeyer/optoforce at 88cfbf5, ``tests/test-data.bin``) counts 1
per frame; that of a six-axis sensor at 100 Hz (shadow-robot/optoforce#31) counts 10. The frames themselves show which.
"""

from __future__ import annotations

from slipd.devices.shared.decoder_health import DecoderHealth
from slipd.devices.shared.sequence_tracker import SequenceTracker

STEPS = (1, 3, 10, 33, 100)
"""Steps of the counter: one per frame, or one per millisecond at each documented period."""

_SPAN = 1 << 16
_FRAMES = 1 << 32


class FrameCounter:
    """Track the counter of one stream; two equal differences in a row show its step.

    Args:
        health: Receives ``lost``, ``duplicates`` and ``restarts``; nothing is lost until the step is known.
    """

    def __init__(self, health: DecoderHealth) -> None:
        self._sequence = SequenceTracker(_FRAMES, health, first=_FRAMES, in_order=True)
        self.forget()

    def forget(self) -> None:
        """Start again: the next number follows nothing, and the step is unknown."""
        self._sequence.forget()
        self._step = 0
        self._difference = 0  # between the two numbers received last
        self._last: int | None = None
        self._number = self._frame = 0  # number and index of the frame that was accepted last

    def accept(self, number: int) -> bool:
        """Track the number of a reading; return False if the reading is old and must be dropped."""
        if self._last is None:
            self._last = self._number = number
        difference = (number - self._last) % _SPAN
        if difference == self._difference and difference in STEPS:
            self._step = difference
        self._difference, self._last = difference, number
        frame = self._frame + self._frames_since(number)
        accepted = self._sequence.accept(frame % _FRAMES)
        if accepted:
            self._number, self._frame = number, frame
        return accepted

    def _frames_since(self, number: int) -> int:
        """Return how many frames after the one accepted last this is; negative if it is older."""
        ahead = (number - self._number + _SPAN // 2) % _SPAN - _SPAN // 2
        return round(ahead / (self._step or max(abs(ahead), 1)))
