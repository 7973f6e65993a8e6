"""PTS frames: a worked frame, impossible indexes, incomplete and damaged streams; and the session."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pillar_frames import decode, entries, forces, frame, make, ready, resum

from slipd.devices import papillarray
from slipd.devices.papillarray import papillarray_frames as frames
from slipd.devices.papillarray.papillarray_layout import FRAMES
from slipd.devices.shared.startup_sequence import SILENCE_NS

SplitCheck = Callable[[Callable[[], Any], bytes], list[tuple[Any, ...]]]
Damage = Callable[..., Iterator[bytes]]

WORKED = bytes.fromhex(
    "55 66 77 88 02 01 00 0D 00 03 00 19 00 04 00 3B 00 07 00 00 00 40 E2 01 00 00 00 00 00 01 00 04 00 01 00 04 00 02"
    "00 00 00 80 3F 00 00 00 40 00 00 40 40 CD CC CC 3D CD CC 4C 3E 9A 99 99 3E 01 00 04 00 02 00 00 00 80 40 00 00 A0"
    "40 00 00 C0 40 CD CC CC 3E 00 00 00 3F 9A 99 19 3F 03 11 AA BB CC DD"
)
"""Computed from the field table of a public parser, with the values of its tests; not recorded from a controller.

Its sums match neither layout.
"""


def test_the_worked_frame_is_read() -> None:
    length, body = frames.parse(WORKED, 0)
    assert length == len(WORKED)
    assert body is not None
    (pad,) = body.pads
    assert (body.counter, body.time_us) == (7, 123_456)
    assert pad is not None
    assert pad.entries.tolist() == [[1.0, 2.0, 3.0, *np.float32([0.1, 0.2, 0.3]).tolist()]]
    assert pad.total_n == [4.0, 5.0, 6.0]


def test_the_worked_frame_is_written() -> None:
    total = frames.encode_array([frames.encode_vectors((4, 5, 6), (0.4, 0.5, 0.6))])
    blocks = [
        frames.encode_hub(7, 123_456),
        frames.encode_pillars([[(1, 2, 3, 0.1, 0.2, 0.3)]]),
        (frames.TOTALS, total),
    ]
    assert frames.encode_blocks(blocks, index_end=False) == WORKED


@pytest.mark.parametrize("width", [2, 4])
def test_every_block_of_two_sensors_fits_into_the_longest_frame(width: int) -> None:
    whole = frame(3, width=width, sensors=2, slip=True)
    assert len(whole) <= frames.LONGEST
    samples = ready(3).receive(whole, 0)
    assert [sample.source for sample in samples] == ["0", "1"]
    for sensor, sample in enumerate(samples):
        np.testing.assert_array_equal(sample.values, forces(3 + sensor))


def test_offsets_of_one_byte_reach_a_small_frame() -> None:
    (sample,) = ready(1).receive(make(1, [forces(1, 1)], width=1), 0)
    assert sample.values.tolist() == forces(1, 1).tolist()


def test_an_undefined_block_is_skipped_wherever_it_stands() -> None:
    undefined = (frames.UNDEFINED, frames.END + b"whatever")
    pillars = frames.encode_pillars([entries(forces(4))])
    for blocks in ([frames.encode_hub(4, 4000), undefined, pillars], [frames.encode_hub(4, 4000), pillars, undefined]):
        assert decode(frames.encode_blocks(blocks), 4)[0] == [4]


def test_sensors_without_pillars_and_frames_without_forces_give_no_sample() -> None:
    decoder = ready(1)
    none = frames.encode_blocks([frames.encode_hub(1, 1), frames.encode_totals([])])
    (sample,) = decoder.receive(
        none + frames.encode_blocks([frames.encode_hub(2, 2), frames.encode_pillars([[], entries(forces(1))])]), 0
    )
    assert sample.source == "1"
    assert (decoder.health.bad, decoder.health.bad_bytes, decoder.health.good) == (0, 0, 1)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_force_that_is_not_finite_makes_the_image_invalid(value: float) -> None:
    pad = forces(0)
    pad[4, 2] = value
    stream = make(0, [pad, forces(1)])
    assert [sample.status for sample in ready().receive(stream, 0)] == [("invalid",), ()]


HUB = frames.encode_hub(1, 1000)
PILLARS = frames.encode_pillars([entries(forces(1))])
SENSOR_SLIP = frames.encode_slip([9])[1][1]
ENTRY = frames.encode_vectors((1, 2, 3), (0, 0, 0))


@pytest.mark.parametrize(
    "blocks",
    [
        [PILLARS],
        [HUB, HUB],
        [HUB, PILLARS, PILLARS],
        [HUB, (frames.PILLAR_FORCES, PILLARS[1] + b"\0")],
        [HUB, (frames.PILLAR_FORCES, PILLARS[1][:-1])],
        [(frames.HUB, HUB[1] + b"\0"), PILLARS],
        [frames.encode_hub(1, 1 << 53), PILLARS],
        [HUB, frames.encode_pillars([entries(forces(1))] * 3)],
        [HUB, frames.encode_pillars([entries(forces(1, 10))])],
        [HUB, (frames.SENSOR_SLIP, SENSOR_SLIP + b"\0\0"), PILLARS],
        [HUB, (frames.SENSOR_SLIP, SENSOR_SLIP[:4] + b"\2" + SENSOR_SLIP[5:])],
        [HUB, (frames.TOTALS, frames.encode_array([b"\3\0" + ENTRY[2:]]))],
        [HUB, (frames.TOTALS, frames.encode_array([ENTRY])[:2] + b"\5\0\0" + ENTRY)],
        [HUB, (frames.TOTALS, b"\1\0\3\0" + ENTRY)],
        [HUB, (2, b""), PILLARS],
    ],
)
@pytest.mark.parametrize("index_end", [True, False])
def test_a_body_that_contradicts_its_index_is_rejected(blocks: list[tuple[int, bytes]], index_end: bool) -> None:
    numbers, decoder = decode(frame(0) + frames.encode_blocks(blocks, index_end=index_end) + frame(2))
    assert numbers == [0, 2]
    assert decoder.health.bad >= 1


def test_the_index_ends_with_two_zero_bytes_or_with_none() -> None:
    whole = bytearray(frame(1))
    at = whole.index(bytes(2), 4 + 1 + 3 * 4)
    for changed in (b"\1\0", b"\0\1"):
        body = whole[:at] + changed + whole[at + 2 :]
        assert frames.parse(resum(bytes(body[4:-6])), 0)[0] == -1


@pytest.mark.parametrize(
    "change",
    [
        {0: 3},
        {0: 0},
        {0: 9},
        {3: 12},
        {3: 14},
        {3: 1},
        {3: 0xFF, 4: 0xFF},
        {7: 24},
        {7: 0xFF, 8: 0xFF},
        {11: 0},
    ],
)
def test_an_index_with_a_wrong_offset_is_rejected(change: dict[int, int]) -> None:
    body = bytearray(WORKED[4:-6])
    for at, byte in change.items():
        body[at] = byte
    assert frames.parse(resum(bytes(body)) + bytes(frames.LONGEST), 0) == (-1, None)


@pytest.mark.parametrize("offset_at", [7, 11])
def test_an_undefined_block_lies_between_its_neighbours(offset_at: int) -> None:
    body = bytearray(frames.encode_blocks([HUB, (frames.UNDEFINED, b""), PILLARS])[4:-6])
    body[offset_at] = 1
    assert frames.parse(resum(bytes(body)) + bytes(frames.LONGEST), 0) == (-1, None)


def test_D2_a_frame_with_a_block_of_a_later_version_is_refused_and_not_guessed() -> None:
    numbers, decoder = decode(frame(0) + frames.encode_blocks([frames.encode_hub(1, 1000), PILLARS, (8, b"new")]) * 3)
    assert numbers == [0]
    assert decoder.health.bad_bytes > 0


def test_an_end_marker_inside_the_data_does_not_end_the_frame() -> None:
    pad = forces(5)
    marker = np.frombuffer(frames.END * 3, "<f4").astype(np.float64)
    pad[3] = marker
    data = frames.encode_blocks([frames.encode_hub(5, 5000), frames.encode_pillars([entries(pad)])])
    assert frames.END in data[4:-4]
    (sample,) = ready(5).receive(data, 0)
    np.testing.assert_array_equal(sample.values[3], marker)


def test_L1_every_split_reads_the_same(same_for_every_split: SplitCheck) -> None:
    small = [make(number, [forces(number, 1)], slip=True, type_bytes=1 + number % 2) for number in range(6)]
    stream = small[0][30:] + small[1] + small[2][:40] + small[3] + frames.START + small[4] + small[5]
    undefined = frames.encode_blocks([frames.encode_hub(6, 0), (frames.UNDEFINED, frames.END * 2)])
    assert len(same_for_every_split(ready, stream + undefined, tail=bytes(frames.LONGEST))) == 4


def test_L2_a_damaged_frame_is_dropped_and_both_neighbours_are_kept(damaged: Damage) -> None:
    before, whole, after = (frame(number, sensors=2) for number in (3, 4, 5))
    for hit in damaged(whole, 600):
        numbers, decoder = decode(before + hit + after + bytes(frames.LONGEST), 3)
        assert numbers == ([3, 3, 4, 4, 5, 5] if whole in hit else [3, 3, 5, 5]), hit.hex()
        assert decoder.health.bad >= 1


def test_T2_two_frames_mixed_or_one_that_misses_a_part_are_dropped_whole() -> None:
    for cut in range(1, len(frame(1)), 3):
        numbers, _ = decode(frame(0) + frame(1)[:cut] + frame(2) + bytes(frames.LONGEST))
        assert numbers == [0, 2]


def test_L3_noise_gives_no_sample_and_is_not_kept() -> None:
    rng = random.Random(2)
    decoder = papillarray.Decoder()
    for _ in range(100):
        noise = rng.randbytes(5000) + frames.START + rng.randbytes(20) + frames.END * 3
        assert decoder.receive(noise, 0) == []
        assert len(decoder._frames._tail) < frames.LONGEST
    assert decoder.health.bad > 100


@given(st.lists(st.one_of(st.just(frame(1)), st.just(frames.START), st.binary(max_size=60)), max_size=8))
def test_nothing_raises_and_a_frame_after_anything_is_read(parts: list[bytes]) -> None:
    assert decode(b"".join(parts) + frame(2) + bytes(frames.LONGEST))[0][-1] == 2


def test_D3_gaps_duplicates_and_restarts_are_distinguished() -> None:
    numbers, decoder = decode(b"".join(frame(number) for number in (900, 901, 905, 905, 904, 906, 0, 1)), 900)
    assert numbers == [900, 901, 905, 906, 0, 1]
    health = decoder.health
    assert (health.lost, health.duplicates, health.restarts, health.good, health.bad) == (3, 2, 1, 6, 0)


def test_the_session_sets_the_rate_and_runs_and_sets_it_again_after_silence() -> None:
    session = papillarray.Session(rate_hz=1000)
    assert (session.state, session.next_deadline(), session.identity) == ("closed", None, "")
    assert session.start(0) == b"f1000\n"
    assert session.receive(b"text", 1) == []
    assert session.state == "waiting"
    for number in range(FRAMES):
        samples = session.receive(frame(number), 10)
        assert session.state == "running"  # it sends, though its layout is unknown at first
    assert len(samples) == 1
    assert (session.state, session.next_deadline()) == ("running", 10 + SILENCE_NS)
    assert session.on_time(11) == b""
    assert session.on_time(10 + SILENCE_NS) == b"f1000\n"
    assert session.on_time(10 + 2 * SILENCE_NS) == b"f1000\n"
    assert session.state == "no answer to rate"
    assert (session.stop(), session.next_deadline(), session.state) == (b"", None, "closed")


def test_the_session_never_zeroes_the_sensors() -> None:
    session = papillarray.Session()
    written = session.start(0)
    for now_ns in range(0, 30 * SILENCE_NS, SILENCE_NS // 4):
        session.receive(frame(now_ns % 1000), now_ns)
        written += session.on_time(now_ns + 2 * SILENCE_NS)
    assert set((written + session.stop()).decode()) == set("f500\n")


def test_a_rate_that_the_controller_does_not_know_is_refused() -> None:
    with pytest.raises(ValueError, match="100, 250, 500, 1000"):
        papillarray.Session(rate_hz=200)
