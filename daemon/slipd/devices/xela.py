"""XELA uSkin pads through the vendor's server: JSON text over a WebSocket, three axes a taxel.

A transport hands over one message at a time, but nothing here relies on it: JSON objects delimit themselves.
Source: the messages of the vendor's server, as its public clients read them.
"""

from __future__ import annotations

import json
import re
from collections import deque
from collections.abc import Iterator, Mapping
from json import JSONDecodeError
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from slipd.devices import Device
from slipd.devices.health import DecoderHealth
from slipd.devices.numbering import FURTHEST_GAP
from slipd.samples import Array, TactileSample

MAX_MESSAGE = 1 << 15
"""Characters. A hand of 368 taxels with calibrated values fills about 16,000; what is longer is no message."""

DEEPEST = 16
"""Open braces that are kept; in a message two are open at the most."""

_AXES = 3
_KEY = '"message"'
_MESSAGE = re.compile(r"\{[ \t\r\n]*" + _KEY)
_BEFORE_A_NUMBER = "[,:- \t\r\n"
_WORDS = re.compile("[0-9A-Fa-f]{1,4}(?:,[0-9A-Fa-f]{1,4})*")
_JSON = json.JSONDecoder()
_LATEST_TIME_S = 9e9  # its nanoseconds still fit 64 bits
_LARGEST_VALUE = 1e12  # far beyond any force; also keeps out infinities, NaN and integers that no float holds
_NUMBER_SPAN = 1 << 63  # of the running number


class Decoder:
    """Makes a tactile sample of every sensor in a message; ``source`` is the sensor's key, such as "1".

    ``values`` has shape (taxels, 3): X, Y, Z per taxel, row by row from the top left. ``device_time_ns`` is the
    server's Unix time. `health.lost` counts messages missing from the server's running number, `duplicates` those that
    came again, and `restarts` numbers that jumped back or ahead by more than any gap. A sensor whose counts disagree is
    bad, and the others of the message are not.

    Whatever the server sends, each character is searched for braces once and parsed at most twice. An object is parsed
    when its brace closes, if it begins with the key "message" or stands alone. One that is not JSON discards the
    objects around it, which are not JSON either. No string that the server sends holds a brace.

    Args:
        calibrated: Take the server's calibrated forces instead of the raw 16-bit readings; a sensor for which it
            sends none is bad.
    """

    def __init__(self, calibrated: bool = False) -> None:
        self.health = DecoderHealth()
        self._calibrated = calibrated
        self._text = ""  # from the first open brace on
        self._looked = 0  # as far as braces have been looked for
        self._open: deque[int] = deque(maxlen=DEEPEST)
        self._in_garbage = False
        self._number: int | None = None

    def receive(self, data: bytes, t_ns: int) -> list[TactileSample]:
        """Take bytes received at ``t_ns`` and return the readings they complete."""
        self._text += data.decode("latin-1")  # one character a byte, so that no split can cut one; only ASCII matters
        samples: list[TactileSample] = []
        done = 0
        for at, opens in _braces(self._text, self._looked):
            self._close_older_than(at)
            if opens:
                self._open.append(at)
            elif self._open:
                begin = self._open.pop()
                message = self._object(begin, at + 1)
                if message is not None:
                    self._count_garbage(self._text[done:begin])
                    self._in_garbage = False
                    done = at + 1
                    samples += self._read(message, t_ns)
        self._close_older_than(len(self._text))
        self._keep_from(self._open[0] if self._open else len(self._text), done)
        self.health.good += len(samples)
        return samples

    def forget(self) -> None:
        """Drop a begun frame and what was expected to follow: the line was closed."""
        self._open.clear()
        self._keep_from(len(self._text), 0)
        self._number = None

    def _object(self, begin: int, end: int) -> dict[str, Any] | None:
        """Parse the object between two braces, where it can be a message; None where it is none."""
        if not _MESSAGE.match(self._text, begin) and (self._open or self._text.find(_KEY, begin, end) < 0):
            return None
        self._open.clear()
        return _parsed(self._text[begin:end])

    def _close_older_than(self, at: int) -> None:
        """Give up the braces that opened too long before ``at``."""
        while self._open and at - self._open[0] >= MAX_MESSAGE:
            self._open.popleft()

    def _keep_from(self, keep: int, done: int) -> None:
        """Drop the text before ``keep``; what no message took of it is garbage from ``done`` on."""
        self._count_garbage(self._text[done:keep])
        self._text = self._text[keep:]
        self._looked = len(self._text)
        self._open = deque((at - keep for at in self._open), DEEPEST)

    def _count_garbage(self, text: str) -> None:
        """Count what is no message; white space is not counted."""
        if not text:
            return
        garbage = sum(map(len, text.split()))
        if garbage:
            self.health.bad_bytes += garbage
            self.health.bad += not self._in_garbage
            self._in_garbage = True

    def _read(self, message: dict[str, Any], t_ns: int) -> list[TactileSample]:
        number = message.get("message")
        if isinstance(number, str):
            return []  # the server's welcome
        if type(number) is not int or not 0 <= number < _NUMBER_SPAN:
            self.health.bad += 1
            return []
        if not self._is_new(number):
            return []
        samples: list[TactileSample] = []
        for key, sensor in message.items():
            if not key.isdecimal():
                continue
            values = self._values(sensor) if isinstance(sensor, dict) else None
            if values is None:
                self.health.bad += 1
            else:
                samples.append(TactileSample(t_ns, _time_ns(sensor.get("time")), values, source=key))
        return samples

    def _is_new(self, number: int) -> bool:
        """Judge the running number; a WebSocket keeps the order, so a number that falls is a server that began anew."""
        step = 1 if self._number is None else number - self._number
        self._number = number
        self.health.duplicates += step == 0
        if not 0 <= step <= FURTHEST_GAP:
            self.health.restarts += 1
        elif step:
            self.health.lost += step - 1
        return step != 0

    def _values(self, sensor: dict[str, Any]) -> Array | None:
        numbers = _numbers(sensor.get("calibrated")) if self._calibrated else _words(sensor.get("data"))
        taxels = sensor.get("taxels")
        if not numbers or type(taxels) is not int or len(numbers) != _AXES * taxels:
            return None
        return np.array(numbers, dtype=np.float64).reshape(taxels, _AXES)


def _braces(text: str, at: int) -> Iterator[tuple[int, bool]]:
    """Yield where each brace from ``at`` on stands, and whether it opens."""
    opens, closes = text.find("{", at), text.find("}", at)
    while opens >= 0 or closes >= 0:
        if closes < 0 or 0 <= opens < closes:
            yield opens, True
            opens = text.find("{", opens + 1)
        else:
            yield closes, False
            closes = text.find("}", closes + 1)


def _parsed(text: str) -> dict[str, Any] | None:
    """Parse an object; None where it is no JSON.

    The server sends numbers such as ``.8365479``, which JSON does not have: they get their zero before a second try.
    """
    try:
        try:
            value, end = _JSON.raw_decode(text)
        except JSONDecodeError:
            for before in _BEFORE_A_NUMBER:
                text = text.replace(f"{before}.", f"{before}0.")
            value, end = _JSON.raw_decode(text)
    except (ValueError, RecursionError):  # no JSON, a number of thousands of digits, or a nest beyond measure
        return None
    return dict(value) if end == len(text) else None


def _words(data: object) -> list[int]:
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


def encode_message(
    number: int,
    sensors: Mapping[str, ArrayLike],
    time_s: float,
    calibrated: Mapping[str, ArrayLike] | None = None,
    *,
    model: str = "uSPa44",
) -> bytes:
    """Return one message as the server sends it.

    Args:
        number: The server's running number.
        sensors: Raw readings per sensor key ("1", "2", …), integers of 16 bits, shape (taxels, 3).
        time_s: Unix time, s.
        calibrated: Calibrated forces per sensor key, same shape; left out where there is none.
        model: Model name of all sensors.
    """
    message: dict[str, Any] = {"message": number, "type": "routine"}
    for key, values in sensors.items():
        raw = np.asarray(values, dtype=np.uint16).reshape(-1, _AXES)
        message[key] = {
            "sensor": key,
            "model": model,
            "taxels": len(raw),
            "time": time_s,
            "data": ",".join(f"{word:04X}" for word in raw.ravel().tolist()),
        }
        if calibrated and key in calibrated:
            forces = np.asarray(calibrated[key], dtype=np.float64)
            message[key]["calibrated"] = forces.ravel().tolist()
    return json.dumps(message, separators=(",", ":")).encode()


DEVICE = Device(
    "xela",
    "tactile",
    ("websocket",),
    Decoder,
    rates_hz=(1.0, 1000.0),
    axes=3,
    shared=True,
    frame="a message of a XELA server",
)
