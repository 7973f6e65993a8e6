"""Session with a Bota sensor: wait for its boot banner, configure it by text commands, and watch its frames."""

from __future__ import annotations

from slipd.devices.bota import bota_text
from slipd.devices.bota.bota_decoder import Decoder
from slipd.devices.shared.integer_option import check_integer
from slipd.devices.shared.sensor_session import SensorSession
from slipd.devices.shared.startup_sequence import StartupSequence, Step
from slipd.types.samples import WrenchSample

SAMPLES_HZ = 51_200
"""Internal sampling rate; the sinc filter averages this many samples per second over its length."""
SINC_LENGTHS = (64, 2047)
"""Filters from 51200 / 64 = 800 Hz, the fastest rate, to 51200 / 2047 = 25 Hz, the longest of the maker's driver."""

BOOT_NS = 10_000_000_000
"""Time for a sensor to boot, because opening the port restarts it; Bota's example waits this long for the banner."""
QUIET_NS = 3_000_000_000
"""Silence after which the first command is sent; the maker's driver waits as long.

A sensor that was stopped, and that opening the port did not restart, sends nothing by itself. A booting sensor ignores
the command.
"""
SETTLE_NS = 500_000_000
"""Time from the banner to the first command, as in Bota's example."""

_TEXT_KEPT = 32  # bytes, more than any text that the session waits for
_BANNER_LENGTH = 512  # bytes; a banner has fewer than 100

_BOOT = "boot text"
_ANSWERED_BY_FRAMES = (_BOOT, bota_text.RUN.letter)


class Session(SensorSession[WrenchSample]):
    """Bring the sensor from any state to sending frames at the configured rate.

    Readings that arrive are returned in every state. `state` is "closed", "waiting" (for the sensor to boot),
    "configuring", "running", or the problem, such as "no answer to C" or "refused f with code 2"; the session retries
    forever. A sensor that does not answer within `BOOT_NS` of opening the port may still be booting, so the state
    returns to "waiting".

    `identity` is the product name and serial number from the banner, such as "MiniONE S/N 1234"; "" if no banner was
    received since the port was opened.

    Args:
        sinc_length: Length of the sensor's filter, 64 to 2047; one frame is sent every sinc_length / 51200 s:
            64 is 800 Hz, 512 is 100 Hz.
        temperature_compensation: Enable the sensor's temperature compensation; the manufacturer advises against it.

    Raises:
        ValueError: The sinc length is out of range or not an integer.
    """

    decoder: Decoder

    def __init__(self, sinc_length: int = 64, temperature_compensation: bool = False) -> None:
        check_integer("sinc_length", sinc_length, *SINC_LENGTHS)
        commands = (
            bota_text.CONFIGURE,
            bota_text.communication(temperature_compensation=temperature_compensation),
            bota_text.filtering(sinc_length),
            bota_text.RUN,
        )
        boot = Step(_BOOT, b"", "optional", QUIET_NS, attempts=1)
        startup = StartupSequence([boot, *(Step(command.letter, command.encode()) for command in commands)])
        super().__init__(Decoder(), startup, bota_text.CONFIGURE.encode())
        self._booted_ns = 0
        self._text = b""
        self._banner = b""

    def start(self, now_ns: int) -> bytes:
        """Begin on a freshly opened link: wait for the banner or for frames."""
        self._booted_ns = now_ns + BOOT_NS
        self._text = self._banner = b""
        return super().start(now_ns)

    def receive(self, data: bytes, now_ns: int) -> list[WrenchSample]:
        """Decode bytes received at ``now_ns``; return the readings they complete."""
        samples = super().receive(data, now_ns)
        if not self.decoder.text_passed and self._startup.awaited not in _ANSWERED_BY_FRAMES:
            return samples
        text = self._text + data
        self._text = text[-_TEXT_KEPT:]
        if self.next_deadline() is not None:
            self._handle_text(text, data, bool(samples), now_ns)
        return samples

    def on_time(self, now_ns: int) -> bytes:
        """Return the command that is due at ``now_ns``; empty if none is."""
        command = super().on_time(now_ns)
        if command:
            self._text = b""
        if now_ns < self._booted_ns and self.state.startswith("no answer"):
            self._startup.state = "waiting"
        return command

    def _handle_text(self, text: bytes, data: bytes, has_frames: bool, now_ns: int) -> None:
        """Look for a banner and for the awaited answer."""
        banner_at = text.find(bota_text.BANNER)
        if banner_at >= 0:
            self._text = self._banner = b""
            self._read_identity(text[banner_at:])
            self._startup.resume(1, now_ns + SETTLE_NS)
            return
        if self._banner:
            self._read_identity(data)
        awaited = self._startup.awaited
        code = bota_text.find_ack(text, awaited)
        if code is None and has_frames and awaited in _ANSWERED_BY_FRAMES:
            code = 0
        if code is not None:
            self._startup.handle_answer(now_ns, f"refused {awaited} with code {code}" if code else "")
        if code == 0 and awaited == bota_text.RUN.letter:
            self._startup.reading_received(now_ns)

    def _read_identity(self, data: bytes) -> None:
        """Collect the banner until it contains the sensor's name and serial number."""
        self._banner += data
        name = bota_text.find_identity(self._banner[:_BANNER_LENGTH])
        if name or len(self._banner) >= _BANNER_LENGTH:
            self.identity = name or self.identity
            self._banner = b""
