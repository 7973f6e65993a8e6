"""Which of two layouts a PapillArray sends is decided by its sums alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pillar_frames import LAYOUTS, entries, forces, frame, make, ready

from slipd.devices import papillarray
from slipd.devices.papillarray import papillarray_frames as frames
from slipd.devices.papillarray import papillarray_layout
from slipd.devices.papillarray.papillarray_layout import FORCE_FIRST, FRAMES


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("index_end", [True, False])
@pytest.mark.parametrize("type_bytes", [1, 2])
@pytest.mark.parametrize("sensors", [1, 2])
def test_the_stream_shows_its_layout(layout: int, index_end: bool, type_bytes: int, sensors: int) -> None:
    decoder = papillarray.Decoder()
    kind: dict[str, Any] = {"slip": True, "layout": layout, "index_end": index_end, "type_bytes": type_bytes}
    for number in range(FRAMES - 1):
        assert decoder.receive(frame(number, **kind), 0) == []
        assert decoder.health.note == papillarray_layout.UNDECIDED
    samples = decoder.receive(frame(FRAMES, sensors=sensors, **kind), 77)
    assert [sample.source for sample in samples] == ["0", "1"][:sensors]
    for sensor, sample in enumerate(samples):
        np.testing.assert_array_equal(sample.values, forces(FRAMES + sensor))
        assert (sample.t_ns, sample.device_time_ns, sample.status) == (77, 1_000_000 * FRAMES, ())
    assert decoder.health.note == f"pillars hold {papillarray_layout.NAMES[layout]}"
    assert (decoder.health.bad, decoder.health.bad_bytes) == (0, 0)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_layout_is_undecided_without_a_load_and_kept_after_one(layout: int) -> None:
    rng = np.random.default_rng(3)

    def unloaded(number: int) -> bytes:
        return make(number, [rng.normal(scale=0.005, size=(9, 3))] * 2, layout=layout)

    decoder = papillarray.Decoder()
    for number in range(1000):
        assert decoder.receive(unloaded(number), 0) == []
    assert decoder.health.note == papillarray_layout.UNDECIDED
    for number in range(1000, 1000 + FRAMES):  # the other sensor stays free
        samples = decoder.receive(make(number, [np.zeros((9, 3)), forces(number)], layout=layout), 0)
    assert len(samples) == 2
    np.testing.assert_array_equal(samples[1].values, forces(number))
    assert len(decoder.receive(unloaded(number + 1), 0)) == 2


def test_inconclusive_frames_do_not_interrupt_conclusive_ones() -> None:
    decoder = papillarray.Decoder()
    for number in range(2 * FRAMES):
        samples = decoder.receive(make(number, [forces(number) if number % 2 else np.zeros((9, 3))]), 0)
    assert len(samples) == 1


def test_if_neither_layout_matches_every_reading_is_rejected() -> None:
    decoder = papillarray.Decoder()
    for number in range(20):
        assert decoder.receive(frame(number, totals=[np.array((4.0, 5.0, 6.0))]), 0) == []
    assert decoder.health.note == papillarray_layout.NEITHER
    assert decoder.receive(frame(30), 0) == []  # one frame that matches is chance
    for number in range(31, 31 + FRAMES):
        samples = decoder.receive(frame(number), 0)
    assert len(samples) == 1


def test_a_frame_that_contradicts_the_layout_is_dropped_and_many_change_the_layout() -> None:
    decoder = ready(100)
    assert decoder.receive(frame(100, layout=FORCE_FIRST), 0) == []
    assert (decoder.health.bad, len(decoder.receive(frame(101), 0))) == (1, 1)
    for number in range(102, 102 + FRAMES):
        assert decoder.receive(frame(number, totals=[np.zeros(3)]), 0) == []
    assert decoder.health.note == papillarray_layout.NEITHER
    assert decoder.receive(frame(110), 0) == []


def test_displacements_that_add_up_as_the_forces_do_decide_nothing() -> None:
    decoder = papillarray.Decoder()
    both = np.column_stack((forces(1), forces(1)))
    for number in range(20):
        blocks = [frames.encode_hub(number, number), frames.encode_pillars([both])]
        blocks.append(frames.encode_totals([forces(1).sum(axis=0)]))
        assert decoder.receive(frames.encode_blocks(blocks), 0) == []
    assert decoder.health.note == papillarray_layout.UNDECIDED


def test_frames_without_the_whole_force_decide_nothing() -> None:
    decoder = papillarray.Decoder()
    for number in range(20):
        blocks = [frames.encode_hub(number, number), frames.encode_pillars([entries(forces(1))] * 2)]
        if number % 2:
            blocks.append(frames.encode_totals([forces(1).sum(axis=0)]))  # from one sensor: it may belong to either
        assert decoder.receive(frames.encode_blocks(blocks), 0) == []
    assert decoder.health.note == papillarray_layout.UNDECIDED


def test_a_reconnected_controller_must_show_its_layout_again() -> None:
    decoder = ready()
    decoder.forget()
    assert decoder.health.note == ""
    assert decoder.receive(frame(1), 0) == []
    assert decoder.health.note == papillarray_layout.UNDECIDED
