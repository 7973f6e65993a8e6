"""Messages of an external driver: valid ones, and every way to be invalid."""

from __future__ import annotations

import math
import random
import struct
from collections.abc import Callable
from typing import Any

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slipd.devices.external_gripper import external_gripper_message as wire
from slipd.devices.external_gripper.external_gripper_message import Foreign, Registration, Report, read
from slipd.devices.shared.msgpack_messages import MAX_TEXT
from slipd.tools.sim.emulated_external import encode_driver_message

DRIVER = Registration("lab driver", (0.0, 0.1), (2.0, 60.0), (0.01, 0.2))
REGISTRATION: dict[str, Any] = {"v": 1, "name": "lab driver", "width_range_m": [0, 0.1], "force_range_n": [2, 60]}
REPORT: dict[str, Any] = {"v": 1, "width_m": 0.05}
NUMBERS = ("width_m", "force_n", "applied_n")
UNITS = {"width": "m", "force": "n", "speed": "mps"}
EVERYTHING = Report(0.05, False, True, "contact_opening", "no_power", -1.5, 7, 5.0, "out of range")

lengths = st.none() | st.floats(0.0, wire.MAX_WIDTH_M)
newtons = st.none() | st.floats(0.0, wire.MAX_FORCE_N)
reports = st.builds(
    Report,
    lengths,
    st.booleans(),
    st.booleans(),
    st.sampled_from(["none", "moving", "contact_opening", "contact_closing"]),
    st.sampled_from(["", "no_power"]),
    newtons,
    st.integers(1, wire.LAST_ID),
    newtons,
    st.sampled_from(["", "out of range"]),
)


def unpack(body: Any) -> Any:
    data = msgpack.packb(body)
    length, message = read(data, 0)
    assert length == (-1 if message is None else len(data))
    return message


def test_a_registration_and_a_report_are_as_documented() -> None:
    assert unpack(REGISTRATION) == Registration("lab driver", (0.0, 0.1), (2.0, 60.0))
    assert unpack(REGISTRATION | {"speed_range_mps": [0.01, 0.2]}) == DRIVER
    assert unpack(REGISTRATION | {"speed_range_mps": None}) == Registration("lab driver", (0.0, 0.1), (2.0, 60.0))
    assert unpack(REPORT) == Report(0.05)
    assert unpack({"width_m": None, "v": 1, "moving": True}) == Report(None, moving=True, object="moving")
    assert unpack({"v": 2, "name": "x"}) == Foreign(2)


@given(reports)
def test_encoded_messages_are_parsed(report: Report) -> None:
    data = encode_driver_message(report)
    assert len(data) <= wire.MAX_MESSAGE
    assert read(data, 0) == (len(data), report)
    assert read(encode_driver_message(DRIVER), 0)[1] == DRIVER


def test_every_part_of_a_message_is_incomplete_and_following_bytes_do_not_matter() -> None:
    for data in (
        encode_driver_message(EVERYTHING),
        encode_driver_message(DRIVER),
        encode_driver_message(Report(0.1, fault="f" * 100)),
        msgpack.packb(REPORT | {"id": 2**40, "force_n": -(2**40)}),
    ):
        assert [read(data[:size], 0) for size in range(1, len(data))] == [(0, None)] * (len(data) - 1)
        assert read(data + b"\xff" * 9, 0) == read(b"\x00" + data, 1) == read(data, 0)


WRONG: list[Any] = [
    {},
    {"v": 1},
    {"width_m": 0.05, "id": 1},
    REPORT | {"v": 1.0},
    REPORT | {"v": True},
    REPORT | {"widht_m": 0.1},
    REPORT | {"name": "x"},
    REGISTRATION | {"name": ""},
    REGISTRATION | {"name": "two\nlines"},
    REGISTRATION | {"name": 5},
    REGISTRATION | {"name": "x" * (MAX_TEXT + 1)},
    REGISTRATION | {"width_m": 0.1},
    {key: value for key, value in REGISTRATION.items() if key != "force_range_n"},
    REPORT | {"active": 1},
    REPORT | {"moving": None},
    REPORT | {"object": "ball"},
    REPORT | {"fault": "Two Words"},
    REPORT | {"fault": 3},
    REPORT | {"error": 3},
    REPORT | {"error": "a\x1bb"},
    REPORT | {"id": 0},
    REPORT | {"id": -1},
    REPORT | {"id": True},
    REPORT | {"id": 1.0},
    REPORT | {"id": 1 << 63},
    REPORT | {"width_m": "wide"},
    REPORT | {"width_m": True},
    REPORT | {"width_m": -0.1},
    REPORT | {"width_m": 2.1},
    REPORT | {"applied_n": -1.0},
    REPORT | {"applied_n": [1, 2]},
    REPORT | {"force_n": b"\x00"},
    REPORT | {"force_n": {"x": 1}},
    REPORT | {"force_n": [1, 2, 3]},
    REPORT | {"force_n": [[1], 2]},
    {**REPORT, **{f"k{at}": 0 for at in range(12)}},
]


RANGES = [0.1, 0.0], [0.1, 0.1], [-1, 0], [0, 1e9], [0, math.nan], [None, 1], 5, [True, 2]
WRONG += [REPORT | {"id": 1, key: value} for key in NUMBERS for value in (math.nan, math.inf, -math.inf, 1e30)]
WRONG += [REGISTRATION | {f"{key}_range_{unit}": value} for key, unit in UNITS.items() for value in RANGES]


@pytest.mark.parametrize("body", WRONG, ids=str)
def test_N1_a_message_that_is_not_as_documented_is_rejected(body: Any) -> None:
    assert unpack(body) is None


def test_text_that_is_not_utf_8_and_a_duplicate_key_are_rejected() -> None:
    data = msgpack.packb(REPORT | {"fault": "x"}).replace(b"\xa1x", b"\xa1\xff")
    assert read(data, 0) == (-1, None)
    assert read(b"\x83\xa1v\x01\xa7width_m\x00\xa7width_m\x01", 0)[0] == -1


def test_L3_a_wrong_length_is_not_waited_for() -> None:
    start = b"\x83\xa1v\x01\xa5fault\xd9"
    assert read(start + b"\xff", 0)[0] == -1
    assert read(start + b"\x78" + bytes(0x77), 0)[0] == 0
    texts = [b"\xa6object", b"\xa5fault", b"\xa5error", b"\xa4name", b"\xa6active"]
    long = b"\x8a" + b"".join(key + b"\xd9\x78" + bytes(0x78) for key in texts)
    assert read(long[: wire.MAX_MESSAGE - 1], 0)[0] == 0
    assert read(long[: wire.MAX_MESSAGE], 0)[0] == -1
    assert read(b"\x85" + long[1:], 0)[0] == -1


def test_L3_noise_is_seldom_even_a_beginning() -> None:
    noise = random.Random(3).randbytes(50_000)
    assert all(read(noise, at)[0] <= 0 for at in range(len(noise)) if 0x82 <= noise[at] <= 0x8A)


@pytest.mark.parametrize(
    ("encode", "wrong"),
    [
        *(
            (encode_driver_message, wrong)
            for wrong in (Report(math.nan), Report(0.1, object="ball"), Report(0.1, fault="x" * 200))
        ),
        (encode_driver_message, Registration("", (0.0, 0.1), (2.0, 60.0))),
        (encode_driver_message, Registration("x", (0.1, 0.0), (2.0, 60.0))),
    ],
)
def test_what_is_not_as_documented_is_not_encoded(encode: Callable[[Any], bytes], wrong: Report | Registration) -> None:
    with pytest.raises(ValueError, match="must have finite numbers"):
        encode(wrong)


def test_set_points_and_notices_are_as_documented() -> None:
    setpoint = {"width_m": 0.02, "speed_mps": None, "force_n": 10.0}
    move = wire.encode_setpoint(3, "move", **setpoint)
    assert msgpack.unpackb(move) == {"v": 1, "id": 3, "op": "move", **setpoint}
    assert msgpack.unpackb(wire.encode_setpoint(4, "stop")) == {"v": 1, "id": 4, "op": "stop"}
    assert msgpack.unpackb(wire.encode_notice(wire.REFUSED, "why")) == {"v": 1, "refused": "why"}
    assert struct.pack(">d", 0.02) in move


def test_a_key_that_is_not_text_does_not_lead_backwards() -> None:
    """As a text, its length would be negative, and its end before its beginning."""
    body = b"\x00v\x00\xa7width_m\xc0"
    assert read(b"\x82" + body + bytes(161 - 1 - len(body)), 0)[0] == -1
