"""Readings from other processes: their format, and what follows from one to the next."""

from __future__ import annotations

import math
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zmq
from arm_pusher import arm_message
from external_messages import IMAGE, WRENCH, decode, pack, times, wrench
from external_pusher import push

from slipd.devices import external
from slipd.devices.external import MAX_STREAMS, encode_reading
from slipd.types.samples import ArmSample, ObjectSample, TactileSample, WrenchSample


def test_a_wrench_is_read() -> None:
    (sample,), decoder = decode(pack(WRENCH))
    assert isinstance(sample, WrenchSample)
    assert sample.torque_nm is not None
    assert (sample.force_n.tolist(), sample.torque_nm.tolist()) == ([1, 2, 3], [0.1, 0.2, 0.3])
    assert (sample.t_ns, sample.device_time_ns, sample.source, sample.status) == (77, 5, "left.wrench", ())
    assert (decoder.health.good, decoder.health.bad, decoder.health.bad_bytes) == (1, 0, 0)


@pytest.mark.parametrize("torque", [None, ...])
def test_a_force_may_come_without_a_torque(torque: Any) -> None:
    (sample,), _ = decode(pack({"torque_nm": torque, "status": ["a"]}, **WRENCH | {"torque_nm": torque}))
    assert isinstance(sample, WrenchSample)
    assert (sample.torque_nm, sample.status) == (None, ("a",))


@pytest.mark.parametrize("values", [[1.5], list(range(16)), [[1.0, 2.0, 3.0]] * 20, [[1, 2.5, -70_000]], [2.0] * 4096])
def test_an_image_is_read_with_one_axis_or_three(values: Any) -> None:
    (sample,), _ = decode(pack(IMAGE, values=values))
    assert isinstance(sample, TactileSample)
    assert sample.values.tolist() == values
    assert sample.values.dtype == np.float64
    assert (sample.t_ns, sample.device_time_ns, sample.source, sample.dwell_ns) == (77, 6, "left.pad", 0)


POSE = {"xyz_m": [0.01, 0.0, 0.1], "quat_xyzw": [0.0, 0.0, 0.0, 1.0]}
SEEN = {"stream": "object", "t_ns": 7, "object_pose": POSE}
SPEED = {"object_speed_mps": 0.02, "object_speed_std_mps": 0.001}


def test_what_another_process_says_of_the_object_is_read() -> None:
    samples, decoder = decode(
        pack(SEEN, seq=1, status=["late"], **SPEED),
        pack(SEEN, object_pose={"xyz_m": [0, 1, 2]}),
        pack(SEEN, object_pose=..., **SPEED),
        pack(SEEN, object_pose=POSE | {"xyz_m": [math.nan, 0.0, 0.0]}),
    )
    assert [type(sample) for sample in samples] == [ObjectSample] * 4
    found = [
        (s.xyz_m, s.quat_xyzw, s.speed_mps, s.speed_std_mps, s.status) for s in samples if isinstance(s, ObjectSample)
    ]
    assert found[:3] == [
        ((0.01, 0.0, 0.1), (0.0, 0.0, 0.0, 1.0), 0.02, 0.001, ("late",)),
        ((0.0, 1.0, 2.0), None, None, None, ()),
        (None, None, 0.02, 0.001, ()),
    ]
    assert found[3][4] == ("invalid",)
    assert (samples[0].t_ns, samples[0].device_time_ns, samples[0].source) == (77, 7, "object")
    assert (decoder.health.good, decoder.health.bad) == (4, 0)


@pytest.mark.parametrize(
    "changes",
    [
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
    ],
)
def test_anything_else_about_an_object_is_no_message(changes: dict[str, Any]) -> None:
    samples, decoder = decode(pack(SEEN, **changes))
    assert (samples, decoder.health.good, decoder.health.bad) == ([], 0, 1)


CARRIED = {"stream": "arm", "t_ns": 7, "gravity_mps2": [0.0, 1, 9.8], "angular_velocity_radps": [0.1, 0.0, -0.2]}


def test_the_motion_of_an_arm_is_read_in_any_order_of_its_keys() -> None:
    turned = {"angular_acceleration_radps2": [1.0, 2.0, 3.0]}
    samples, decoder = decode(
        pack(turned | CARRIED, seq=1, status=["late"]),
        pack(CARRIED),
        pack(CARRIED, angular_velocity_radps=[math.nan, 0.0, 0.0]),
        encode_reading("arm", 7, **{key: value for key, value in CARRIED.items() if key.endswith(("ps", "ps2"))}),
    )
    found = [
        (s.gravity_mps2, s.angular_velocity_radps, s.angular_acceleration_radps2, s.status)
        for s in samples
        if isinstance(s, ArmSample)
    ]
    whole = ((0.0, 1.0, 9.8), (0.1, 0.0, -0.2))
    assert found[:2] == [(*whole, (1.0, 2.0, 3.0), ("late",)), (*whole, None, ())]
    assert found[2][3] == ("invalid",)
    assert found[3] == found[1]
    assert (samples[0].t_ns, samples[0].device_time_ns, samples[0].source) == (77, 7, "arm")
    assert (decoder.health.good, decoder.health.bad) == (4, 0)


@pytest.mark.parametrize(
    "changes",
    [
        {"gravity_mps2": ...},
        {"angular_velocity_radps": ...},
        {"gravity_mps2": [0.0, 9.8]},
        {"angular_acceleration_radps2": None},
        {"force_n": [0.0, 0.0, 0.0]},
    ],
)
def test_anything_else_about_an_arm_is_no_message(changes: dict[str, Any]) -> None:
    samples, decoder = decode(pack(CARRIED, **changes))
    assert (samples, decoder.health.good, decoder.health.bad) == ([], 0, 1)


def test_the_example_of_an_arm_packs_what_is_felt() -> None:
    half_turn_about_x = (1.0, 0.0, 0.0, 0.0)  # fingertips down
    (sample,), _ = decode(arm_message(7, half_turn_about_x, (0.0, 2.0, 1.0), (0.0, 0.0, 0.5)))
    assert isinstance(sample, ArmSample)
    assert sample.gravity_mps2 == pytest.approx((0.0, 2.0, 10.80665))
    assert sample.angular_velocity_radps == pytest.approx((0.0, 0.0, -0.5))


def test_the_encoder_packs_what_the_decoder_reads() -> None:
    data = encode_reading("object", 7, object_pose=POSE, object_speed_mps=0.02, object_speed_std_mps=0.001, seq=3)
    (sample,), _ = decode(data)
    assert isinstance(sample, ObjectSample)
    assert (sample.xyz_m, sample.speed_std_mps) == (tuple(POSE["xyz_m"]), 0.001)
    with pytest.raises(ValueError, match="the pose of an object"):
        encode_reading("object", 7, object_speed_mps=0.02)


def test_numbers_of_every_kind_are_read() -> None:
    numbers = [0, 127, -1, -32, 255, 65_535, 1 << 31, 1 << 63, -128, -32_768, -(1 << 31), -(1 << 63), 0.5]
    single = b"\xca" + struct.pack(">f", 0.25)
    data = pack(IMAGE, values=[*numbers, 7.0]).replace(b"\xcb" + struct.pack(">d", 7.0), single)
    (sample,), _ = decode(data)
    assert isinstance(sample, TactileSample)
    assert sample.values.tolist() == [*map(float, numbers), 0.25]


@pytest.mark.parametrize("key", [*WRENCH, "seq", "status"])
def test_the_order_of_the_fields_does_not_matter(key: str) -> None:
    fields = {**WRENCH, "seq": 3, "status": ["overload"]}
    first = {key: fields.pop(key)}
    (sample,), _ = decode(pack({**first, **fields}))
    assert (sample.source, sample.status) == ("left.wrench", ("overload",))


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("key", ["force_n", "torque_nm", "values"])
def test_a_value_that_is_not_finite_makes_the_reading_invalid(key: str, value: float) -> None:
    base = IMAGE if key == "values" else WRENCH
    assert decode(pack(base, **{key: [1.0, value, 2.0]}))[0][0].status == ("invalid",)
    assert decode(pack(base, **{key: [1.0, value, 2.0]}, status=["invalid"]))[0][0].status == ("invalid",)


def test_D3_gaps_duplicates_and_restarts_are_distinguished_for_each_stream() -> None:
    left = [encode_reading("left", number, force_n=(0, 0, 1), seq=number) for number in (700, 701, 705, 705, 704, 0, 1)]
    right = [encode_reading("right", number, force_n=(0, 0, 1), seq=number) for number in (0, 1, 2, 3, 4, 5, 6)]
    samples, decoder = decode(*(data for pair in zip(left, right, strict=True) for data in pair), wrench(5), wrench(5))
    assert [sample.device_time_ns for sample in samples if sample.source == "left"] == [700, 701, 705, 0, 1]
    assert [sample.device_time_ns for sample in samples if sample.source == "right"] == list(range(7))
    assert times(samples)[-2:] == [5, 5]
    health = decoder.health
    assert (health.lost, health.duplicates, health.restarts, health.good) == (3, 2, 1, 14)


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
        samples, decoder = decode(*(pull.recv() for _ in range(3)))
        zmq.Context.instance().term()
    assert [sample.force_n.tolist() for sample in samples if isinstance(sample, WrenchSample)] == [
        [1.0, 2.0, 0.0],
        [1.0, 2.0, 1.0],
        [1.0, 2.0, 2.0],
    ]
    assert {sample.source for sample in samples} == {"left.wrench"}
    assert (decoder.health.bad, decoder.health.lost, decoder.health.duplicates) == (0, 0, 0)
