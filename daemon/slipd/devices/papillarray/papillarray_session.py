"""Session with a PTS controller: set its rate and watch its frames."""

from __future__ import annotations

from slipd.devices.papillarray.papillarray_decoder import Decoder
from slipd.devices.shared.sensor_session import SensorSession
from slipd.devices.shared.startup_sequence import StartupSequence, Step
from slipd.types.samples import TactileSample

RATES_HZ = (100, 250, 500, 1000)


class Session(SensorSession[TactileSample]):
    """Set the controller's rate, and set it again whenever the stream falls silent.

    `state` is "closed", "waiting", "running" or "no answer to rate". The controller does not identify itself, so
    `identity` is "".

    Args:
        rate_hz: Frames per second: 100, 250, 500 or 1000.

    Raises:
        ValueError: The rate is not one of these.
    """

    decoder: Decoder

    def __init__(self, rate_hz: int = 500) -> None:
        if rate_hz not in RATES_HZ:
            raise ValueError(f"rate_hz must be one of {', '.join(map(str, RATES_HZ))}, got {rate_hz!r}")
        # There is no last request, because the controller has no command that stops it.
        super().__init__(Decoder(), StartupSequence([Step("rate", encode_rate(rate_hz), "none")]))

    def receive(self, data: bytes, now_ns: int) -> list[TactileSample]:
        """Decode bytes received at ``now_ns``; return the images they complete."""
        samples = super().receive(data, now_ns)
        if self.decoder.has_frame:  # the controller sends, even if no sensor is connected
            self._startup.reading_received(now_ns)
        return samples


def encode_rate(rate_hz: int) -> bytes:
    """Return the command that sets a rate."""
    return f"f{rate_hz}\n".encode()
