"""Contactile PapillArray pads behind a PTS controller: nine three-axis pillars per sensor, two sensors per port.

The controller streams without a request; the session only sets its rate. It never sends the command that zeroes the
sensors, because slipd's own tares are reversible. Sources: see `papillarray_frames`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slipd.devices import Device, RateOption
from slipd.devices.papillarray import papillarray_frames as frames
from slipd.devices.papillarray.papillarray_frames import PILLARS, SENSORS
from slipd.devices.shared.device_interface import check_choice
from slipd.devices.shared.frame_scanner import FrameDecoder, FrameScanner
from slipd.devices.shared.sensor_session import SensorSession, StartupSequence, Step
from slipd.devices.shared.sequence_tracker import SequenceTracker
from slipd.types.samples import Sample, TactileSample

__all__ = ["DEVICE", "Decoder", "Session"]


_COUNTER_SPAN = 1 << 32
_TYPICAL_LENGTH = 640  # two sensors of nine pillars and their totals


class Decoder(FrameDecoder):
    """Return a tactile sample of every sensor in a frame; ``source`` is its index in the frame, "0" or "1".

    ``values`` has shape (pillars, 3): Fx, Fy, Fz of each pillar in N, in the order, axes and sign that the controller
    sends. ``device_time_ns`` is the controller's clock, which never wraps. The decoder checks the structure of
    displacements, totals and the controller's own slip detection, but does not use them: force and torque follow from
    the pillars' forces.

    `health.lost`, `duplicates` and `restarts` count frames by the controller's counter, `good` counts samples.

    The only status name is "invalid": a value is not finite.

    Attributes:
        bodies: Frames that the bytes received last completed.
    """

    def __init__(self) -> None:
        super().__init__()
        self._frames = FrameScanner(frames.START, self._measure, _TYPICAL_LENGTH, self.health)
        self._sequence = SequenceTracker(_COUNTER_SPAN, self.health, in_order=True)
        self.bodies: list[frames.Body] = []

    def receive(self, data: bytes, t_ns: int) -> list[TactileSample]:
        """Decode bytes received at ``t_ns``; return the images they complete."""
        self.bodies = []
        self._frames.receive(data)
        samples: list[TactileSample] = []
        for body in self.bodies:
            if self._sequence.accept(body.counter):
                samples += _samples(body, t_ns)
        self.health.good += len(samples)
        return samples

    def forget(self) -> None:
        """Drop a partial frame and the expected counter, because the line was closed."""
        super().forget()
        self._sequence.forget()

    def _measure(self, buffer: bytes, at: int) -> int:
        """Measure a frame for `FrameScanner`, which calls this once per valid frame, and keep its content."""
        length, body = frames.parse(buffer, at)
        if body is not None:
            self.bodies.append(body)
        return length


def _samples(body: frames.Body, t_ns: int) -> list[TactileSample]:
    samples = []
    for sensor, forces_n in enumerate(body.forces_n):
        if forces_n is not None:
            status = () if np.isfinite(forces_n).all() else ("invalid",)
            samples.append(TactileSample(t_ns, body.time_us * 1000, forces_n, status, str(sensor)))
    return samples


RATES_HZ = (100, 250, 500, 1000)


class Session(SensorSession[Decoder]):
    """Set the controller's rate, and set it again whenever the stream falls silent.

    `state` is "closed", "waiting", "running" or "no answer to rate". The controller does not identify itself, so
    `identity` is "".

    Args:
        rate_hz: Frames per second: 100, 250, 500 or 1000.

    Raises:
        ValueError: The rate is not one of these.
    """

    def __init__(self, rate_hz: int = 500) -> None:
        check_choice("rate_hz", rate_hz, RATES_HZ)
        # There is no last request, because the controller has no command that stops it.
        super().__init__(Decoder(), StartupSequence([Step("rate", f"f{rate_hz}\n".encode(), "none")]))

    def receive(self, data: bytes, now_ns: int) -> Sequence[Sample]:
        """Decode bytes received at ``now_ns``; return the images they complete."""
        samples = super().receive(data, now_ns)
        if self.decoder.bodies:  # the controller sends, even if no sensor is connected
            self._startup.reading_received(now_ns)
        return samples


DEVICE = Device(
    "papillarray",
    "tactile",
    ("serial",),
    Decoder,
    Session,
    rates_hz=(RATES_HZ[0], RATES_HZ[-1]),
    baud=115_200,
    axes=3,
    measures_newtons=True,
    taxels=PILLARS,
    shared=True,
    sensors=tuple(map(str, range(SENSORS))),
    rate_option=RateOption("rate_hz"),
    frame="a PTS frame",
    evidence="maker",
)
