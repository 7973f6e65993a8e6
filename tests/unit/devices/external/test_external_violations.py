"""Messages from other processes that violate the format, and hostile bytes."""

from __future__ import annotations

from typing import Any

import pytest
from external_messages import IMAGE, WRENCH, decode, pack, times, wrench

from slipd.devices import external

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


@pytest.mark.parametrize("changes", WRONG, ids=str)
def test_a_message_of_another_shape_is_bad_and_its_neighbours_are_not(changes: dict[str, Any]) -> None:
    wrong = pack(WRENCH, **changes)
    samples, decoder = decode(wrench(1), wrong, wrench(2))
    assert times(samples) == [1, 2]
    assert (decoder.health.bad, decoder.health.bad_bytes) == (1, len(wrong))


@pytest.mark.parametrize(
    "values",
    [
        ...,
        [],
        [[]],
        [[1.0, 2.0]],
        [[1.0, 2.0, 3.0], 4.0],
        [1.0, [1.0, 2.0, 3.0]],
        [None],
        [1.0] * 4097,
        b"\0" * 8,
        "12",
    ],
    ids=lambda values: str(values)[:20],
)
def test_an_image_of_another_shape_is_bad(values: Any) -> None:
    samples, decoder = decode(wrench(1), pack(IMAGE, values=values), wrench(2))
    assert times(samples) == [1, 2]
    assert decoder.health.bad == 1


def test_an_image_beside_a_torque_is_bad() -> None:
    assert decode(pack(IMAGE, torque_nm=None))[0] == []


def test_D2_a_field_of_a_later_version_is_refused_and_not_skipped() -> None:
    samples, decoder = decode(pack(WRENCH, temperature_c=20.0), pack(WRENCH, v=2), pack(WRENCH, streak=1))
    assert samples == []
    assert decoder.health.bad == 1


def test_a_duplicate_field_is_bad() -> None:
    whole = pack(WRENCH)
    twice = bytes((whole[0] + 1,)) + whole[1:] + b"\xa4t_ns\x07"
    assert decode(twice)[0] == []


def test_a_message_longer_than_the_longest_is_bad_however_it_is_split() -> None:
    wrong = pack(IMAGE, values=[[1.0, 2.0, 3.0]] * 4096)
    assert len(wrong) > external.MAX_MESSAGE
    whole, halves = external.Decoder(), external.Decoder()
    found = whole.receive(wrong + wrench(1), 77)
    split = halves.receive(wrong[:40_000], 77) + halves.receive(wrong[40_000:], 77) + halves.receive(wrench(1), 77)
    assert times(found) == times(split) == [1]
    assert whole.health == halves.health


def test_T2_a_message_cut_anywhere_is_dropped_whole_and_delays_nothing() -> None:
    whole = pack(IMAGE, values=[[1.0, 2, 3.0]] * 3, seq=300, status=["hot"])
    for cut in range(1, len(whole)):
        samples, decoder = decode(whole[:cut], wrench(1), wrench(2))
        assert times(samples) == [1, 2], cut
        assert (decoder.health.bad, decoder.health.bad_bytes) == (1, cut)


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


@pytest.mark.parametrize("bomb", BOMBS, ids=lambda bomb: bomb[:12].hex())
def test_a_hostile_message_is_rejected_at_its_first_wrong_byte(bomb: bytes) -> None:
    samples, decoder = decode(bomb, wrench(1), wrench(2))
    assert times(samples) == [1, 2]
    assert decoder._scanner._tail == b""
