"""The frame scanner on a simple frame: ``AB CD``, one byte of payload, and that byte inverted."""

from __future__ import annotations

import pytest

from slipd.devices.shared.device_interface import DecoderHealth
from slipd.devices.shared.frame_scanner import NO_FRAME, PAUSE_NS, FrameScanner

SYNC = b"\xab\xcd"


def frame(value: int) -> bytes:
    return SYNC + bytes((value, value ^ 0xFF))


def scanner(health: DecoderHealth, text: bytes = b"") -> FrameScanner:
    def measure(buffer: bytes, at: int) -> int:
        return 4 if buffer[at + 2] ^ buffer[at + 3] == 0xFF else NO_FRAME

    return FrameScanner(SYNC, measure, 4, health, least=4, text=text)


def scan(stream: bytes, size: int, text: bytes = b"") -> tuple[list[tuple[int, bool]], DecoderHealth]:
    """Return the values of the frames, each with whether it is in sync, and the health."""
    health = DecoderHealth()
    frames = scanner(health, text)
    values = []
    for start in range(0, len(stream), size):
        buffer, found = frames.receive(stream[start : start + size])
        values += [(buffer[at + 2], in_step) for at, in_step in found]
    return values, health


STREAMS = {
    "frames back to back are in sync": (frame(1) + frame(2) + frame(3), [(1, True), (2, True), (3, True)], 0, 0),
    "garbage counts as the frames that it stands for": (
        frame(1) + bytes(8) + frame(2) + b"\0" + frame(3),
        [(1, True), (2, False), (3, False)],
        9,
        3,
    ),
    **{
        f"{size} bytes of damage are {bad} frames": (
            frame(1) + bytes(size) + frame(2),
            [(1, True), (2, False)],
            size,
            bad,
        )
        for size, bad in ((1, 1), (4, 1), (5, 1), (6, 2), (9, 2), (10, 3))
    },
    "text between frames is no damage, but after garbage it is": (
        frame(1) + b"ok" + frame(2) + b"\0ok" + frame(3),
        [(1, True), (2, True), (3, False)],
        3,
        1,
    ),
    "a frame after a false start is kept": (SYNC + SYNC[:1] + frame(7), [(7, False)], 3, 1),
    "a payload that looks like the sync does not hide the frames": (
        frame(0xAB)[2:] + frame(0xAB) * 3,
        [(0xAB, False), (0xAB, True), (0xAB, True)],
        2,
        1,
    ),
}


@pytest.mark.parametrize("size", [1, 3, 99])
@pytest.mark.parametrize("name", STREAMS)
def test_a_stream_has_these_frames_and_this_damage(name: str, size: int) -> None:
    stream, values, bad_bytes, bad = STREAMS[name]
    assert scan(stream, size, text=b"ok") == (values, DecoderHealth(bad=bad, bad_bytes=bad_bytes))


@pytest.mark.parametrize(("late_ns", "found"), [(PAUSE_NS, 1), (PAUSE_NS + 1, 0)])
def test_the_rest_of_a_frame_after_a_pause_does_not_count(late_ns: int, found: int) -> None:
    health = DecoderHealth()
    frames = scanner(health)
    assert frames.receive(frame(1) + frame(2)[:1], 10)[1] == [(0, True)]
    assert frames.receive(frame(2)[1:3], 11)[1] == []
    assert len(frames.receive(frame(2)[3:] + frame(3), 11 + late_ns)[1]) == 1 + found
    assert health.bad_bytes == 4 - 4 * found
