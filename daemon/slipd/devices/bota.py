"""Bota Systems Rokubi, SensONE and MiniONE force/torque sensors on a serial line (binary format).

The sensor boots with a text banner, is configured by short text commands, and then pushes 37-byte frames.
Acknowledgements and banner travel in the same stream as the frames. Source: Bota serial example and driver.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import Literal

import numpy as np

from slipd.devices import Device, bota_text, crc
from slipd.devices.framing import FixedFrames
from slipd.devices.health import DecoderHealth
from slipd.samples import Array, WrenchSample

FRAME_LENGTH = 37

SINC_LENGTHS = (64, 1024)
"""From the fastest rate the sensor knows, 51200 / 64 = 800 Hz, to the slowest documented, 50 Hz."""

BOOT_NS = 10_000_000_000
"""Opening a port may restart the sensor; its own example waits so long for the banner."""
QUIET_NS = 2_000_000_000
"""A sensor that was stopped and not restarted by the opening says nothing: after so long it is asked. One that boots
does not hear it."""
SETTLE_NS = 500_000_000
"""From the banner to the first command, as in the sensor's own example."""
ACK_TIMEOUT_NS = 500_000_000
"""An acknowledgement may wait behind frames already sent; it takes some milliseconds otherwise."""
ATTEMPTS = 3
"""A command unanswered so often means that the sensor is not in the state it is thought to be in."""
RETRY_PAUSE_NS = 1_000_000_000
"""Before a refused command is repeated, or an unanswered sequence begun anew."""
SILENCE_NS = 1_000_000_000
"""Fifty periods of the slowest rate: the sensor no longer runs."""

_HEARD_LENGTH = 32  # longer than any text that is waited for
_BANNER_LENGTH = 512  # a banner has under 100 bytes

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
    """

    def __init__(self) -> None:
        self.health = DecoderHealth()
        self._frames = FixedFrames(_HEADER, FRAME_LENGTH, _checksum_holds, self.health, text=_TEXT)

    def receive(self, data: bytes, t_ns: int) -> list[WrenchSample]:
        """Take bytes received at ``t_ns`` and return the readings they complete, in the sensor's frame."""
        buffer, found = self._frames.receive(data)
        samples: list[WrenchSample] = []
        for at, in_step in found:
            _, status, fx, fy, fz, mx, my, mz, time_us, _ = _FRAME.unpack_from(buffer, at)
            if status & _RESERVED_STATUS and not in_step:
                # A 16-bit checksum passes one header byte in 65,536 of a noise. Out of step a frame needs the
                # reserved bits as well; a device that sets them is believed from its second frame on.
                self.health.bad += 1
                continue
            names = _STATUS[status & 0xF]
            if not math.isfinite(fx + fy + fz + mx + my + mz) and "invalid" not in names:
                names = (*names, "invalid")
            values = np.array((fx, fy, fz, mx, my, mz))
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


class Session:
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

    def __init__(self, sinc_length: int = 64, temperature_compensation: bool = False) -> None:
        shortest, longest = SINC_LENGTHS
        if not (isinstance(sinc_length, int) and shortest <= sinc_length <= longest):
            raise ValueError(f"a sinc length of {sinc_length} is not supported: {shortest} to {longest} is")
        self.decoder = Decoder()
        self.health = self.decoder.health
        self.state = "closed"
        self.identity = ""
        self._commands = (
            bota_text.CONFIGURE,
            bota_text.communication(temperature_compensation=temperature_compensation),
            bota_text.filtering(sinc_length),
            bota_text.RUN,
        )
        self._step = 0
        self._attempt = 0
        self._phase: Literal["boot", "pause", "ask", "run"] = "boot"
        self._due_ns: int | None = None
        self._booted_ns = 0
        self._heard = b""
        self._banner = b""

    def start(self, now_ns: int) -> bytes:
        """Begin on a freshly opened link, by waiting for the banner or for frames."""
        self.decoder.forget()
        self.identity = ""
        self._booted_ns = now_ns + BOOT_NS
        self._wait(now_ns)
        return b""

    def stop(self) -> bytes:
        """End, and return the command that stops the frames."""
        self.state = "closed"
        self._due_ns = None
        return bota_text.CONFIGURE.encode()

    def receive(self, data: bytes, now_ns: int) -> list[WrenchSample]:
        """Take bytes received at ``now_ns`` and return the readings they complete."""
        samples = self.decoder.receive(data, now_ns)
        if self._due_ns is None:
            return samples
        heard = self._heard + data
        self._heard = heard[-_HEARD_LENGTH:]
        banner_at = heard.find(bota_text.BANNER)
        if banner_at < 0 and self._banner:
            self._read_identity(data)
        if banner_at >= 0:
            self._banner = b""
            self._read_identity(heard[banner_at:])
            self._heard = b""
            self.state = "configuring"
            self._pause("pause", now_ns + SETTLE_NS)
        elif self._phase == "ask":
            self._look_for_ack(heard, bool(samples), now_ns)
        elif samples and self._phase == "boot":
            self.state = "configuring"
            self._pause("pause", now_ns)
        elif samples and self._phase == "run":
            self._due_ns = now_ns + SILENCE_NS
        return samples

    def next_deadline(self) -> int | None:
        """Return when `on_time` is due, ns; None while closed."""
        return self._due_ns

    def on_time(self, now_ns: int) -> bytes:
        """Return the command that is due at ``now_ns``; empty when none is."""
        if self._due_ns is None or now_ns < self._due_ns:
            return b""
        if self._phase == "run":
            self._wait(now_ns)
            return b""
        if self._attempt == ATTEMPTS:
            letter = self._commands[self._step].letter
            self.state = "waiting" if now_ns < self._booted_ns else f"no answer to {letter}"
            self._pause("pause", now_ns + RETRY_PAUSE_NS)
            return b""
        self._phase = "ask"
        self._attempt += 1
        self._due_ns = now_ns + ACK_TIMEOUT_NS
        self._heard = b""
        return self._commands[self._step].encode()

    def _wait(self, now_ns: int) -> None:
        """Wait for the banner or for frames."""
        self.state = "waiting"
        self._heard = self._banner = b""
        self._pause("boot", now_ns + QUIET_NS)

    def _read_identity(self, data: bytes) -> None:
        """Look for the sensor's name in what follows the begin of a banner."""
        self._banner += data
        name = bota_text.find_identity(self._banner[:_BANNER_LENGTH])
        if name or len(self._banner) >= _BANNER_LENGTH:
            self.identity = name or self.identity
            self._banner = b""

    def _pause(self, phase: Literal["boot", "pause"], due_ns: int, step: int = 0) -> None:
        self._phase, self._due_ns, self._step, self._attempt = phase, due_ns, step, 0

    def _look_for_ack(self, heard: bytes, frames_flow: bool, now_ns: int) -> None:
        command = self._commands[self._step]
        code = bota_text.find_ack(heard, command.letter)
        if code is None and frames_flow and command is bota_text.RUN:
            code = 0
        if code is None:
            return
        if code:
            self.state = f"refused {command.letter} with code {code}"
            self._pause("pause", now_ns + RETRY_PAUSE_NS, self._step)
        elif command is bota_text.RUN:
            self.state = "running"
            self._phase, self._due_ns = "run", now_ns + SILENCE_NS
        else:
            self.state = "configuring"
            self._pause("pause", now_ns, self._step + 1)


DEVICE = Device("bota", "wrench", ("serial",), Decoder, Session, baud=460_800, clock_span_ns=_US_SPAN * 1_000)
