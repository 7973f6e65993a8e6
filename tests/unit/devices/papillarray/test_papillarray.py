"""PTS frames: a worked frame, impossible indexes, incomplete and damaged streams; and the session."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from pillar_frames import decode, forces, frame, make, pillars, resum

from slipd.devices import papillarray
from slipd.devices.papillarray import papillarray_frames as frames
from slipd.devices.shared.sensor_session import SILENCE_NS
from slipd.tools.sim import emulated_papillarray as sim

ACCEPTED = bytes.fromhex(
    "55 66 77 88 02 01 00 17 00 03 00 23 00 04 00 81 00 05 00 BB 00 06 00 E0 00 00 00 07 00 00 00 40 E2 01 00 00 00 00 "
    "00 02 00 29 00 63 00 02 00 2F 00 49 00 02 00 00 00 80 3F 00 00 00 C0 00 00 40 40 00 00 80 3E 00 00 00 BF 00 00 40 "
    "3F 02 00 00 00 80 40 00 00 A0 40 00 00 C0 C0 00 00 A0 3F 00 00 C0 3F 00 00 E0 BF 01 00 67 00 02 00 00 00 E0 40 00 "
    "00 00 41 00 00 10 41 00 00 10 40 00 00 20 40 00 00 30 40 02 00 87 00 A1 00 02 00 00 00 A0 40 00 00 40 40 00 00 40 "
    "C0 00 00 20 41 00 00 A0 C1 00 00 F0 41 02 00 00 00 E0 40 00 00 00 41 00 00 10 41 00 00 20 42 00 00 48 42 00 00 70 "
    "42 02 00 C1 00 D5 00 02 00 C7 00 CE 00 01 00 FE 00 00 00 3F 01 00 03 00 00 40 3F 01 00 D9 00 01 00 01 00 00 80 BF "
    "02 00 E6 00 F1 00 01 00 02 00 00 20 3F 00 00 48 41 01 00 00 00 00 80 BF 00 00 80 BF 94 28 AA BB CC DD"
)
"""A frame that the maker's parser accepts, with what it reads from it below.

Parser: ``PTSDKParser`` of libPTSDK 2.0 (x86-64), langxin11/tactile_grasp_lab at 7be4d64,
``ros2_ws/src/papillarray_ros2_v2/lib/libPTSDK.a``, run on these bytes. It reads two sensors, of two pillars and one, at
123456 us; displacements (0.25, -0.5, 0.75), (1.25, 1.5, -1.75), (2.25, 2.5, 2.75) mm; total forces (5, 3, -3) and
(7, 8, 9) N, torques (10, -20, 30) and (40, 50, 60) N mm; slip detection active on the first sensor only.
"""
ACCEPTED_FORCES_N = {"0": [[1.0, -2.0, 3.0], [4.0, 5.0, -6.0]], "1": [[7.0, 8.0, 9.0]]}


def test_a_frame_that_the_makers_parser_accepts_reads_the_same() -> None:
    decoder = papillarray.Decoder()
    samples = decoder.receive(ACCEPTED, 77)
    assert {sample.source: sample.values.tolist() for sample in samples} == ACCEPTED_FORCES_N
    assert {(sample.t_ns, sample.device_time_ns, sample.status) for sample in samples} == {(77, 123_456_000, ())}
    assert (decoder.health.good, decoder.health.bad, decoder.health.bad_bytes) == (2, 0, 0)


def test_the_encoders_write_a_frame_that_the_makers_parser_accepts() -> None:
    forces_n = [np.array(pad) for pad in ACCEPTED_FORCES_N.values()]
    displaced_mm = [np.array([[0.25, -0.5, 0.75], [1.25, 1.5, -1.75]]), np.array([[2.25, 2.5, 2.75]])]
    totals = [
        sim.encode_vectors((5, 3, -3), (10, -20, 30)),
        sim.encode_vectors((7, 8, 9), (40, 50, 60)),
    ]
    states = [[struct.pack("<Hbf", 1, -2, 0.5), struct.pack("<Hbf", 1, 3, 0.75)], [struct.pack("<Hbf", 1, 1, -1)]]
    sensor_states = [struct.pack("<HBff", 1, 2, 0.625, 12.5), struct.pack("<HBff", 1, 0, -1, -1)]
    blocks = [
        sim.encode_hub(7, 123_456),
        sim.encode_pillars(forces_n, displaced_mm),
        (frames.TOTALS, totals),
        (frames.PILLAR_SLIP, states),
        (frames.SENSOR_SLIP, sensor_states),
    ]
    assert sim.encode_blocks(blocks) == ACCEPTED


@pytest.mark.parametrize("width", [2, 4])
def test_every_block_of_two_sensors_fits_into_the_longest_frame(width: int) -> None:
    whole = frame(3, width=width, sensors=2, slip=True)
    assert len(whole) <= frames.LONGEST
    samples = papillarray.Decoder().receive(whole, 0)
    assert [sample.source for sample in samples] == ["0", "1"]
    for sensor, sample in enumerate(samples):
        np.testing.assert_array_equal(sample.values, forces(3 + sensor))


def test_offsets_of_one_byte_reach_a_small_frame() -> None:
    (sample,) = papillarray.Decoder().receive(make(1, [forces(1, 1)], width=1), 0)
    assert sample.values.tolist() == forces(1, 1).tolist()


def test_an_undefined_block_is_skipped_wherever_it_stands() -> None:
    undefined = (frames.UNDEFINED, frames.END + b"whatever")
    hub, pads = sim.encode_hub(4, 4000), pillars(forces(4))
    for blocks in ([hub, undefined, pads], [hub, pads, undefined]):
        assert decode(sim.encode_blocks(blocks))[0] == [4]


def test_sensors_without_pillars_and_frames_without_forces_give_no_sample() -> None:
    decoder = papillarray.Decoder()
    none = sim.encode_blocks([sim.encode_hub(1, 1), sim.encode_totals([])])
    (sample,) = decoder.receive(
        none + sim.encode_blocks([sim.encode_hub(2, 2), pillars(np.empty((0, 3)), forces(1))]),
        0,
    )
    assert sample.source == "1"
    assert (decoder.health.bad, decoder.health.bad_bytes, decoder.health.good) == (0, 0, 1)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_force_that_is_not_finite_makes_the_image_invalid(value: float) -> None:
    pad = forces(0)
    pad[4, 2] = value
    stream = make(0, [pad, forces(1)])
    assert [sample.status for sample in papillarray.Decoder().receive(stream, 0)] == [("invalid",), ()]


HUB = sim.encode_hub(1, 1000)
PILLARS = pillars(forces(1))
ENTRY = sim.encode_vectors((1, 2, 3), (0, 0, 0))


@pytest.mark.parametrize(
    "blocks",
    [
        [PILLARS],
        [HUB, HUB],
        [HUB, PILLARS, PILLARS],
        [HUB, (frames.PILLAR_FORCES, [[ENTRY + b"\0"]])],
        [HUB, (frames.PILLAR_FORCES, [[ENTRY[:-1]]])],
        [HUB, (frames.PILLAR_FORCES, b"\0")],
        [(frames.HUB, bytes(13)), PILLARS],
        [sim.encode_hub(1, 1 << 53), PILLARS],
        [HUB, pillars(*[forces(1)] * 3)],
        [HUB, pillars(forces(1, 10))],
        [HUB, (frames.SENSOR_SLIP, [struct.pack("<BBff", 1, 0, 0, 0)]), PILLARS],
        [HUB, (frames.SENSOR_SLIP, [struct.pack("<HBff", 2, 0, 0, 0)]), PILLARS],
        [HUB, (frames.TOTALS, [b"\3\0" + ENTRY[2:]])],
        [HUB, (frames.TOTALS, b"\1\0\5\0" + ENTRY)],
        [HUB, (2, b""), PILLARS],
    ],
)
def test_a_body_that_contradicts_its_index_is_rejected(blocks: list[tuple[int, sim.Item]]) -> None:
    numbers, decoder = decode(frame(0) + sim.encode_blocks(blocks) + frame(2))
    assert numbers == [0, 2]
    assert decoder.health.bad >= 1


@pytest.mark.parametrize(
    "change",
    [
        {0: 3},
        {0: 0},
        {0: 9},
        {3: 22},
        {3: 24},
        {3: 21, 4: 0},
        {3: 1},
        {3: 0xFF, 4: 0xFF},
        {7: 34},
        {7: 0xFF, 8: 0xFF},
        {11: 0},
        {21: 1},
        {22: 1},
        {37: 6},
        {39: 98},
        {43: 46},
    ],
)
def test_an_index_with_a_wrong_offset_is_rejected(change: dict[int, int]) -> None:
    body = bytearray(ACCEPTED[4:-6])
    for at, byte in change.items():
        assert body[at] != byte or at == 4
        body[at] = byte
    assert frames.parse(resum(bytes(body)) + bytes(frames.LONGEST), 0) == (-1, None)


@pytest.mark.parametrize("offset_at", [7, 11])
def test_an_undefined_block_lies_between_its_neighbours(offset_at: int) -> None:
    body = bytearray(sim.encode_blocks([HUB, (frames.UNDEFINED, b""), PILLARS])[4:-6])
    body[offset_at] = 1
    assert frames.parse(resum(bytes(body)) + bytes(frames.LONGEST), 0) == (-1, None)


def test_D2_a_frame_with_a_block_of_a_later_version_is_refused_and_not_guessed() -> None:
    numbers, decoder = decode(frame(0) + sim.encode_blocks([sim.encode_hub(1, 1000), PILLARS, (8, b"new")]) * 3)
    assert numbers == [0]
    assert decoder.health.bad_bytes > 0


def test_an_end_marker_inside_the_data_does_not_end_the_frame() -> None:
    pad = forces(5)
    marker = np.frombuffer(frames.END * 3, "<f4").astype(np.float64)
    pad[3] = marker
    data = sim.encode_blocks([sim.encode_hub(5, 5000), pillars(pad)])
    assert frames.END in data[4:-4]
    (sample,) = papillarray.Decoder().receive(data, 0)
    np.testing.assert_array_equal(sample.values[3], marker)


def test_T2_two_frames_mixed_or_one_that_misses_a_part_are_dropped_whole() -> None:
    for cut in range(1, len(frame(1)), 3):
        numbers, _ = decode(frame(0) + frame(1)[:cut] + frame(2) + bytes(frames.LONGEST))
        assert numbers == [0, 2]


def test_D3_gaps_duplicates_and_restarts_are_distinguished() -> None:
    numbers, decoder = decode(b"".join(frame(number) for number in (900, 901, 905, 905, 904, 906, 0, 1)))
    assert numbers == [900, 901, 905, 906, 0, 1]
    health = decoder.health
    assert (health.lost, health.duplicates, health.restarts, health.good, health.bad) == (3, 2, 1, 6, 0)


def test_D3_the_counter_wraps_after_32_bits_without_a_loss_or_a_restart() -> None:
    counters = ["FE FF FF FF", "FF FF FF FF", "00 00 00 00", "02 00 00 00"]
    body = ACCEPTED[4:-6]
    stream = b"".join(resum(body[:23] + bytes.fromhex(counter) + body[27:]) for counter in counters)
    decoder = papillarray.Decoder()
    assert len(decoder.receive(stream, 0)) == 8
    assert (decoder.health.lost, decoder.health.duplicates, decoder.health.restarts) == (1, 0, 0)
    assert sim.encode_hub((1 << 33) - 2, 1)[1] == bytes.fromhex("FE FF FF FF 01 00 00 00 00 00 00 00")


def test_a_controller_runs_though_no_sensor_is_connected() -> None:
    session = papillarray.Session(rate_hz=1000)
    assert session.start(0) == b"f1000\n"
    assert session.receive(b"text", 1) == []
    assert session.state == "waiting"
    assert session.receive(sim.encode_blocks([HUB]), 10) == []
    assert (session.state, session.next_deadline()) == ("running", 10 + SILENCE_NS)
