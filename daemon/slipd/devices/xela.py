"""XELA uSkin pads through the vendor's server: JSON text over a WebSocket, three axes a taxel.

A message is a JSON object whose members are at most objects without objects, and no string of it contains a brace. So
the braces delimit it, and the decoder does not need the transport to deliver messages one by one.

Sources: the maker's ROS node, mcsix/xela_server_ros at 21c2970, ``scripts/xela_service``, ``message_parser`` (version
1.7.6): ``time``, ``sensor``, ``model``, ``taxels``, ``data`` as hexadecimal words, ``calibrated``. Version 1.7.7:
omron-sinicx/xela_server_ros at f978386, ``notes/websocket-data-structure.md``: ``data`` is a list of integers, three a
taxel; calibrated values are newtons; every message carries ``type`` and ``version`` too; ``special`` is twelve numbers
a taxel (its raw values first), ``temp`` and ``ups`` one each, a temperature and an update rate in Hz (both ignored).
One real pad gave 1225 counts/N along Z and about 1650 along X and Y.
"""

from __future__ import annotations

import json
import re
from json import JSONDecodeError
from typing import Any

import numpy as np

from slipd.devices import Device
from slipd.devices.shared.frame_scanner import NO_FRAME, FrameDecoder, MessageScanner
from slipd.devices.shared.sequence_tracker import SequenceTracker
from slipd.types.arrays import Array
from slipd.types.samples import TactileSample

MAX_MESSAGE = 1 << 17
"""Longest message, bytes; a hand of 368 taxels with all fields of version 1.7.7 fills 54,053."""

MOST_FAULTS = 4
"""Sensors whose faults are named at a time."""

NO_TAXELS = (
    "sensor {}: {} of {} taxels are zero on all axes: does the model in the server's xServ.ini have more than the pad?"
)
REPEATED = "sensor {}: the server repeats its last values and time: does the pad have power, and is its CAN bus up?"

AXES = 3
_BEGIN = re.compile(rb"\{")
_OBJECT = re.compile(rb"\{[^{}]*+(?:\{[^{}]*+\}[^{}]*+)*+(?:(?P<end>\})|(?:\{[^{}]*+)?\Z)")
"""An object that contains objects without objects, or all that is received of it."""
_BARE_POINT = re.compile(r"(?<=[\s\[,:-])\.")
_WORDS = re.compile("[0-9A-Fa-f]{1,4}(?:,[0-9A-Fa-f]{1,4})*")
_LATEST_TIME_S = 9e9  # its nanoseconds still fit 64 bits
_LARGEST_VALUE = 1e12  # far beyond any force; also keeps out infinities, NaN and integers that no float holds
_NUMBER_SPAN = 1 << 63  # limit of the sequence number


class Decoder(FrameDecoder):
    """Return a tactile sample of every sensor in a message; ``source`` is the sensor's key, such as "1".

    ``values`` has shape (taxels, 3): X, Y, Z per taxel, row by row from the top left. ``device_time_ns`` is the
    server's Unix time. `health.lost` counts messages missing from the server's sequence numbers, `duplicates` repeated
    ones, and `restarts` numbers that jumped back, or ahead by more than the longest gap. A sensor whose number of
    values is wrong, or of which at least half of the taxels are raw zeros, is bad; the other sensors of the message are
    not. `health.warning` names the sensors whose values and time are those of the message before: the server goes on
    without its pads, and the images count as stuck.

    Args:
        calibrated: Whether to use the server's calibrated forces instead of the raw 16-bit readings; a sensor without
            them is then bad.
    """

    _frames: MessageScanner[dict[str, Any]]

    def __init__(self, calibrated: bool = False) -> None:
        super().__init__()
        self._calibrated = calibrated
        self._frames = MessageScanner(_BEGIN, _read, self.health, text=b" \t\r\n")
        # a WebSocket keeps the order, so a falling number is a restart of the server
        self._sequence = SequenceTracker(_NUMBER_SPAN, self.health, late_within=0)
        self._newest: dict[str, tuple[object, object]] = {}  # time and values of each sensor, as sent

    def _readings(self, data: bytes, t_ns: int) -> list[TactileSample]:
        return [sample for message in self._frames.messages(data) for sample in self._decode(message, t_ns)]

    def forget(self) -> None:
        """Drop a partial message and the expected sequence numbers, because the line was closed."""
        super().forget()
        self._sequence.forget()
        self._newest.clear()

    def _decode(self, message: dict[str, Any], t_ns: int) -> list[TactileSample]:
        number = message.get("message")
        if isinstance(number, str):
            return []  # the server's welcome
        if type(number) is not int or not 0 <= number < _NUMBER_SPAN:
            self.health.bad += 1
            return []
        if not self._sequence.accept(number):
            return []
        samples: list[TactileSample] = []
        newest: dict[str, tuple[object, object]] = {}
        absent: list[str] = []
        repeated: list[str] = []
        for key, sensor in message.items():
            if not key.isdecimal():
                continue
            values = self._values(sensor) if isinstance(sensor, dict) else None
            if values is None:
                self.health.bad += 1
                continue
            newest[key] = sent = sensor.get("time"), sensor.get("calibrated" if self._calibrated else "data")
            if zeros := self._lacks_taxels(values):
                self.health.bad += 1
                absent.append(NO_TAXELS.format(key, zeros, len(values)))
                continue
            if sent[0] is not None and sent == self._newest.get(key):
                repeated.append(REPEATED.format(key))
            samples.append(TactileSample(t_ns, _time_ns(sensor.get("time")), values, source=key))
        self._newest = newest
        self.health.note, self.health.warning = "; ".join(absent[:MOST_FAULTS]), "; ".join(repeated[:MOST_FAULTS])
        return samples

    def _lacks_taxels(self, values: Array) -> int:
        """Return how many taxels are raw zeros where at least half of them are, which no pad measures; otherwise 0."""
        zeros = 0 if self._calibrated else int((values == 0.0).all(axis=1).sum())
        return zeros if 2 * zeros >= len(values) else 0

    def _values(self, sensor: dict[str, Any]) -> Array | None:
        numbers = _numbers(sensor.get("calibrated")) if self._calibrated else _words(sensor.get("data"))
        taxels = sensor.get("taxels")
        if not numbers or type(taxels) is not int or len(numbers) != AXES * taxels:
            return None
        return np.array(numbers, dtype=np.float64).reshape(taxels, AXES)


def _read(buffer: bytes, at: int) -> tuple[int, dict[str, Any] | None]:
    """Return length and content of the message at ``at``, for `MessageScanner`."""
    found = _OBJECT.match(buffer, at)
    if found is None or len(found[0]) > MAX_MESSAGE:
        return NO_FRAME, None
    if not found["end"]:
        return 0, None
    message = _parse(found[0])
    return NO_FRAME if message is None else len(found[0]), message


def _parse(data: bytes) -> dict[str, Any] | None:
    """Parse an object; return None if it is not JSON or not a message.

    The server sends numbers such as ``.8365479``, which are not JSON: a zero is added before a second attempt.
    """
    if b'"message"' not in data:
        return None
    text = data.decode("latin-1")  # one character per byte; only ASCII matters
    try:
        try:
            value = json.loads(text)
        except JSONDecodeError:
            value = json.loads(_BARE_POINT.sub("0.", text))
    except (ValueError, RecursionError):  # not JSON, a number of thousands of digits, or deep nesting
        return None
    return dict(value)


def _words(data: object) -> list[int]:
    if isinstance(data, list):
        return data if all(type(word) is int and 0 <= word < 1 << 16 for word in data) else []
    if not isinstance(data, str) or not _WORDS.fullmatch(data):
        return []
    return [int(word, 16) for word in data.split(",")]


def _numbers(data: object) -> list[float]:
    if not isinstance(data, list):
        return []
    if not all(type(number) in (int, float) and abs(number) < _LARGEST_VALUE for number in data):
        return []
    return data


def _time_ns(time_s: object) -> int | None:
    if isinstance(time_s, int | float) and 0 <= time_s < _LATEST_TIME_S:
        whole_s, part_s = divmod(time_s, 1)
        return int(whole_s) * 1_000_000_000 + round(part_s * 1e9)
    return None


DEVICE = Device(
    "xela",
    "tactile",
    ("websocket",),
    Decoder,
    rates_hz=(1.0, 1000.0),
    axes=3,
    shared=True,
    frame="a message of a XELA server",
    evidence="driver",
)
