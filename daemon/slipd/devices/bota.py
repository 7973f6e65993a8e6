"""Bota Systems Rokubi, SensONE and MiniONE force/torque sensors on a serial line (binary format).

The sensor boots with a text banner, is configured by short text commands, and then pushes 37-byte frames.
Acknowledgements and banner travel in the same stream as the frames. Source: Bota serial example and driver.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence

from slipd.devices import Device, bota_text, crc
from slipd.devices.conversation import Conversation, Step, TalkingSession
from slipd.devices.framing import FixedFrames
from slipd.devices.health import DecoderHealth
from slipd.samples import Array, WrenchSample

FRAME_LENGTH = 37

SAMPLES_HZ = 51_200
"""What the filter averages over its length."""
SINC_LENGTHS = (64, 1024)
"""From the fastest rate the sensor knows, 51200 / 64 = 800 Hz, to the slowest documented, 50 Hz."""

BOOT_NS = 10_000_000_000
"""Opening a port may restart the sensor; its own example waits so long for the banner."""
QUIET_NS = 2_000_000_000
"""A sensor that was stopped and not restarted by the opening says nothing: after so long it is asked. One that boots
does not hear it."""
SETTLE_NS = 500_000_000
"""From the banner to the first command, as in the sensor's own example."""

_HEARD_LENGTH = 32  # longer than any text that is waited for
_BANNER_LENGTH = 512  # a banner has under 100 bytes

_BOOT = "boot text"
_ANSWERED_BY_FRAMES = (_BOOT, bota_text.RUN.letter)

_HEADER = b"\xaa"
_FRAME = struct.Struct("<BH6fIf")  # header, status, force, torque, device time µs, temperature; CRC
_US_SPAN = 1 << 32
_RESERVED_STATUS = 0xFFF0
_STATUS_NAMES = ("skipped", "overload", "invalid", "raw")
_STATUS = tuple(tuple(name for bit, name in enumerate(_STATUS_NAMES) if status >> bit & 1) for status in range(1 << 4))
_TEXT = bytes(range(0x20, 0x7F)) + b"\r\n\t"


class Decoder:
    """Makes wrench samples of the binary frames; text between the frames is passed over.

    ``device_time_ns`` is the sensor's microsecond counter as sent: it wraps every 2^32 µs (71.6 min), and
    unwrapping it is not done here. The frames carry no number, so `health.lost` stays 0: gaps show in the
    device's time.

    Status names: "skipped" (the sensor drops samples: its sinc length is too short), "overload" (out of
    range), "invalid" (the sensor says so, or a value is not finite), "raw" (gauge values: the sensor's
    calibration is off).

    Attributes:
        text_passed: Between or behind the frames of the last bytes there may have been text.
    """

    def __init__(self) -> None:
        self.health = DecoderHealth()
        self.text_passed = False
        self._frames = FixedFrames(_HEADER, FRAME_LENGTH, _checksum_holds, self.health, text=_TEXT)

    def receive(self, data: bytes, t_ns: int) -> list[WrenchSample]:
        """Take bytes received at ``t_ns`` and return the readings they complete, in the sensor's frame."""
        buffer, found = self._frames.receive(data)
        self.text_passed = len(found) * FRAME_LENGTH != len(buffer)
        samples: list[WrenchSample] = []
        for at, in_step in found:
            _, status, *values, time_us, _ = _FRAME.unpack_from(buffer, at)
            if status & _RESERVED_STATUS and not in_step:
                # A 16-bit checksum passes one header byte in 65,536 of a noise. Out of step a frame needs the
                # reserved bits as well; a device that sets them is believed from its second frame on.
                self.health.bad += 1
                continue
            names = _STATUS[status & 0xF]
            if not math.isfinite(sum(values)) and "invalid" not in names:
                names = (*names, "invalid")
            samples.append(WrenchSample(t_ns, time_us * 1000, values[:3], values[3:], names))
        self.health.good += len(samples)
        return samples

    def forget(self) -> None:
        """Drop a begun frame and what was expected to follow: the line was closed."""
        self._frames.forget()


def _checksum_holds(buffer: bytes, at: int) -> bool:
    return crc.x25_holds(buffer[at + 1 : at + FRAME_LENGTH])


def encode_frame(
    force_n: Sequence[float] | Array,
    torque_nm: Sequence[float] | Array,
    device_time_us: int,
    *,
    temperature_c: float = 25.0,
    status: int = 0,
) -> bytes:
    """Return one 37-byte frame as the sensor sends it.

    Args:
        force_n: Force, shape (3,), N.
        torque_nm: Torque, shape (3,), N·m.
        device_time_us: The sensor's clock, µs; sent modulo 2^32.
        temperature_c: Temperature, °C.
        status: The 16 status bits.
    """
    body = _FRAME.pack(_HEADER[0], status, *force_n, *torque_nm, device_time_us % _US_SPAN, temperature_c)
    return body + crc.x25(body[1:]).to_bytes(2, "little")


class Session(TalkingSession[WrenchSample]):
    """Brings the sensor from whatever state it is in to sending frames at the wanted rate.

    Readings that arrive are handed on at all times, whatever the state. `state` is "closed", "waiting" (for the
    sensor to boot), "configuring", "running", or names what is in the way, such as "no answer to C" or
    "refused f with code 2"; both are retried for ever. Within `BOOT_NS` of the port's opening a sensor that does not
    answer is taken to boot still, and the state goes back to "waiting".

    `identity` is product name and serial number as the banner tells them, such as "MiniONE S/N 1234"; "" where no
    banner was seen since the port was opened.

    Args:
        sinc_length: Length of the sensor's filter, 64 to 1024; a frame comes every sinc_length / 51200 s.
        temperature_compensation: Let the sensor compensate its temperature; the maker advises against it.

    Raises:
        ValueError: The sinc length is out of range, or no integer.
    """

    decoder: Decoder

    def __init__(self, sinc_length: int = 64, temperature_compensation: bool = False) -> None:
        shortest, longest = SINC_LENGTHS
        if not (isinstance(sinc_length, int) and shortest <= sinc_length <= longest):
            raise ValueError(f"a sinc length of {sinc_length} is not supported: {shortest} to {longest} is")
        commands = (
            bota_text.CONFIGURE,
            bota_text.communication(temperature_compensation=temperature_compensation),
            bota_text.filtering(sinc_length),
            bota_text.RUN,
        )
        boot = Step(_BOOT, b"", "optional", QUIET_NS, attempts=1)
        talk = Conversation([boot, *(Step(command.letter, command.encode()) for command in commands)])
        super().__init__(Decoder(), talk, bota_text.CONFIGURE.encode())
        self._booted_ns = 0
        self._heard = b""
        self._banner = b""

    def start(self, now_ns: int) -> bytes:
        """Begin on a freshly opened link, by waiting for the banner or for frames."""
        self._booted_ns = now_ns + BOOT_NS
        self._heard = self._banner = b""
        return super().start(now_ns)

    def receive(self, data: bytes, now_ns: int) -> list[WrenchSample]:
        """Take bytes received at ``now_ns`` and return the readings they complete."""
        samples = super().receive(data, now_ns)
        if not self.decoder.text_passed and self._talk.asked not in _ANSWERED_BY_FRAMES:
            return samples
        heard = self._heard + data
        self._heard = heard[-_HEARD_LENGTH:]
        if self.next_deadline() is not None:
            self._listen(heard, data, bool(samples), now_ns)
        return samples

    def on_time(self, now_ns: int) -> bytes:
        """Return the command that is due at ``now_ns``; empty when none is."""
        command = super().on_time(now_ns)
        if command:
            self._heard = b""
        if now_ns < self._booted_ns and self.state.startswith("no answer"):
            self._talk.state = "waiting"
        return command

    def _listen(self, heard: bytes, data: bytes, frames_flow: bool, now_ns: int) -> None:
        """Look for a banner, and for the answer that is waited for."""
        banner_at = heard.find(bota_text.BANNER)
        if banner_at >= 0:
            self._heard = self._banner = b""
            self._read_identity(heard[banner_at:])
            self._talk.resume(1, now_ns + SETTLE_NS)
            return
        if self._banner:
            self._read_identity(data)
        asked = self._talk.asked
        code = bota_text.find_ack(heard, asked)
        if code is None and frames_flow and asked in _ANSWERED_BY_FRAMES:
            code = 0
        if code is not None:
            self._talk.answered(now_ns, f"refused {asked} with code {code}" if code else "")
        if code == 0 and asked == bota_text.RUN.letter:
            self._talk.has_reading(now_ns)

    def _read_identity(self, data: bytes) -> None:
        """Look for the sensor's name in what follows the begin of a banner."""
        self._banner += data
        name = bota_text.find_identity(self._banner[:_BANNER_LENGTH])
        if name or len(self._banner) >= _BANNER_LENGTH:
            self.identity = name or self.identity
            self._banner = b""


DEVICE = Device(
    "bota",
    "wrench",
    ("serial",),
    Decoder,
    Session,
    rates_hz=(SAMPLES_HZ / SINC_LENGTHS[1], SAMPLES_HZ / SINC_LENGTHS[0]),
    baud=460_800,
    frame_bytes=FRAME_LENGTH,
    clock_span_ns=_US_SPAN * 1_000,
    frame="a Bota frame",
)
