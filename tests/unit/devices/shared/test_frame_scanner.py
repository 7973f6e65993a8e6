"""The frame scanner on a simple frame: ``AB CD``, one byte of payload, and that byte inverted."""

from __future__ import annotations

import random

import pytest

from slipd.devices.shared.device_interface import DecoderHealth
from slipd.devices.shared.frame_scanner import PAUSE_NS, FixedLengthScanner

SYNC = b"\xab\xcd"


def frame(value: int) -> bytes:
    return SYNC + bytes((value, value ^ 0xFF))


def holds(buffer: bytes, at: int) -> bool:
    return buffer[at + 2] ^ buffer[at + 3] == 0xFF


def scan(stream: bytes, size: int, text: bytes = b"") -> tuple[list[tuple[int, bool]], DecoderHealth]:
    health = DecoderHealth()
    frames = FixedLengthScanner(SYNC, 4, holds, health, text=text)
    values = []
    for start in range(0, len(stream), size):
        buffer, found = frames.receive(stream[start : start + size])
        values += [(buffer[at + 2], in_step) for at, in_step in found]
    return values, health


def test_frames_back_to_back_are_found_in_sync() -> None:
    values, health = scan(frame(1) + frame(2) + frame(3), 12)
    assert values == [(1, True), (2, True), (3, True)]
    assert health == DecoderHealth()


def test_garbage_counts_as_bytes_and_as_the_frames_it_stands_for() -> None:
    values, health = scan(frame(1) + bytes(8) + frame(2) + b"\0" + frame(3), 99)
    assert values == [(1, True), (2, False), (3, False)]
    assert (health.bad_bytes, health.bad) == (9, 3)


@pytest.mark.parametrize(("garbage", "bad"), [(1, 1), (4, 1), (5, 1), (6, 2), (9, 2), (10, 3)])
def test_damage_is_rounded_to_whole_frames(garbage: int, bad: int) -> None:
    _, health = scan(frame(1) + bytes(garbage) + frame(2), 3)
    assert (health.bad_bytes, health.bad) == (garbage, bad)


def test_text_between_frames_is_not_damage_but_text_after_garbage_is() -> None:
    values, health = scan(frame(1) + b"ok" + frame(2) + b"\0ok" + frame(3), 99, text=b"ok")
    assert values == [(1, True), (2, True), (3, False)]
    assert (health.bad_bytes, health.bad) == (3, 1)


def test_a_frame_after_a_false_start_is_kept() -> None:
    values, health = scan(SYNC + SYNC[:1] + frame(7), 99)
    assert values == [(7, False)]
    assert health.bad_bytes == 3


def test_a_payload_that_looks_like_the_sync_does_not_hide_the_frames() -> None:
    values, _ = scan(frame(0xAB)[2:] + frame(0xAB) * 3, 99)
    assert [value for value, _ in values] == [0xAB] * 3


@pytest.mark.parametrize("size", [1, 2, 3, 5, 1000])
def test_every_split_finds_the_same_frames_and_counts_the_same(size: int) -> None:
    rng = random.Random(1)
    parts = [frame(rng.randrange(256)) if rng.random() < 0.6 else rng.randbytes(3) + SYNC for _ in range(300)]
    stream = b"".join(parts)
    assert scan(stream, size, b"ok") == scan(stream, len(stream), b"ok")


@pytest.mark.parametrize(("late_ns", "found"), [(PAUSE_NS, 1), (PAUSE_NS + 1, 0)])
def test_the_rest_of_a_frame_after_a_pause_does_not_count(late_ns: int, found: int) -> None:
    health = DecoderHealth()
    frames = FixedLengthScanner(SYNC, 4, holds, health)
    assert frames.receive(frame(1) + frame(2)[:1], 10)[1] == [(0, True)]
    assert frames.receive(frame(2)[1:3], 11)[1] == []
    assert len(frames.receive(frame(2)[3:] + frame(3), 11 + late_ns)[1]) == 1 + found
    assert health.bad_bytes == 4 - 4 * found


@pytest.mark.parametrize("junk", [b"\xab", b"\xab\xcd", b"\xab\xcd\x01", b"\x00"])
def test_endless_garbage_is_not_kept(junk: bytes) -> None:
    frames = FixedLengthScanner(SYNC, 4, holds, DecoderHealth())
    for _ in range(1000):
        frames.receive(junk * 100)
        assert len(frames._tail) < 4
