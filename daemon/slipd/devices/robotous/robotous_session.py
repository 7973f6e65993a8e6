"""Session with a Robotous sensor: set its rate and filter, and start its readings.

Sources of the codes: RFT Series manual, REV 1.7, p. 14, 15 and 18; the maker's ROS 2 driver, public repository
ROBOTOUS/ROS-2-Interface-for-RFT-Series-UART-Model at 057c534, ``rft_sensor_serial/src/rft_sensor_serial.cpp``, lines 28
and 29; a user of an RFT40, nsaitarun-git/Robotous_RFT40_MATLAB_Example at 85afe5a, ``main.m`` line 69. Only the header
of the sample source (Rev 1.2) numbers the filters the other way round.
"""

from __future__ import annotations

from slipd.devices.robotous import robotous_packets as packets
from slipd.devices.robotous.robotous_decoder import Decoder
from slipd.devices.shared.sensor_session import SensorSession
from slipd.devices.shared.startup_sequence import StartupSequence, Step
from slipd.types.samples import WrenchSample

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

_RATE, _GET_RATE, _FILTER, _GET_FILTER = "rate", "rate query", "filter", "filter query"
_PRODUCT, _SERIAL = "product name", "serial number"
_NUMBERS = {
    _GET_RATE: packets.GET_RATE,
    _RATE: packets.SET_RATE,
    _GET_FILTER: packets.GET_FILTER,
    _FILTER: packets.SET_FILTER,
    _PRODUCT: packets.PRODUCT_NAME,
    _SERIAL: packets.SERIAL_NUMBER,
}


class Session(SensorSession[WrenchSample]):
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

    decoder: Decoder

    def __init__(self, torque_divider: float = 2000.0, output_hz: int = 333, filter_hz: int = 0) -> None:
        for name, value, known in (("output_hz", output_hz, RATES_HZ[1:]), ("filter_hz", filter_hz, FILTERS_HZ)):
            if value not in known:
                raise ValueError(f"{name} must be one of {', '.join(map(str, known))}, got {value}")
        self._product = ""
        self._output_hz = output_hz
        code = FILTERS_HZ.index(filter_hz)
        self._filter = bytes((_LOW_PASS if code else 0, code))
        arguments = {_RATE: bytes((RATES_HZ.index(output_hz, 1),)), _FILTER: self._filter}
        requests = [
            Step(
                name,
                packets.encode_command(number, arguments.get(name, b"")),
                "required" if name in arguments else "optional",  # a setting counts only once it is confirmed
            )
            for name, number in _NUMBERS.items()
        ]
        stop = Step("stop", packets.encode_command(packets.STOP), "none", STOP_PAUSE_NS)
        start = Step("start", packets.encode_command(packets.START), "none")
        super().__init__(Decoder(torque_divider), StartupSequence([stop, *requests, start]), stop.request)

    def start(self, now_ns: int) -> bytes:
        """Begin on a freshly opened link; return the first request."""
        self._product = ""
        self.health.note = ""
        return super().start(now_ns)

    def _handle_answers(self, now_ns: int) -> None:
        for number, content in self.decoder.replies:
            if number == _NUMBERS.get(self._startup.awaited):
                self._handle_answer(number, content, now_ns)

    def _handle_answer(self, number: int, content: bytes, now_ns: int) -> None:
        refusal, skip = "", 0
        if number == packets.GET_RATE:
            skip = int(content[0] < len(RATES_HZ) and RATES_HZ[content[0]] == self._output_hz)
        elif number == packets.GET_FILTER:
            skip = int(content[:2] == self._filter or not (content[0] or self._filter[0]))
        elif number in (packets.SET_RATE, packets.SET_FILTER):
            error = content[1]
            refusal = f"refused {self._startup.awaited}: {_REFUSALS.get(error, f'code {error}')}" if error else ""
            if refusal and number == packets.SET_RATE:
                self.health.note = (
                    f"{refusal}; it keeps its own rate, and sends at most {CARRIED_HZ} Hz at 115200 bit/s"
                )
                refusal = ""
        elif number == packets.PRODUCT_NAME:
            self._product = packets.parse_name(content)
        else:
            self.identity = f"{self._product} {packets.parse_name(content)}".strip()
        self._startup.handle_answer(now_ns, refusal, skip=skip)
