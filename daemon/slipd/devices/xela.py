"""XELA uSkin pads through the vendor's server: JSON text over a WebSocket, three axes a taxel.

A transport hands over one message at a time, but nothing here relies on it: JSON objects delimit themselves.
Source: the messages of the vendor's server, as its public clients read them.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from json import JSONDecodeError
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from slipd.devices import Device
from slipd.devices.health import DecoderHealth
from slipd.samples import Array, TactileSample

MAX_MESSAGE = 1 << 16
"""Characters. A hand of 368 taxels with calibrated values fills about 16,000; what is longer is no message."""

_AXES = 3
_START = re.compile(r'\{(?=[ \t\r\n]*(?:"|\Z))')
_WORDS = re.compile("[0-9A-Fa-f]{1,4}(?:,[0-9A-Fa-f]{1,4})*")
_LONGEST_TOKEN = 10  # a token that the end of the text cuts is reported where it begins; "-Infinity" is the longest
_LATEST_TIME_S = 9e9  # its nanoseconds still fit 64 bits
_LARGEST_VALUE = 1e12  # far beyond any force; also keeps out infinities, NaN and integers that no float holds
_JSON = json.JSONDecoder()


class Decoder:
    """Makes a tactile sample of every sensor in a message; ``source`` is the sensor's key, such as "1".

    ``values`` has shape (taxels, 3): X, Y, Z per taxel, row by row from the top left. ``device_time_ns`` is the
    server's Unix time. `health.lost` counts messages missing from the server's running number, `duplicates` those that
    came again, and `restarts` numbers that jumped back. A sensor whose counts disagree is bad, and the others of the
    message are not.

    Args:
        calibrated: Take the server's calibrated forces instead of the raw 16-bit readings; a sensor for which it
            sends none is bad.
    """

    def __init__(self, calibrated: bool = False) -> None:
        self.health = DecoderHealth()
        self._calibrated = calibrated
        self._text = ""
        self._in_garbage = False
        self._number: int | None = None

    def receive(self, data: bytes, t_ns: int) -> list[TactileSample]:
        """Take bytes received at ``t_ns`` and return the readings they complete."""
        text = data.decode("latin-1")  # one character a byte, so that no split can cut one; only ASCII matters
        self._text += text
        if "}" not in text and self._text.startswith("{") and len(self._text) <= MAX_MESSAGE:
            return []  # the object that has begun is not complete
        samples: list[TactileSample] = []
        while (message := self._next_object()) is not None:
            samples += self._read(message, t_ns)
        self.health.good += len(samples)
        return samples

    def forget(self) -> None:
        """Drop a begun frame and what was expected to follow: the line was closed."""
        self._drop(len(self._text))
        self._number = None

    def _next_object(self) -> dict[str, Any] | None:
        """Take the next whole JSON object off the text; None when more text is needed."""
        while True:
            start = _START.search(self._text)
            self._drop(start.start() if start else len(self._text))
            if start is None:
                return None
            try:
                value, end = _JSON.raw_decode(self._text)
            except JSONDecodeError as error:
                if self._mend_leading_dot(error):
                    continue
                if _is_cut(error) and len(self._text) <= MAX_MESSAGE:
                    return None
                self._drop(1)
            except RecursionError:
                self._drop(len(self._text))
            except ValueError:  # a number of thousands of digits
                self._drop(1)
            else:
                self._text = self._text[end:]
                self._in_garbage = False
                return dict(value)

    def _mend_leading_dot(self, error: JSONDecodeError) -> bool:
        """Write a zero before a number such as ``.8365479``, which the server sends although JSON has none such."""
        at = error.pos
        if error.msg != "Expecting value":  # behind a number, as in 1.2.3, a zero mends nothing
            return False
        if self._text[at : at + 1] != "." or not self._text[at + 1 : at + 2].isdecimal():
            return False
        self._text = f"{self._text[:at]}0{self._text[at:]}"
        return True

    def _drop(self, count: int) -> None:
        """Drop what is no message; white space between messages is not counted."""
        garbage = len(self._text[:count].strip())
        self._text = self._text[count:]
        if garbage:
            self.health.bad_bytes += garbage
            self.health.bad += not self._in_garbage
            self._in_garbage = True

    def _read(self, message: dict[str, Any], t_ns: int) -> list[TactileSample]:
        number = message.get("message")
        if isinstance(number, str):
            return []  # the server's welcome
        if type(number) is not int:
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
        self.health.restarts += step < 0
        self.health.lost += max(step - 1, 0)
        return step != 0

    def _values(self, sensor: dict[str, Any]) -> Array | None:
        numbers = _numbers(sensor.get("calibrated")) if self._calibrated else _words(sensor.get("data"))
        taxels = sensor.get("taxels")
        if not numbers or type(taxels) is not int or len(numbers) != _AXES * taxels:
            return None
        return np.array(numbers, dtype=np.float64).reshape(taxels, _AXES)


def _is_cut(error: JSONDecodeError) -> bool:
    """Say whether more text may mend the error."""
    return error.msg.startswith("Unterminated string") or error.pos >= len(error.doc) - _LONGEST_TOKEN


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


DEVICE = Device("xela", "tactile", ("websocket",), Decoder, rates_hz=(1.0, 1000.0), axes=3, shared=True)
