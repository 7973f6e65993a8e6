"""Contactile PapillArray pads behind a PTS controller: nine pillars a sensor, three axes a pillar, two sensors a port.

The controller streams by itself; a session only sets its rate. It never sends the command that zeroes the sensors:
taring is slipd's own, and can be undone. Sources: as of `slipd.devices.papillarray_frames`.
"""

from __future__ import annotations

import numpy as np

from slipd.devices import Device
from slipd.devices import papillarray_frames as frames
from slipd.devices.conversation import Conversation, Step, TalkingSession
from slipd.devices.framing import Frames
from slipd.devices.health import DecoderHealth
from slipd.devices.numbering import Numbering
from slipd.devices.papillarray_layout import Layout
from slipd.samples import TactileSample

RATES_HZ = (100, 250, 500, 1000)

_COUNTER_SPAN = 1 << 32
_TYPICAL_LENGTH = 640  # two sensors of nine pillars and their totals


class Decoder:
    """Makes a tactile sample of every sensor in a frame; ``source`` is its place in the frame, "0" or "1".

    ``values`` has shape (pillars, 3): Fx, Fy, Fz of each pillar in N, in the order, the axes and the sign in which the
    controller sends them. ``device_time_ns`` is the controller's clock, which never begins anew. Which numbers are
    forces the whole force of a sensor decides; until a load has shown it, and in frames where it does not fit, there
    are no samples, and `health.note` says why. Displacements, torques and the controller's own slip detection are
    checked for their structure and passed over: the pillars' forces give force and torque by themselves.

    `health.lost`, `duplicates` and `restarts` count frames by the controller's counter, `good` counts samples; a frame
    whose sums contradict the layout is one `bad`.

    Status names: "invalid" (a value is not finite).
    """

    def __init__(self) -> None:
        self.health = DecoderHealth()
        self._frames = Frames(frames.START, self._measure, _TYPICAL_LENGTH, self.health)
        self._numbering = Numbering(_COUNTER_SPAN, self.health, in_order=True)
        self._layout = Layout()
        self._bodies: list[frames.Body] = []

    @property
    def framed(self) -> bool:
        """The last bytes held a whole frame."""
        return bool(self._bodies)

    def receive(self, data: bytes, t_ns: int) -> list[TactileSample]:
        """Take bytes received at ``t_ns`` and return the images they complete."""
        self._bodies = []
        self._frames.receive(data)
        samples: list[TactileSample] = []
        for body in self._bodies:
            if not self._numbering.take(body.counter):
                continue
            if self._layout.fits(body.pads):
                samples += self._images(body, t_ns)
            else:
                self.health.bad += self._layout.force_at is not None
            self.health.note = self._layout.note
        self.health.good += len(samples)
        return samples

    def forget(self) -> None:
        """Drop a begun frame and what was expected to follow: the line was closed."""
        self._frames.forget()
        self._numbering.forget()
        self._layout = Layout()
        self.health.note = ""

    def _images(self, body: frames.Body, t_ns: int) -> list[TactileSample]:
        begin = self._layout.force_at or 0
        samples = []
        for sensor, pad in enumerate(body.pads):
            if pad is not None:
                forces_n = pad.entries[:, begin : begin + 3]
                status = () if np.isfinite(forces_n).all() else ("invalid",)
                samples.append(TactileSample(t_ns, body.time_us * 1000, forces_n, status, str(sensor)))
        return samples

    def _measure(self, buffer: bytes, at: int) -> int:
        """As `Frames` asks for; it asks once a frame."""
        length, body = frames.read(buffer, at)
        if body is not None:
            self._bodies.append(body)
        return length


class Session(TalkingSession[TactileSample]):
    """Sets the controller's rate and listens.

    `state` is "closed", "waiting", "running" or "no answer to rate"; the rate is set again whenever the stream falls
    silent. The controller never says what it is: `identity` is "".

    Args:
        rate_hz: Frames a second: 100, 250, 500 or 1000.

    Raises:
        ValueError: Another rate.
    """

    decoder: Decoder

    def __init__(self, rate_hz: int = 500) -> None:
        if rate_hz not in RATES_HZ:
            raise ValueError(f"rate_hz {rate_hz!r} is not known: {', '.join(map(str, RATES_HZ))} are")
        # No farewell: the controller knows no command that would stop it.
        super().__init__(Decoder(), Conversation([Step("rate", encode_rate(rate_hz), "none")]))

    def receive(self, data: bytes, now_ns: int) -> list[TactileSample]:
        """Take bytes received at ``now_ns`` and return the images they complete."""
        samples = super().receive(data, now_ns)
        if self.decoder.framed:  # it sends, though its readings may not be known yet
            self._talk.has_reading(now_ns)
        return samples


def encode_rate(rate_hz: int) -> bytes:
    """Return the command for a rate."""
    return f"f{rate_hz}\n".encode()


DEVICE = Device(
    "papillarray",
    "tactile",
    ("serial",),
    Decoder,
    Session,
    rates_hz=(RATES_HZ[0], RATES_HZ[-1]),
    baud=115_200,
    axes=3,
    newtons=True,
    taxels=frames.PILLARS,
    shared=True,
    sensors=tuple(map(str, range(frames.SENSORS))),
    frame="a PTS frame",
)
