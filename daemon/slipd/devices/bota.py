"""Bota Systems Rokubi, SensONE and MiniONE force/torque sensors on a serial line (binary format).

Opening the port reboots the sensor. It sends a text banner, is configured by short text commands, and then streams
frames; acknowledgements and the banner travel in the same stream. Commands end with a line feed and are answered by
``r,0,<letter>,<code>``; the meaning of codes other than 0 is unconfirmed.

A frame has 37 bytes, little-endian: ``AA``, status (u16), force x y z in N and torque x y z in N·m (6 × f32), device
time in µs (u32), temperature in °C (f32), CRC-16/X-25 of everything after ``AA``.

Sources: the maker's driver, package bota-driver 1.1.16 (``Bota_Binary_gen0``), whose commands and expectations show
when it talks to the emulator; and Bota's serial example, which sends commands without an end.
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Sequence

from slipd.devices import Device, RateOption
from slipd.devices.shared import checksums
from slipd.devices.shared.device_interface import check_integer
from slipd.devices.shared.frame_scanner import FrameDecoder, FrameScanner
from slipd.devices.shared.sensor_session import SensorSession, Step
from slipd.types.arrays import Array
from slipd.types.samples import Sample, WrenchSample

BANNER = b"App Init"

_BAUD_460800 = 4
_ACK = re.compile(rb"r,\d,([A-Za-z]),(\d)")
_IDENTITY = re.compile(rb"name: ([!-~][ -~]{0,39})[\r\n](?:[ -~]{0,80}+[\r\n]++){0,4}?S/N: (\d{1,20})[\r\n]")
CONFIGURE, RUN = b"C\n", b"R\n"


def find_ack(received: bytes, letter: str) -> int | None:
    """Return the code that acknowledges the command ``letter``; None if ``received`` has no acknowledgement."""
    code = dict(_ACK.findall(received)).get(letter.encode())
    return None if code is None else int(code)


FRAME_LENGTH = 37

US_SPAN = 1 << 32
"""The device time wraps after this many µs."""

_HEADER = b"\xaa"
_FRAME = struct.Struct("<BH6fIf")  # header, status, force, torque, device time, temperature; the CRC follows
_RESERVED_STATUS = 0xFFF0
_STATUS_NAMES = ("skipped", "overload", "invalid", "raw")
_STATUS = tuple(tuple(name for bit, name in enumerate(_STATUS_NAMES) if status >> bit & 1) for status in range(1 << 4))
_TEXT = bytes(range(0x20, 0x7F)) + b"\r\n\t"


class Decoder(FrameDecoder):
    """Decode binary frames to wrench samples; skip text between the frames.

    ``device_time_ns`` is the sensor's microsecond counter as sent: it wraps every 2^32 µs (71.6 min) and is not
    unwrapped here. The frames have no sequence number, so `health.lost` stays 0: gaps show in the device time.

    Status names: "skipped" (the sensor drops samples because its sinc length is too short), "overload" (out of range),
    "invalid" (the sensor reports it, or a value is not finite), "raw" (gauge values: the sensor's calibration is off).

    Attributes:
        text_passed: Whether the bytes received last may have contained text.
    """

    def __init__(self) -> None:
        super().__init__()
        self.text_passed = False
        measure = checksums.x25_measure(1, FRAME_LENGTH)
        self._frames = FrameScanner(_HEADER, measure, FRAME_LENGTH, self.health, least=FRAME_LENGTH, text=_TEXT)

    def _readings(self, data: bytes, t_ns: int) -> list[WrenchSample]:
        buffer, found = self._frames.receive(data, t_ns)
        self.text_passed = len(found) * FRAME_LENGTH != len(buffer)
        samples: list[WrenchSample] = []
        for at, in_sync in found:
            _, status, *values, time_us, temperature_c = _FRAME.unpack_from(buffer, at)
            if status & _RESERVED_STATUS and not in_sync:
                # In noise, a 16-bit checksum matches after one header byte in 65,536. Out of sync, the reserved status
                # bits must be zero as well; frames of a device that sets them are accepted from the second one on.
                self.health.bad += 1
                continue
            names = _STATUS[status & 0xF]
            if not math.isfinite(sum(values)) and "invalid" not in names:
                names = (*names, "invalid")
            samples.append(WrenchSample(t_ns, time_us * 1000, values[:3], values[3:], names))
            self.health.temperature_c = temperature_c
        return samples


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
        device_time_us: Device time, µs; sent modulo 2^32.
        temperature_c: Temperature, °C.
        status: The 16 status bits.
    """
    body = _FRAME.pack(_HEADER[0], status, *force_n, *torque_nm, device_time_us % US_SPAN, temperature_c)
    return body + checksums.x25(body[1:]).to_bytes(2, "little")


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

_TEXT_KEPT = 512  # bytes; a banner has fewer than 100

_FRAMES = "frames"  # `Step.reply` of a step that frames answer as well as an acknowledgement does


class Session(SensorSession[Decoder]):
    """Bring the sensor from any state to sending frames at the configured rate.

    The sensor's own temperature compensation stays off, as its maker advises.

    Readings that arrive are returned in every state. `state` is "closed", "waiting" (for the sensor to boot),
    "configuring", "running", or the problem, such as "no answer to C" or "refused f with code 2"; the session retries
    forever. A sensor that does not answer within `BOOT_NS` of opening the port may still be booting, so the state
    returns to "waiting".

    `identity` is the product name and serial number from the banner, such as "MiniONE S/N 1234"; "" if no banner was
    received since the port was opened.

    Args:
        sinc_length: Length of the sensor's filter, 64 to 2047; one frame is sent every sinc_length / 51200 s:
            64 is 800 Hz, 512 is 100 Hz.

    Raises:
        ValueError: The sinc length is out of range or not an integer.
    """

    def __init__(self, sinc_length: int = 64) -> None:
        check_integer("sinc_length", sinc_length, *SINC_LENGTHS)
        communication = f"c,0,1,0,{_BAUD_460800}\n".encode()  # uncompensated, calibrated, binary
        filtering = f"f,{sinc_length},0,0,1\n".encode()  # without chop, fast mode or FIR
        boot = Step("boot text", b"", "optional", QUIET_NS, attempts=1, reply=_FRAMES)
        commands = [Step(text[:1].decode(), text) for text in (CONFIGURE, communication, filtering)]
        start = Step("R", RUN, reply=_FRAMES)
        super().__init__(Decoder(), [boot, *commands, start], CONFIGURE)
        self._booted_ns = 0
        self._text = b""  # received since the last command or the beginning of the banner

    def start(self, now_ns: int) -> bytes:
        """Begin on a freshly opened link: wait for the banner or for frames."""
        self._booted_ns = now_ns + BOOT_NS
        self._text = b""
        return super().start(now_ns)

    def receive(self, data: bytes, now_ns: int) -> Sequence[Sample]:
        """Decode bytes received at ``now_ns``; return the readings they complete."""
        samples = self.decoder.receive(data, now_ns)
        awaited = self.awaited
        if self.decoder.text_passed or (awaited is not None and awaited.reply == _FRAMES):
            self._handle_text(data, bool(samples), now_ns)
        if samples:
            self.reading_received(now_ns)
        return samples

    def on_time(self, now_ns: int) -> bytes:
        """Return the command that is due at ``now_ns``; empty if none is."""
        command = super().on_time(now_ns)
        if command:
            self._text = b""
        if now_ns < self._booted_ns and self.state.startswith("no answer"):
            self.state = "waiting"
        return command

    def _handle_text(self, data: bytes, has_frames: bool, now_ns: int) -> None:
        """Look for a banner and for the awaited answer."""
        _, banner, after = (self._text + data).rpartition(BANNER)
        self._text = after[-_TEXT_KEPT:]
        if self.next_deadline() is None:
            return
        if found := _IDENTITY.search(self._text):
            self.identity = f"{found[1].decode().strip()} S/N {found[2].decode()}"
        if banner:
            self.resume(1, now_ns + SETTLE_NS)
            return
        awaited = self.awaited
        if awaited is None:
            return
        code = find_ack(self._text, awaited.name)
        if code is None and has_frames and awaited.reply == _FRAMES:
            code = 0
        if code is not None:
            self.handle_answer(now_ns, f"refused {awaited.name} with code {code}" if code else "")
        if code == 0 and awaited.request == RUN:
            self.reading_received(now_ns)


DEVICE = Device(
    "bota",
    "wrench",
    ("serial",),
    Decoder,
    Session,
    rates_hz=(SAMPLES_HZ / SINC_LENGTHS[1], SAMPLES_HZ / SINC_LENGTHS[0]),
    baud=460_800,
    frame_bytes=FRAME_LENGTH,
    clock_span_ns=US_SPAN * 1_000,
    rate_option=RateOption("sinc_length", SAMPLES_HZ),
    frame="a Bota frame",
    evidence="maker",
)
