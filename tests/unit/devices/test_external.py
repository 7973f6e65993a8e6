"""Readings from other processes: every kind, every violation of the format, and what follows from one to the next."""

from __future__ import annotations

import math
import struct
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
import pytest
import zmq
from arm_pusher import arm_message
from external_pusher import push
from readings import Case, fields

from slipd.devices import external
from slipd.devices.external import MAX_STREAMS, encode_reading
from slipd.devices.shared.device_interface import DecoderHealth
from slipd.types.samples import ArmSample

WRENCH = {"stream": "left.wrench", "t_ns": 5, "force_n": [1.0, 2.0, 3.0], "torque_nm": [0.1, 0.2, 0.3]}
IMAGE = {"stream": "left.pad", "t_ns": 6, "values": [1.0, 2.0, 3.0, 4.0]}
POSE = {"xyz_m": [0.01, 0.0, 0.1], "quat_xyzw": [0.0, 0.0, 0.0, 1.0]}
SEEN = {"stream": "object", "t_ns": 7, "object_pose": POSE}
SPEED = {"object_speed_mps": 0.02, "object_speed_std_mps": 0.001}
CARRIED = {"stream": "arm", "t_ns": 7, "gravity_mps2": [0.0, 1, 9.8], "angular_velocity_radps": [0.1, 0.0, -0.2]}
TURNED = {"angular_acceleration_radps2": [1.0, 2.0, 3.0]}
FELT = {"gravity_mps2": (0.0, 1.0, 9.8), "angular_velocity_radps": (0.1, 0.0, -0.2)}


def pack(base: dict[str, Any], **changes: Any) -> bytes:
    """Return a message with changed fields; ``...`` removes a field."""
    data: bytes = msgpack.packb({key: value for key, value in {**base, **changes}.items() if value is not ...})
    return data


def wrench(number: int) -> bytes:
    return encode_reading("w", number, force_n=(number, 0, -1), torque_nm=(0, 0, 0.5))


def times(*numbers: int) -> list[dict[str, Any]]:
    return fields("device_time_ns", numbers)


def numbered(stream: str, *numbers: int) -> list[bytes]:
    return [encode_reading(stream, number, force_n=(0, 0, 1), seq=number) for number in numbers]


NUMBERS = [0, 127, -1, -32, 255, 65_535, 1 << 31, 1 << 63, -128, -32_768, -(1 << 31), -(1 << 63), 0.5]
SINGLE = pack(IMAGE, values=[*NUMBERS, 7.0]).replace(struct.pack(">Bd", 0xCB, 7.0), struct.pack(">Bf", 0xCA, 0.25))
PAIRS = zip(numbered("left", 700, 701, 705, 705, 704, 0, 1), numbered("right", *range(7)), strict=True)
CUT = pack(IMAGE, values=[[1.0, 2, 3.0]] * 3, seq=300, status=["hot"])
CASES = {
    "a wrench": Case(
        pack(WRENCH),
        [
            {
                "force_n": [1, 2, 3],
                "torque_nm": [0.1, 0.2, 0.3],
                "device_time_ns": 5,
                "source": "left.wrench",
                "status": (),
            }
        ],
    ),
    "a force without a torque": Case(
        pack(WRENCH, torque_nm=None, status=["a"]) + pack(WRENCH, torque_nm=..., status=["a"]),
        [{"torque_nm": None, "status": ("a",)}] * 2,
    ),
    "images with one axis or three": Case(
        pack(IMAGE, values=[1.5]) + pack(IMAGE, values=[[1, 2.5, -70_000]] * 20),
        [
            {"values": [1.5], "device_time_ns": 6, "source": "left.pad", "dwell_ns": 0},
            {"values": [[1, 2.5, -70_000]] * 20},
        ],
    ),
    "what another process says of the object": Case(
        pack(SEEN, seq=1, status=["late"], **SPEED)
        + pack(SEEN, object_pose={"xyz_m": [0, 1, 2]})
        + pack(SEEN, object_pose=..., **SPEED)
        + pack(SEEN, object_pose=POSE | {"xyz_m": [math.nan, 0.0, 0.0]})
        + pack(SEEN, object_pose=..., object_speed_mps=3.0, object_speed_std_mps=1e-300)
        + encode_reading("object", 7, object_pose=POSE, **SPEED, seq=2),
        [
            {
                "xyz_m": (0.01, 0.0, 0.1),
                "quat_xyzw": (0.0, 0.0, 0.0, 1.0),
                "speed_mps": 0.02,
                "speed_std_mps": 0.001,
                "status": ("late",),
                "device_time_ns": 7,
                "source": "object",
            },
            {"xyz_m": (0.0, 1.0, 2.0), "quat_xyzw": None, "speed_mps": None, "speed_std_mps": None, "status": ()},
            {"xyz_m": None, "quat_xyzw": None, "speed_mps": 0.02, "speed_std_mps": 0.001},
            *[{"status": ("invalid",)}] * 2,
            {"xyz_m": (0.01, 0.0, 0.1), "speed_mps": 0.02, "speed_std_mps": 0.001},
        ],
    ),
    "the motion of an arm, in any order of its keys": Case(
        pack(TURNED | CARRIED, seq=1, status=["late"])
        + pack(CARRIED)
        + pack(CARRIED, angular_velocity_radps=[math.nan, 0.0, 0.0])
        + encode_reading("arm", 7, **{key: value for key, value in CARRIED.items() if key.endswith(("ps", "ps2"))}),
        [
            FELT
            | {
                "angular_acceleration_radps2": (1.0, 2.0, 3.0),
                "status": ("late",),
                "device_time_ns": 7,
                "source": "arm",
            },
            FELT | {"angular_acceleration_radps2": None, "status": ()},
            {"status": ("invalid",)},
            FELT | {"angular_acceleration_radps2": None, "status": ()},
        ],
    ),
    "numbers of every kind": Case(SINGLE, fields("values", [[*NUMBERS, 0.25]])),
    **{
        f"fields in another order, first {key}": Case(
            pack({key: value} | WRENCH | {"seq": 3, "status": ["overload"]}),
            [{"source": "left.wrench", "status": ("overload",)}],
        )
        for key, value in {**WRENCH, "seq": 3, "status": ["overload"]}.items()
    },
    **{
        f"a {key} of {value} makes the reading invalid": Case(
            pack(base, **{key: [1.0, value, 2.0]}) + pack(base, **{key: [1.0, value, 2.0]}, status=["invalid"]),
            fields("status", [("invalid",)] * 2),
        )
        for base, key in ((WRENCH, "force_n"), (WRENCH, "torque_nm"), (IMAGE, "values"))
        for value in (math.nan, math.inf, -math.inf)
    },
    "gaps, duplicates and restarts of each stream": Case(
        b"".join(data for pair in PAIRS for data in pair) + wrench(5) + wrench(5),
        times(700, 0, 701, 1, 705, 2, 3, 4, 0, 5, 1, 6, 5, 5),
        {"lost": 3, "duplicates": 2, "restarts": 1},
    ),
    **{
        f"a message cut after byte {cut}": Case(
            CUT[:cut] + wrench(1) + wrench(2), times(1, 2), {"bad": 1, "bad_bytes": cut}
        )
        for cut in range(1, len(CUT))
    },
}


@pytest.mark.parametrize("name", CASES)
def test_D3_N3_T2_a_stream_gives_these_readings_and_counts(name: str) -> None:
    CASES[name].check(external.Decoder)


WRONG: list[dict[str, Any]] = [
    {"stream": ...},
    {"stream": ""},
    {"stream": "x" * 65},
    {"stream": "left wrench"},
    {"stream": "l\u00e9"},
    {"stream": 5},
    {"stream": b"left"},
    {"t_ns": ...},
    {"t_ns": -1},
    {"t_ns": 1.5},
    {"t_ns": 1 << 63},
    {"t_ns": None},
    {"force_n": ...},
    {"force_n": None},
    {"force_n": [1.0, 2.0]},
    {"force_n": [1.0, 2.0, 3.0, 4.0]},
    {"force_n": [1.0, "2", 3.0]},
    {"force_n": [1.0, None, 3.0]},
    {"force_n": [[1.0], 2.0, 3.0]},
    {"force_n": {"x": 1}},
    {"force_n": True},
    {"torque_nm": [1.0]},
    {"torque_nm": 1.0},
    {"values": [1.0]},
    {"seq": -1},
    {"seq": 1.0},
    {"seq": None},
    {"status": "overload"},
    {"status": ["Overload"]},
    {"status": [""]},
    {"status": ["x" * 33]},
    {"status": ["x"] * 9},
    {"status": [1]},
    {"status": ["a\nb"]},
]
WRONG_VALUES: list[Any] = [
    ..., [], [[]], [[1.0, 2.0]], [[1.0, 2.0, 3.0], 4.0], [1.0, [1.0, 2.0, 3.0]], [None], [1.0] * 4097, b"\0" * 8, "12",
]  # fmt: skip
WRONG_OBJECT: list[dict[str, Any]] = [
    {"object_pose": {}},
    {"object_pose": {"quat_xyzw": [0.0, 0.0, 0.0, 1.0]}},
    {"object_pose": {"xyz_m": [0.0, 0.0]}},
    {"object_pose": {"xyz_m": [0.0, 0.0, 0.0], "quat_xyzw": [0.0, 0.0, 1.0]}},
    {"object_pose": {"xyz_m": [0.0, 0.0, 0.0], "quat_xyzw": [0.0, 0.0, 0.0, 2.0]}},
    {"object_pose": {"xyz_m": [0.0, 0.0, 0.0], "frame": "camera"}},
    {"object_pose": [0.0, 0.0, 0.0]},
    {"object_pose": {"xyz_m": ["a", 0.0, 0.0]}},
    {"object_speed_mps": 0.02},
    {"object_pose": ..., "object_speed_std_mps": 0.02},
    {"object_speed_mps": 0.02, "object_speed_std_mps": 0.0},
    {"object_speed_mps": "fast", "object_speed_std_mps": 0.1},
    {"force_n": [0.0, 0.0, 0.0]},
    {"values": [0.0]},
    {"torque_nm": [0.0, 0.0, 0.0]},
    {"object_pose": ...},
]
WRONG_ARM: list[dict[str, Any]] = [
    {"gravity_mps2": ...},
    {"angular_velocity_radps": ...},
    {"gravity_mps2": [0.0, 9.8]},
    {"angular_acceleration_radps2": None},
    {"force_n": [0.0, 0.0, 0.0]},
]
LATER = {"temperature_c": 20.0}, {"v": 2}, {"streak": 1}
TWICE = bytes((pack(WRENCH)[0] + 1,)) + pack(WRENCH)[1:] + b"\xa4t_ns\x07"


BOMBS = [
    b"\x91" * 60_000,
    b"\xdd\xff\xff\xff\xff" * 10_000,
    b"\xdf\xff\xff\xff\xff",
    b"\xdb\xff\xff\xff\xff",
    b"\xc7\xff\x01" * 1000,
    b"\x83\xa6stream\xdb\xff\xff\xff\xff",
    b"\x83\xa6values\xdd\xff\xff\xff\xff",
    b"\x83\xa6values\xdc\xff\xff" + b"\xc0" * 100,
    b"\x83\xa6values" + b"\x91" * 60_000,
    b"\x86" * 60_000,
]
"""What would cost much memory or time, were it not rejected at its first wrong byte."""


@pytest.mark.parametrize(
    "wrong",
    [
        *(pack(WRENCH, **changes) for changes in WRONG),
        *(pack(IMAGE, values=values) for values in WRONG_VALUES),
        *(pack(SEEN, **changes) for changes in WRONG_OBJECT),
        *(pack(CARRIED, **changes) for changes in WRONG_ARM),
        *(pack(WRENCH, **changes) for changes in LATER),
        pack(IMAGE, torque_nm=None),
        TWICE,
        *BOMBS,
    ],
    ids=lambda wrong: str(wrong[:60]),
)
def test_D2_L3_a_message_of_another_shape_is_bad_and_its_neighbours_are_not(wrong: bytes) -> None:
    decoder = external.Decoder()
    samples = decoder.receive(wrench(1) + wrong + wrench(2), 0)
    assert [sample.device_time_ns for sample in samples] == [1, 2]
    assert decoder.health == DecoderHealth(good=2, bad=1, bad_bytes=len(wrong))


def test_the_example_of_an_arm_packs_what_is_felt() -> None:
    half_turn_about_x = (1.0, 0.0, 0.0, 0.0)  # fingertips down
    told = arm_message(7, half_turn_about_x, (0.0, 2.0, 1.0), (0.0, 0.0, 0.5))
    (sample,) = external.Decoder().receive(told, 0)
    assert isinstance(sample, ArmSample)
    assert sample.gravity_mps2 == pytest.approx((0.0, 2.0, 10.80665))
    assert sample.angular_velocity_radps == pytest.approx((0.0, 0.0, -0.5))


@pytest.mark.parametrize("cut", [1 << 20, 40_000, 20_000])
def test_the_largest_image_is_read_and_a_longer_message_is_bad_however_they_are_split(cut: int) -> None:
    long = pack(IMAGE, values=[[1.0, 2.0, 3.0]] * 4096)
    stream = long + pack(IMAGE, values=[2.0] * 4096)
    decoder = external.Decoder()
    samples = [*decoder.receive(stream[:cut], 77), *decoder.receive(stream[cut:], 77)]
    assert [sample.values.tolist() for sample in samples] == [[2.0] * 4096]
    assert (decoder.health.bad, decoder.health.bad_bytes) == (1, len(long))


def test_invented_names_fill_no_memory() -> None:
    decoder = external.Decoder()
    for number in range(200):
        decoder.receive(encode_reading(f"s{number}", 1, force_n=(0, 0, 1), seq=1), 0)
    assert len(decoder._sequences) == MAX_STREAMS
    assert (decoder.health.good, decoder.health.bad) == (64, 136)


@pytest.mark.parametrize(
    "reading",
    [
        {},
        {"force_n": (1, 2, 3), "values": (1, 2)},
        {"force_n": (1, 2)},
        {"torque_nm": (1, 2, 3)},
        {"values": np.ones((4, 2))},
        {"values": np.ones(4097)},
        {"values": ()},
        {"force_n": (1, 2, 3), "seq": -1},
        {"force_n": (1, 2, 3), "seq": 1 << 64},
        {"force_n": (1, 2, 3), "status": ["Bad"]},
    ],
    ids=str,
)
def test_an_invalid_reading_is_not_encoded(reading: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="a reading must have"):
        encode_reading("left.wrench", 5, **reading)


class Unplugged(Exception):  # noqa: N818
    """The sensor of the documented program has no more readings."""


def test_the_documented_sender_is_understood(tmp_path: Path) -> None:
    endpoint = f"ipc://{tmp_path}/pushed"
    readings = iter([([1.0, 2.0, float(number)], [0.0, 0.0, 0.1]) for number in range(3)])

    def read_my_sensor() -> tuple[list[float], list[float]]:
        for reading in readings:
            return reading
        raise Unplugged

    with zmq.Context() as context, context.socket(zmq.PULL) as pull:
        pull.bind(endpoint)
        pull.rcvtimeo = 10_000
        with pytest.raises(Unplugged):
            push(endpoint, read_my_sensor)
        sent = b"".join(pull.recv() for _ in range(3))
        zmq.Context.instance().term()
    Case(sent, [{"force_n": [1, 2, number], "source": "left.wrench"} for number in range(3)]).check(external.Decoder)
