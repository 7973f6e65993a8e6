"""PTS frames: one that the maker's parser accepts, impossible indexes, every kind of block; and the session."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
import pytest
from readings import Case, fields

from slipd.devices import papillarray
from slipd.devices.shared.sensor_session import SILENCE_NS
from slipd.tools.sim import emulated_pads as sim

DISPLACED_MM = 0.125
"""Displacement of every pillar along each axis; it cannot be mistaken for a force."""


def forces(number: int, pillars: int = 9) -> np.ndarray:
    drawn = 3.0 + np.random.default_rng(number % 1000).normal(size=(pillars, 3))
    return drawn.astype(np.float32).astype(np.float64)


def pillars(*pads: np.ndarray) -> tuple[int, sim.Item]:
    """Return the block of the forces on the pillars of each sensor, N."""
    return sim.encode_pillars(pads, [np.full_like(pad, DISPLACED_MM) for pad in pads])


def frame(number: int, *pads: np.ndarray, width: int = 2, slip: bool = False) -> bytes:
    """Return a frame with these forces, by default those of its number on one sensor."""
    pads = pads or (forces(number),)
    totals = sim.encode_totals([pad.sum(axis=0) for pad in pads])
    blocks = [sim.encode_hub(number, 1000 * number), pillars(*pads), totals]
    return sim.encode_blocks(blocks + (sim.encode_slip([len(pad) for pad in pads]) if slip else []), width)


def resum(body: bytes) -> bytes:
    """Return a frame with the body and its sum."""
    return papillarray.START + body + (sum(body) & 0xFFFF).to_bytes(2, "little") + papillarray.END


def images(*numbers: int) -> list[dict[str, Any]]:
    return [{"values": forces(n), "source": "0", "device_time_ns": 1_000_000 * n, "status": ()} for n in numbers]


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


HUB = sim.encode_hub(1, 1000)
PILLARS = pillars(forces(1))
ENTRY = sim.encode_vectors((1, 2, 3), (0, 0, 0))
MARKER = np.where(np.arange(9)[:, None] == 3, np.frombuffer(papillarray.END * 3, "<f4").astype(np.float64), forces(5))
WILD = [np.where(np.arange(27).reshape(9, 3) == 14, value, forces(0)) for value in (np.nan, np.inf)]
COUNTERS = ("FE FF FF FF", "FF FF FF FF", "00 00 00 00", "02 00 00 00")
CASES = {
    "a frame that the maker's parser accepts": Case(
        ACCEPTED,
        [
            {"source": source, "values": values, "device_time_ns": 123_456_000, "status": ()}
            for source, values in ACCEPTED_FORCES_N.items()
        ],
    ),
    **{
        f"every block of two sensors fits into the longest frame, with offsets of {width} bytes": Case(
            frame(3, forces(3), forces(4), width=width, slip=True),
            [{"source": "0", "values": forces(3)}, {"source": "1", "values": forces(4)}],
        )
        for width in (2, 4)
    },
    "offsets of one byte reach a small frame": Case(frame(1, forces(1, 1), width=1), fields("values", [forces(1, 1)])),
    **{
        f"an undefined block is skipped as number {at}": Case(
            sim.encode_blocks([sim.encode_hub(4, 4000), *blocks]), images(4)
        )
        for at, blocks in enumerate(
            (
                [(papillarray.UNDEFINED, papillarray.END + b"whatever"), pillars(forces(4))],
                [pillars(forces(4)), (papillarray.UNDEFINED, papillarray.END + b"whatever")],
            )
        )
    },
    "sensors without pillars and frames without forces give no image": Case(
        sim.encode_blocks([HUB, sim.encode_totals([])])
        + sim.encode_blocks([sim.encode_hub(2, 2), pillars(np.empty((0, 3)), forces(1))]),
        fields("source", ["1"]),
    ),
    "a force that is not finite makes its image invalid": Case(
        frame(0, WILD[0], forces(1)) + frame(1, forces(1), WILD[1]),
        fields("status", [("invalid",), (), (), ("invalid",)]),
    ),
    "an end marker inside the data does not end the frame": Case(frame(5, MARKER), fields("values", [MARKER])),
    "gaps, duplicates and restarts are distinguished": Case(
        b"".join(frame(number) for number in (900, 901, 905, 905, 904, 906, 0, 1)),
        images(900, 901, 905, 906, 0, 1),
        {"lost": 3, "duplicates": 2, "restarts": 1},
    ),
    "the counter wraps after 32 bits without a loss or a restart": Case(
        b"".join(resum(ACCEPTED[4:27] + bytes.fromhex(counter) + ACCEPTED[31:-6]) for counter in COUNTERS),
        [{}] * 8,
        {"lost": 1},
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_D3_N3_a_stream_gives_these_images_and_counts(name: str) -> None:
    CASES[name].check(papillarray.Decoder)


def test_the_encoders_write_a_frame_that_the_makers_parser_accepts() -> None:
    forces_n = [np.array(pad) for pad in ACCEPTED_FORCES_N.values()]
    displaced_mm = [np.array([[0.25, -0.5, 0.75], [1.25, 1.5, -1.75]]), np.array([[2.25, 2.5, 2.75]])]
    totals = [sim.encode_vectors((5, 3, -3), (10, -20, 30)), sim.encode_vectors((7, 8, 9), (40, 50, 60))]
    states = [[struct.pack("<Hbf", 1, *one) for one in pad] for pad in (((-2, 0.5), (3, 0.75)), ((1, -1),))]
    sensor_states = [struct.pack("<HBff", 1, *one) for one in ((2, 0.625, 12.5), (0, -1, -1))]
    blocks = [
        sim.encode_hub(7, 123_456),
        sim.encode_pillars(forces_n, displaced_mm),
        (papillarray.TOTALS, totals),
        (papillarray.PILLAR_SLIP, states),
        (papillarray.SENSOR_SLIP, sensor_states),
    ]
    assert sim.encode_blocks(blocks) == ACCEPTED


LATER = [HUB, PILLARS, (8, b"new")]
CONTRADICTIONS: list[list[tuple[int, sim.Item]]] = [
    [PILLARS],
    [HUB, HUB],
    [HUB, PILLARS, PILLARS],
    [HUB, (papillarray.PILLAR_FORCES, [[ENTRY + b"\0"]])],
    [HUB, (papillarray.PILLAR_FORCES, [[ENTRY[:-1]]])],
    [HUB, (papillarray.PILLAR_FORCES, b"\0")],
    [(papillarray.HUB, bytes(13)), PILLARS],
    [sim.encode_hub(1, 1 << 53), PILLARS],
    [HUB, pillars(*[forces(1)] * 3)],
    [HUB, pillars(forces(1, 10))],
    [HUB, (papillarray.SENSOR_SLIP, [struct.pack("<BBff", 1, 0, 0, 0)]), PILLARS],
    [HUB, (papillarray.SENSOR_SLIP, [struct.pack("<HBff", 2, 0, 0, 0)]), PILLARS],
    [HUB, (papillarray.TOTALS, [b"\3\0" + ENTRY[2:]])],
    [HUB, (papillarray.TOTALS, b"\1\0\5\0" + ENTRY)],
    [HUB, (2, b""), PILLARS],
    LATER,
]
UNDEFINED = sim.encode_blocks([HUB, (papillarray.UNDEFINED, b""), PILLARS])
WRONG_OFFSETS: list[dict[int, int]] = [
    {0: 3}, {0: 0}, {0: 9}, {3: 22}, {3: 24}, {3: 21, 4: 0}, {3: 1}, {3: 0xFF, 4: 0xFF}, {7: 34}, {7: 0xFF, 8: 0xFF},
    {11: 0}, {21: 1}, {22: 1}, {37: 6}, {39: 98}, {43: 46},
]  # fmt: skip


@pytest.mark.parametrize("blocks", CONTRADICTIONS)
def test_D2_a_body_that_contradicts_its_index_is_rejected(blocks: list[tuple[int, sim.Item]]) -> None:
    decoder = papillarray.Decoder()
    samples = decoder.receive(frame(0) + sim.encode_blocks(blocks) + frame(2), 0)
    assert [sample.values.tolist() for sample in samples] == [forces(0).tolist(), forces(2).tolist()]
    assert decoder.health.bad >= 1


@pytest.mark.parametrize(
    ("whole", "change"), [*((ACCEPTED, change) for change in WRONG_OFFSETS), (UNDEFINED, {7: 1}), (UNDEFINED, {11: 1})]
)
def test_an_index_with_a_wrong_offset_is_rejected(whole: bytes, change: dict[int, int]) -> None:
    body = bytearray(whole[4:-6])
    for at, byte in change.items():
        body[at] = byte
    assert body != whole[4:-6]
    assert papillarray.measure(resum(bytes(body)) + bytes(papillarray.LONGEST), 0) == -1


def test_an_unfinished_frame_is_awaited_up_to_the_longest_or_the_next_and_no_frame_is_longer() -> None:
    begun = sim.encode_blocks([HUB, (papillarray.UNDEFINED, b"\1")])[:-6]
    sizes = len(begun), papillarray.LONGEST - 1, papillarray.LONGEST
    assert [papillarray.measure(b"\0" + begun.ljust(size, b"\1"), 1) for size in sizes] == [0, 0, -1]
    assert papillarray.measure(begun + papillarray.END + papillarray.START, 0) == -1
    fits, beyond = (
        sim.encode_blocks([HUB, (papillarray.UNDEFINED, bytes(papillarray.LONGEST - 40 + more))]) for more in (0, 40)
    )
    assert [papillarray.measure(whole, 0) for whole in (fits, beyond)] == [len(fits), -1]


def test_T2_two_frames_mixed_or_one_that_misses_a_part_are_dropped_whole() -> None:
    for cut in range(1, len(frame(1)), 3):
        samples = papillarray.Decoder().receive(frame(0) + frame(1)[:cut] + frame(2) + bytes(papillarray.LONGEST), 0)
        assert [sample.device_time_ns for sample in samples] == [0, 2_000_000]


def test_a_controller_runs_though_no_sensor_is_connected() -> None:
    session = papillarray.Session(rate_hz=1000)
    assert session.start(0) == b"f1000\n"
    assert session.receive(b"text", 1) == []
    assert session.state == "waiting"
    assert session.receive(sim.encode_blocks([HUB]), 10) == []
    assert (session.state, session.next_deadline()) == ("running", 10 + SILENCE_NS)
