"""A recording as frames for the live view: nothing of a change of level is lost, and each block stands by itself."""

from __future__ import annotations

import gzip
import itertools
import json
from collections.abc import Iterator
from typing import Any

import pytest

from slipd.tools.recordings.view_recording import FRAME_NS, RecordedBlocks

MS = 1_000_000
BEGIN_NS = 5_000 * MS


@pytest.fixture
def blocks() -> Iterator[RecordedBlocks]:
    blocks = RecordedBlocks()
    yield blocks
    blocks.close()


def frames(blocks: RecordedBlocks, number: int) -> list[dict[str, Any]]:
    data = blocks.block(number)
    assert data is not None
    found: list[dict[str, Any]] = json.loads(gzip.decompress(data))
    return found


def add(blocks: RecordedBlocks, topic: str, at_ms: float, **fields: Any) -> None:
    blocks.add(topic, {"t_ns": BEGIN_NS + round(at_ms * MS)} | fields)


def test_frames_are_as_far_apart_as_a_page_can_draw(blocks: RecordedBlocks) -> None:
    for at_ms in range(0, 1000, 4):
        add(blocks, "slip.left", at_ms, seq=at_ms)
    blocks.end()
    times = [frame["now_ns"] for frame in frames(blocks, 0)]
    assert len(times) == 28
    assert all(later - earlier >= FRAME_NS - 4 * MS for earlier, later in itertools.pairwise(times[:-1]))
    assert frames(blocks, 0)[-1]["topics"]["slip.left"]["seq"] == 996


def test_a_frame_has_the_newest_message_and_the_first_of_a_block_every_topic(blocks: RecordedBlocks) -> None:
    add(blocks, "status", 0, seq=1)
    add(blocks, "grasp", 0, seq=1)
    for at_ms in range(0, 2000, 10):
        add(blocks, "slip.left", at_ms, seq=at_ms)
    blocks.end()
    first, second = frames(blocks, 0), frames(blocks, 1)
    assert first[0]["topics"].keys() == second[0]["topics"].keys() == {"status", "grasp", "slip.left"}
    assert all(frame["topics"].keys() == {"slip.left"} for frame in first[1:] + second[1:])
    assert all(frame["topics"]["slip.left"]["t_ns"] == frame["now_ns"] for frame in first + second)


def test_time_never_runs_back_and_a_pause_has_no_blocks(blocks: RecordedBlocks) -> None:
    for at_ms in (0, 100, 40, 200, 3500, 3400, 3600):
        add(blocks, "slip.left", at_ms)
    blocks.end()
    times = [frame["now_ns"] for number in (0, 3) for frame in frames(blocks, number)]
    assert times == sorted(times)
    assert blocks.block(1) is blocks.block(2) is blocks.block(4) is None
    assert blocks.seconds == pytest.approx(3.6)


def test_nothing_recorded_is_nothing_shown(blocks: RecordedBlocks) -> None:
    blocks.end()
    assert (blocks.begin_ns, blocks.seconds, blocks.ended, blocks.block(0)) == (None, 0.0, True, None)
