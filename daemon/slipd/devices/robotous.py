"""Robotous RFT force/torque sensors on a serial line.

Source: Robotous RFT sample source, Rev 1.2.
"""

from __future__ import annotations

import math

import numpy as np

from slipd.devices import Device
from slipd.devices import robotous_packets as packets
from slipd.devices.conversation import Conversation, Step, TalkingSession
from slipd.devices.framing import FixedFrames
from slipd.devices.health import DecoderHealth
from slipd.samples import WrenchSample

RATES_HZ = (200, 10, 20, 50, 100, 200, 300, 500, 1000)
"""Output rate of each code; code 0 is the sensor's default, and the same as code 5."""
FILTERS_HZ = (0, 1, 2, 3, 5, 10, 20, 30, 40, 50, 100, 150, 200, 300, 500)
"""Cut-off of each code of the first-order filter; 0 is no filter."""

COUNTS_PER_N = 50.0

_LOW_PASS = 1
_STOP_PAUSE_NS = 20_000_000
"""Readings already sent may still come, two at 115200 bit/s; what is asked behind them is not lost among them."""
_RAILS = frozenset((-(1 << 15), (1 << 15) - 1))
_REFUSALS = {1: "not supported", 2: "value out of range", 3: "EEPROM write failure"}

_RATE, _GET_RATE, _FILTER, _GET_FILTER = "rate", "question for the rate", "filter", "question for the filter"
_PRODUCT, _SERIAL = "product name", "serial number"
_NUMBERS = {
    _GET_RATE: packets.GET_RATE,
    _RATE: packets.SET_RATE,
    _GET_FILTER: packets.GET_FILTER,
    _FILTER: packets.SET_FILTER,
    _PRODUCT: packets.PRODUCT_NAME,
    _SERIAL: packets.SERIAL_NUMBER,
}


class Decoder:
    """Makes wrench samples of the sensor's readings.

    They carry neither number nor time: `health.lost` stays 0, and ``device_time_ns`` is None. The one status name is
    "overload": an axis is out of range, or its count at the end of it.

    Args:
        torque_divider: Counts per N·m; 2000 for most models, 1000 for the RFT60-HA01.

    Raises:
        ValueError: The divider is not positive and finite.
    """

    def __init__(self, torque_divider: float = 2000.0) -> None:
        if not (math.isfinite(torque_divider) and torque_divider >= 1):
            raise ValueError(f"torque_divider is {torque_divider}: it must be a number, 1 or more")
        self.health = DecoderHealth()
        self.replies: list[tuple[int, bytes]] = []
        """What the last bytes answered to a session: the command's number and the 15 bytes behind it."""
        self._counts_per_unit = np.repeat((COUNTS_PER_N, torque_divider), 3)
        self._frames = FixedFrames(packets.SYNC, packets.RESPONSE_LENGTH, packets.response_holds, self.health)

    def receive(self, data: bytes, t_ns: int) -> list[WrenchSample]:
        """Take bytes received at ``t_ns`` and return the readings they complete, in the sensor's frame."""
        buffer, found = self._frames.receive(data)
        samples: list[WrenchSample] = []
        self.replies = []
        for at, in_step in found:
            if buffer[at + 1] not in packets.READINGS:
                self.replies.append((buffer[at + 1], buffer[at + 2 : at + 17]))
                continue
            counts, overload, unused = packets.parse_reading(buffer, at)
            if any(unused) and not in_step:
                # A sum of 8 bits says little about noise. Out of step a reading needs the unused bytes zero as well;
                # a sensor that uses them is believed from its second reading on.
                self.health.bad += 1
                continue
            values = (np.array(counts) / self._counts_per_unit).tolist()
            well = not overload and _RAILS.isdisjoint(counts)
            samples.append(WrenchSample(t_ns, None, values[:3], values[3:], () if well else ("overload",)))
        self.health.good += len(samples)
        return samples

    def forget(self) -> None:
        """Drop a begun frame and what was expected to follow: the line was closed."""
        self._frames.forget()


class Session(TalkingSession[WrenchSample]):
    """Stops the sensor, sets its rate and filter where they differ, asks its name, and starts it; it never tares.

    Settings are kept in an EEPROM, so they are read first, and written only to change them. `state` is "closed",
    "waiting", "configuring", "running", or names what is in the way, such as "no answer to question for the rate" or
    "refused rate: value out of range". `identity` is product and serial number.

    Args:
        torque_divider: As of `Decoder`.
        output_hz: Readings a second: 10, 20, 50, 100, 200, 300, 500 or 1000; a line of 115200 bit/s carries 500.
        filter_hz: Cut-off of the sensor's filter: 1, 2, 3, 5, 10, 20, 30, 40, 50, 100, 150, 200, 300, 500, or 0 for
            none.

    Raises:
        ValueError: An option is out of range or not known.
    """

    decoder: Decoder

    def __init__(self, torque_divider: float = 2000.0, output_hz: int = 500, filter_hz: int = 0) -> None:
        for name, value, known in (("output_hz", output_hz, RATES_HZ[1:]), ("filter_hz", filter_hz, FILTERS_HZ)):
            if value not in known:
                raise ValueError(f"{name} {value} is not known: {', '.join(map(str, known))} are")
        self._product = ""
        self._output_hz = output_hz
        code = FILTERS_HZ.index(filter_hz)
        self._filter = bytes((_LOW_PASS if code else 0, code))
        arguments = {_RATE: bytes((RATES_HZ.index(output_hz, 1),)), _FILTER: self._filter}
        questions = [
            Step(name, packets.encode_command(number, arguments.get(name, b"")), _answer(name))
            for name, number in _NUMBERS.items()
        ]
        stop = Step("stop", packets.encode_command(packets.STOP), "none", _STOP_PAUSE_NS)
        start = Step("start", packets.encode_command(packets.START), "none")
        super().__init__(Decoder(torque_divider), Conversation([stop, *questions, start]), stop.request)

    def start(self, now_ns: int) -> bytes:
        """Begin on a freshly opened link."""
        self._product = ""
        return super().start(now_ns)

    def _hear(self, now_ns: int) -> None:
        for number, content in self.decoder.replies:
            if number == _NUMBERS.get(self._talk.asked):
                self._take_reply(number, content, now_ns)

    def _take_reply(self, number: int, content: bytes, now_ns: int) -> None:
        refusal, needless = "", 0
        if number == packets.GET_RATE:
            needless = int(content[0] < len(RATES_HZ) and RATES_HZ[content[0]] == self._output_hz)
        elif number == packets.GET_FILTER:
            needless = int(content[:2] == self._filter or not (content[0] or self._filter[0]))
        elif number in (packets.SET_RATE, packets.SET_FILTER):
            error = content[1]
            refusal = f"refused {self._talk.asked}: {_REFUSALS.get(error, f'code {error}')}" if error else ""
        elif number == packets.PRODUCT_NAME:
            self._product = packets.parse_name(content)
        else:
            self.identity = f"{self._product} {packets.parse_name(content)}".strip()
        self._talk.answered(now_ns, refusal, skip=needless)


def _answer(name: str) -> str:
    """Say whether the sensor must answer: a setting counts only when it is confirmed."""
    return "required" if name in (_RATE, _FILTER) else "optional"


DEVICE = Device(
    "robotous",
    "wrench",
    ("serial",),
    Decoder,
    Session,
    rates_hz=(min(RATES_HZ), max(RATES_HZ)),
    baud=115_200,
    frame_bytes=packets.RESPONSE_LENGTH,
    frame="a Robotous packet",
)
