"""Decoder of PapillArray frames: the pillar forces of each sensor."""

from __future__ import annotations

import numpy as np

from slipd.devices.papillarray import papillarray_frames as frames
from slipd.devices.shared.decoder_health import DecoderHealth
from slipd.devices.shared.frame_scanner import FrameScanner
from slipd.devices.shared.sequence_tracker import SequenceTracker
from slipd.types.samples import TactileSample

_COUNTER_SPAN = 1 << 32
_TYPICAL_LENGTH = 640  # two sensors of nine pillars and their totals


class Decoder:
    """Return a tactile sample of every sensor in a frame; ``source`` is its index in the frame, "0" or "1".

    ``values`` has shape (pillars, 3): Fx, Fy, Fz of each pillar in N, in the order, axes and sign that the controller
    sends. ``device_time_ns`` is the controller's clock, which never wraps. The decoder checks the structure of
    displacements, totals and the controller's own slip detection, but does not use them: force and torque follow from
    the pillars' forces.

    `health.lost`, `duplicates` and `restarts` count frames by the controller's counter, `good` counts samples.

    The only status name is "invalid": a value is not finite.
    """

    def __init__(self) -> None:
        self.health = DecoderHealth()
        self._frames = FrameScanner(frames.START, self._measure, _TYPICAL_LENGTH, self.health)
        self._sequence = SequenceTracker(_COUNTER_SPAN, self.health, in_order=True)
        self._bodies: list[frames.Body] = []

    @property
    def has_frame(self) -> bool:
        """Whether the bytes received last completed a frame."""
        return bool(self._bodies)

    def receive(self, data: bytes, t_ns: int) -> list[TactileSample]:
        """Decode bytes received at ``t_ns``; return the images they complete."""
        self._bodies = []
        self._frames.receive(data)
        samples: list[TactileSample] = []
        for body in self._bodies:
            if self._sequence.accept(body.counter):
                samples += _samples(body, t_ns)
        self.health.good += len(samples)
        return samples

    def forget(self) -> None:
        """Drop a partial frame and the expected counter, because the line was closed."""
        self._frames.forget()
        self._sequence.forget()

    def _measure(self, buffer: bytes, at: int) -> int:
        """Measure a frame for `FrameScanner`, which calls this once per valid frame, and keep its content."""
        length, body = frames.parse(buffer, at)
        if body is not None:
            self._bodies.append(body)
        return length


def _samples(body: frames.Body, t_ns: int) -> list[TactileSample]:
    samples = []
    for sensor, forces_n in enumerate(body.forces_n):
        if forces_n is not None:
            status = () if np.isfinite(forces_n).all() else ("invalid",)
            samples.append(TactileSample(t_ns, body.time_us * 1000, forces_n, status, str(sensor)))
    return samples
