"""Robotous RFT force/torque sensors on a serial line.

Commands have 11 bytes, responses 19: ``55``, eight or sixteen bytes of data that begin with the command number, their
sum modulo 256, ``AA``. A reading has, big-endian, force x y z and torque x y z (6 × i16), overload bits (u8), and two
unused bytes.

Sources: the layout from the RFT sample source, Rev 1.2. The codes of rates and filters from the maker's ROS 2 driver,
ROBOTOUS/ROS-2-Interface-for-RFT-Series-UART-Model at c236c0c, ``rft_sensor_serial/src/rft_sensor_serial.cpp``,
``read_fqs_`` and ``filter_fqs_``: 1 is 500 Hz and 14 is 1 Hz. A user of an RFT40 agrees
(nsaitarun-git/Robotous_RFT40_MATLAB_Example at 85afe5a, ``main.m`` line 69), and so, it is reported, do pages 14, 15
and 18 of the manual, REV 1.7, of which no copy was seen. The header of the sample source numbers the filters the other
way round.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from functools import partial

import numpy as np

from slipd.devices import Device, RateOption
from slipd.devices.shared.device_interface import check_choice
from slipd.devices.shared.frame_scanner import NO_FRAME, FrameDecoder, FrameScanner
from slipd.devices.shared.sensor_session import SensorSession, Step, strip_padding
from slipd.types.samples import WrenchSample

SYNC = b"\x55"
RESPONSE_LENGTH = 19
COMMAND_LENGTH = 11

PRODUCT_NAME, SERIAL_NUMBER = 1, 2
SET_FILTER, GET_FILTER = 8, 9
READ_ONCE, START, STOP = 10, 11, 12
SET_RATE, GET_RATE = 15, 16
READINGS = (READ_ONCE, START)

_ANSWERS = frozenset((PRODUCT_NAME, SERIAL_NUMBER, SET_FILTER, GET_FILTER, SET_RATE, GET_RATE))
END = 0xAA
READING_FIELDS = struct.Struct(">6hB2x")
_UNKNOWN_OVERLOAD = 0xC0
_NAME_LENGTH = 15


def _measure(buffer: bytes, at: int) -> int:
    """Return `RESPONSE_LENGTH` if so many bytes from ``at`` on are a valid response, else `NO_FRAME`."""
    number = buffer[at + 1]
    if buffer[at + 18] != END or (number not in READINGS and number not in _ANSWERS):
        return NO_FRAME
    if number in READINGS and buffer[at + 14] & _UNKNOWN_OVERLOAD:
        return NO_FRAME
    return RESPONSE_LENGTH if sum(buffer[at + 1 : at + 17]) & 0xFF == buffer[at + 17] else NO_FRAME


def encode_command(number: int, arguments: bytes = b"") -> bytes:
    """Return a command with up to seven bytes of arguments."""
    return encode_packet(bytes((number,)) + arguments, COMMAND_LENGTH)


def parse_name(content: bytes) -> str:
    """Return the text in the answer to a request for a name; "" if it is not printable."""
    return strip_padding(content[:_NAME_LENGTH])


def encode_packet(data: bytes, length: int) -> bytes:
    """Return a command or a response of this length, padded with zeros."""
    data = data.ljust(length - 3, b"\0")
    return SYNC + data + bytes((sum(data) & 0xFF, END))


COUNTS_PER_N = 50.0

_RAILS = frozenset((-(1 << 15), (1 << 15) - 1))


class Decoder(FrameDecoder):
    """Decode readings to wrench samples.

    The packets have neither sequence number nor time: `health.lost` stays 0 and ``device_time_ns`` is None. The only
    status name is "overload": an axis is out of range, or its count is at the end of its range.

    Args:
        torque_divider: Counts per N·m: 2000 for most models, 1000 for the RFT60-HA01.

    Raises:
        ValueError: The divider is below 1 or not finite.
    """

    def __init__(self, torque_divider: float = 2000.0) -> None:
        if not (math.isfinite(torque_divider) and torque_divider >= 1):
            raise ValueError(f"torque_divider must be a number of at least 1, got {torque_divider}")
        super().__init__()
        self._counts_per_unit = np.repeat((COUNTS_PER_N, torque_divider), 3)
        self._frames = FrameScanner(SYNC, _measure, RESPONSE_LENGTH, self.health, least=RESPONSE_LENGTH)

    def _readings(self, data: bytes, t_ns: int) -> list[WrenchSample]:
        buffer, found = self._frames.receive(data, t_ns)
        samples: list[WrenchSample] = []
        for at, in_sync in found:
            if buffer[at + 1] not in READINGS:
                self.replies.append((buffer[at + 1], buffer[at + 2 : at + 17]))
                continue
            *counts, overload = READING_FIELDS.unpack_from(buffer, at + 2)
            if any(buffer[at + 15 : at + 17]) and not in_sync:
                # An 8-bit sum accepts too much noise. Out of sync, the unused bytes of a reading must be zero as well;
                # readings of a sensor that uses them are accepted from the second one on.
                self.health.bad += 1
                continue
            values = (np.array(counts) / self._counts_per_unit).tolist()
            is_in_range = not overload and _RAILS.isdisjoint(counts)
            samples.append(WrenchSample(t_ns, None, values[:3], values[3:], () if is_in_range else ("overload",)))
        return samples


RATES_HZ = (200, 10, 20, 50, 100, 200, 333, 500, 1000)
"""Output rate of each code; code 0 is the sensor's default, the same rate as code 5."""
FILTERS_HZ = (0, 500, 300, 200, 150, 100, 50, 40, 30, 20, 10, 5, 3, 2, 1)
"""Cut-off frequency of each code of the first-order filter; 0 is no filter."""

CARRIED_HZ = 333
"""Largest output rate that the sensor accepts at its default of 115200 bit/s."""

STOP_PAUSE_NS = 20_000_000
"""Pause after a stop, so that no answer is lost among readings already sent (two at 115200 bit/s)."""

_LOW_PASS = 1
_REFUSALS = {1: "not supported", 2: "value out of range", 3: "EEPROM write failure"}


class Session(SensorSession[Decoder]):
    """Stop the sensor, set rate and filter if they differ, read its name, and start it; never tare it.

    The sensor keeps its settings in an EEPROM, so the session reads them first and writes only what differs. `state` is
    "closed", "waiting", "configuring", "running", or the problem, such as "no answer to rate query" or
    "refused filter: value out of range". A sensor that refuses its rate, as it does at a baud rate that is too low, is
    started at its own rate; `health.note` names the refusal. `identity` is product name and serial number.

    Args:
        torque_divider: See `Decoder`.
        output_hz: Readings per second: 10, 20, 50, 100, 200, 333, 500 or 1000; at most 333 at 115200 bit/s.
        filter_hz: Cut-off frequency of the sensor's filter: 1, 2, 3, 5, 10, 20, 30, 40, 50, 100, 150, 200, 300, 500, or
            0 for no filter.

    Raises:
        ValueError: An option is out of range or unknown.
    """

    def __init__(self, torque_divider: float = 2000.0, output_hz: int = 333, filter_hz: int = 0) -> None:
        check_choice("output_hz", output_hz, RATES_HZ[1:])
        check_choice("filter_hz", filter_hz, FILTERS_HZ)
        self._product = ""
        self._output_hz = output_hz
        code = FILTERS_HZ.index(filter_hz)
        self._filter = bytes((_LOW_PASS if code else 0, code))
        rate = bytes((RATES_HZ.index(output_hz, 1),))
        stop = Step("stop", encode_command(STOP), "none", STOP_PAUSE_NS)
        # a setting counts only once it is confirmed, so only these two requests must be answered
        steps = [
            stop,
            _request("rate query", GET_RATE, self._compare_rate),
            _request("rate", SET_RATE, self._confirm_rate, rate, "required"),
            _request("filter query", GET_FILTER, self._compare_filter),
            _request("filter", SET_FILTER, partial(_refusal, "filter"), self._filter, "required"),
            _request("product name", PRODUCT_NAME, self._read_product),
            _request("serial number", SERIAL_NUMBER, self._read_serial),
            Step("start", encode_command(START), "none"),
        ]
        super().__init__(Decoder(torque_divider), steps, stop.request)

    def start(self, now_ns: int) -> bytes:
        """Begin on a freshly opened link; return the first request."""
        self._product = ""
        self.health.note = ""
        return super().start(now_ns)

    def _compare_rate(self, content: bytes) -> None:
        if content[0] < len(RATES_HZ) and RATES_HZ[content[0]] == self._output_hz:
            self.skip_next()

    def _confirm_rate(self, content: bytes) -> None:
        if refusal := _refusal("rate", content):
            self.health.note = f"{refusal}; it keeps its own rate, and sends at most {CARRIED_HZ} Hz at 115200 bit/s"

    def _compare_filter(self, content: bytes) -> None:
        if content[:2] == self._filter or not (content[0] or self._filter[0]):
            self.skip_next()

    def _read_product(self, content: bytes) -> None:
        self._product = parse_name(content)

    def _read_serial(self, content: bytes) -> None:
        self.identity = f"{self._product} {parse_name(content)}".strip()


def _request(
    name: str, number: int, handle: Callable[[bytes], str | None], arguments: bytes = b"", answer: str = "optional"
) -> Step:
    return Step(name, encode_command(number, arguments), answer, reply=number, handle=handle)


def _refusal(name: str, content: bytes) -> str:
    """Return why a setting was refused, "" if it was accepted."""
    error = content[1]
    return f"refused {name}: {_REFUSALS.get(error, f'code {error}')}" if error else ""


DEVICE = Device(
    "robotous",
    "wrench",
    ("serial",),
    Decoder,
    Session,
    rates_hz=(min(RATES_HZ), max(RATES_HZ)),
    baud=115_200,
    frame_bytes=RESPONSE_LENGTH,
    rate_option=RateOption("output_hz"),
    frame="a Robotous packet",
    evidence="maker",
)
