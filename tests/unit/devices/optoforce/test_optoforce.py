"""OptoForce on its two wirings: status words, the step of the counter, a captured stream, and refusals."""

from __future__ import annotations

import pytest
from readings import Case, fields

from slipd.devices import optoforce
from slipd.devices.optoforce import optoforce_frames as frames
from slipd.devices.shared.device_interface import DecoderHealth
from slipd.devices.shared.sensor_session import RETRY_PAUSE_NS
from slipd.tools.sim import emulated_rdt as sim

ACK = bytes.fromhex("AA 00 50 01 00 00 FB")
SERIAL = frames.encode_frame(frames.SERIAL_NUMBER, b"ISE12 \0\0")


def reading(counter: int, status: int = 0) -> bytes:
    return sim.encode_reading((counter % 100, -5, 7, 1, 2, 3), counter, status)


def stream(*counters: int) -> bytes:
    return b"".join(reading(counter % 65_536) for counter in counters)


STATUS = [
    *(("sensor_1",), ("sensor_2",), ("sensor_4",), ("several_sensors",)),
    *[("overload",)] * 6,
    *(("not_detected", "invalid"), ("sensor_failure", "invalid"), ("temperature",)),
    *(("daq_error", "invalid"), ("daq_communication", "invalid"), ("daq_error", "invalid")),
    *[("unknown",)] * 16,
]
CAPTURE = bytes.fromhex(
    "AA 07 08 10 23 61 00 00 FF 05 00 26 FE 52 00 5E FC 64 00 06 05 8B AA 07 08 10 23 6B 00 00 FF 05 00 26 FE 52 00 5E"
    "FC 64 00 06 05 95 AA 07 08 10 23 75 00 00 FF 05 00 26 FE 53 00 5F FC 63 00 05 05 9F AA 07 08 10 23 7F 00 00 FF 05"
    "00 26 FE 53 00 60 FC 64 00 06 05 AC AA 01 5E 0E 00 C8 00 C8 00 C8 27 10 27 10 19 64 00 C8 05 22 AA 01 C2 0E 20 48"
    "20 1E 05 F8 2B FB 2A 44 24 64 06 78 05 B8 AA 07 08 10 23 89 00 00 FF 05 00 25 FE 53 00 5F FC 63 00 05 05 B2"
)
"""From the capture of a HEX at 100 Hz in shadow-robot/optoforce#31, without its torn frames."""
NOTE = (
    "the sensor seems to have 41.32, 41.11, 7.64 counts/N and 1126, 1082, 1433 counts/N·m: compare counts_per_n,"
    " counts_per_nm"
)
CAPTURED = {"force_n": [-251, 38, -430], "torque_nm": [94, -924, 6]}

CASES = {
    "every status bit has its words": Case(
        b"".join(reading(bit, 1 << bit) for bit in range(16)), fields("status", STATUS[:16])
    ),
    **{
        f"status bit {bit} has its words over UDP": Case(
            b"".join(sim.encode_record((1, 2, 3, 4, 5, 6), number, 1000 + number, 1 << bit) for number in range(1, 5)),
            fields("status", [STATUS[bit]] * 4),
            options={"wiring": "udp"},
        )
        for bit in range(32)
    },
    "an error without a name is invalid nevertheless": Case(
        reading(1, 3 << 10 | 7 << 13), fields("status", [("sensor_error", "invalid", "daq_error")])
    ),
    **{
        f"sensor {channel} of four is returned, with its overload alone": Case(
            sim.encode_reading((*range(9), 9, 10, 32_767), 1) + sim.encode_reading((*range(11), -32_768), 2),
            [
                {
                    "force_n": [3 * channel, 3 * channel + 1, 3 * channel + 2 if channel < 3 else rail],
                    "torque_nm": None,
                    "source": "",
                    "status": ("overload",) if channel == 3 else (),
                }
                for rail in (32_767, -32_768)
            ],
            options={"channel": channel},
        )
        for channel in range(4)
    },
    "gap, duplicate and restart are distinguished": Case(
        stream(65_534, 65_535, 0, 3, 3, 4, 5000, 0), [{}] * 7, {"lost": 2 + 4995, "duplicates": 1, "restarts": 1}
    ),
    **{
        f"losses are counted in frames where the counter rises by {step}": Case(
            stream(*(step * frame for frame in [*range(700), *range(703, 1400), 1399, *range(1400, 1410)])),
            [{}] * 1407,
            {"lost": 3, "duplicates": 1},
        )
        for step in (1, 3, 10, 33, 100)
    },
    "another rate changes the step at the cost of a reading": Case(
        stream(*range(0, 200, 10), *range(191, 300)), [{}] * 128, {"duplicates": 1, "lost": 1}
    ),
    "an untrusted counter is not used": Case(stream(10, 20, 20, 30), [{}] * 4, options={"counted": False}),
    "a captured HEX at 100 Hz loses nothing, and its scales are noted": Case(
        CAPTURE + stream(0x2389 + 30), [CAPTURED, *[{}] * 5], {"lost": 2, "note": NOTE}
    ),
    "scales as the sensor sends them are not noted": Case(
        CAPTURE, [{}] * 5, options={"counts_per_n": [41.3, -41.1, 8.3], "counts_per_nm": [1126, 1082, 1433]}
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_F2_N3_D3_a_stream_gives_these_readings_and_counts(name: str) -> None:
    CASES[name].check(optoforce.Decoder)


def test_a_new_line_forgets_the_note_and_the_nominal_loads() -> None:
    decoder = optoforce.Decoder(counted=False)
    decoder.receive(CAPTURE, 0)
    decoder.forget()
    decoder.receive(CAPTURE[-42:], 0)  # counts without the nominal loads
    assert decoder.health == DecoderHealth(good=6)


def test_a_sensitivity_report_is_unsigned() -> None:
    nominal, counts = bytes.fromhex("00C8 00C8 00C8 2710 2710 2710 00C8"), bytes.fromhex("9C40" * 7)
    assert frames.parse_report(nominal, counts) == [200.0] * 3 + [4000.0] * 3
    assert frames.parse_report(bytes(14), counts) == [0.0] * 6, "no load is stated"


def test_the_documented_requests_are_written() -> None:
    assert optoforce.Session(period_ms=10, filter_hz=15).start(0) == bytes.fromhex("AA 00 32 03 0A 04 00 00 ED")
    assert frames.encode_frame(frames.ACK, b"\0") == ACK


@pytest.mark.parametrize(
    ("body", "identity"),
    [(b"ISE12 \0\0", "S/N ISE12"), (b"\0" * 8, ""), (b"\xff12345\xff6", ""), (b"\x01\x02345678", "")],
)
def test_a_serial_number_counts_once_it_is_asked_for_and_is_text(body: bytes, identity: str) -> None:
    session = optoforce.Session()
    session.start(0)
    session.receive(SERIAL, 1)
    assert (session.state, session.identity) == ("waiting", "")
    session.receive(ACK, 2)
    assert (session.state, session.next_deadline()) == ("configuring", 2)
    assert session.on_time(2) == frames.GET_SERIAL_NUMBER
    session.receive(reading(700) + frames.encode_frame(frames.SERIAL_NUMBER, body) + reading(701), 3)
    assert (session.state, session.identity) == ("running", identity)
    session.start(5)
    session.receive(reading(3), 6)
    assert session.health == DecoderHealth(good=3), "a new link has new numbers"


def test_a_refused_configuration_is_named_and_repeated() -> None:
    session = optoforce.Session()
    configuration = session.start(0)
    session.receive(frames.encode_frame(frames.ACK, b"\x03"), 1)
    assert session.state == "refused configuration: code 3"
    assert session.on_time(1 + RETRY_PAUSE_NS) == configuration
