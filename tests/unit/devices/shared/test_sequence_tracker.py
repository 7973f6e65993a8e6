"""Gaps, duplicates, late readings, wraps and restarts in sequences with a known truth."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slipd.devices.shared.device_interface import DecoderHealth
from slipd.devices.shared.sequence_tracker import FURTHEST_GAP, LATE_WITHIN, SHORT_GAP, SequenceTracker


def watch(span: int, *numbers: int, **options: Any) -> tuple[list[int], DecoderHealth]:
    """Return the accepted numbers, and the health."""
    health = DecoderHealth()
    tracker = SequenceTracker(span, health, **options)
    return [number for number in numbers if tracker.accept(number)], health


def counted(health: DecoderHealth) -> tuple[int, int, int]:
    return health.lost, health.duplicates, health.restarts


@given(st.sampled_from([256, 1 << 16, 1 << 32]), st.integers(-3, 3), st.integers(1, 100))
def test_D3_a_wrap_is_neither_gap_nor_restart_and_a_gap_across_it_is_a_gap(span: int, begin: int, missing: int) -> None:
    across = [number % span for number in range(span - 4 + begin, span + 4 + begin)]
    assert watch(span, *across) == (across, DecoderHealth())
    assert counted(watch(span, span - 1, missing)[1]) == (missing, 0, 0)


NUMBERS: dict[str, tuple[int, dict[str, Any], list[int], list[int], tuple[int, int, int]]] = {
    **{
        f"a number that jumps back from {newest} to {first} of {span} is a restart": (
            span,
            {"first": first},
            [newest, first, first + 1, first + 2],
            [newest, first, first + 1, first + 2],
            (0, 0, 1),
        )
        for span in (1 << 32, 1 << 64)
        for newest in (5, 33, 10**6, 3 * 10**9)
        for first in (0, 1)
    },
    **{
        f"a restart from {newest} whose first numbers were lost is no gap": (
            1 << 32,
            {},
            [newest, 7, 8],
            [newest, 7, 8],
            (0, 0, 1),
        )
        for newest in (1000, 10**6, (1 << 31) - 1, (1 << 31) + 10, 3 * 10**9)
    },
    "a late reading is dropped and the next one is not": (
        1 << 16,
        {},
        [100, 102, 101, 103, 103, 99, 104],
        [100, 102, 103, 104],
        (1, 3, 0),
    ),
    "also across the wrap": (1 << 16, {}, [65_534, 1, 65_535, 2], [65_534, 1, 2], (2, 1, 0)),
    "the latest reading": (1 << 16, {}, [100, 100 - LATE_WITHIN, 101], [100, 101], (0, 1, 0)),
    "further behind is a restart": (1 << 16, {}, [100, 99 - LATE_WITHIN], [100, 99 - LATE_WITHIN], (0, 0, 1)),
    "the longest gap to the first number": (256, {}, [256 - SHORT_GAP, 0], [256 - SHORT_GAP, 0], (SHORT_GAP - 1, 0, 0)),
    "a longer one is a restart": (256, {}, [255 - SHORT_GAP, 0], [255 - SHORT_GAP, 0], (0, 0, 1)),
    "the longest gap": (1 << 32, {}, [9, 9 + FURTHEST_GAP], [9, 9 + FURTHEST_GAP], (FURTHEST_GAP - 1, 0, 0)),
    "beyond it is a restart": (1 << 32, {}, [9, 10 + FURTHEST_GAP], [9, 10 + FURTHEST_GAP], (0, 0, 1)),
    "half of the numbers are a gap": (256, {}, [200, 72], [200, 72], (127, 0, 0)),
    "more than half of them are a restart": (256, {}, [200, 73], [200, 73], (0, 0, 1)),
    "a false number on a line that keeps order costs one reading": (
        256,
        {"in_order": True},
        [5, 21, 7, 8, 9, 10, 12],
        [5, 21, 8, 9, 10, 12],
        (16, 1, 0),
    ),
    "on another line what follows is late": (256, {}, [5, 21, 7, 8, 9], [5, 21], (15, 3, 0)),
    "a reading that is sent twice stays old on a line that keeps order": (
        256,
        {"in_order": True},
        [5, 5, 6, 6, 7, 7],
        [5, 6, 7],
        (0, 3, 0),
    ),
}


@pytest.mark.parametrize("name", NUMBERS)
def test_D3_of_these_numbers_these_are_new(name: str) -> None:
    span, options, numbers, new, counts = NUMBERS[name]
    accepted, health = watch(span, *numbers, **options)
    assert (accepted, counted(health)) == (new, counts)


@given(
    st.sampled_from([128, 256]), st.integers(0, 255), st.lists(st.integers(-3, 3), max_size=3), st.integers(-2, 2),
    st.integers(1, 12), st.lists(st.integers(-40, 40), max_size=4), st.booleans(),
)  # fmt: skip
def test_a_run_of_numbers_is_accepted_as_it_is_one_by_one(
    span: int, begin: int, before: list[int], gap: int, count: int, after: list[int], in_order: bool
) -> None:
    health, plain = DecoderHealth(), DecoderHealth()
    together, singly = (SequenceTracker(span, counts, in_order=in_order) for counts in (health, plain))
    number = begin % span
    for step in [0, *before]:
        number = (number + step) % span
        assert together.accept(number) == singly.accept(number)
    first = (begin + sum(before) + 1) % span + gap
    if together.accept_run(first, count):
        assert first + count <= span
        assert all(singly.accept(number) for number in range(first, first + count))
    for number in after:
        assert together.accept((first + number) % span) == singly.accept((first + number) % span)
    assert health == plain


def test_a_run_needs_a_newest_number_and_does_not_cross_the_wrap() -> None:
    tracker = SequenceTracker(256, DecoderHealth())
    assert (tracker.accept_run(0, 1), tracker.accept(250)) == (False, True)
    assert not tracker.accept_run(251, 6), "the last would be 0"
    assert not tracker.accept_run(252, 1)
    assert (tracker.accept_run(251, 5), tracker.accept(0)) == (True, True)


def test_a_run_forgets_an_old_number_and_after_forgetting_any_number_is_the_next() -> None:
    health = DecoderHealth()
    tracker = SequenceTracker(256, health, in_order=True)
    accepted = [tracker.accept(5), tracker.accept(3), tracker.accept_run(6, 2), tracker.accept(4)]
    assert accepted == [True, False, True, False]
    tracker.forget()
    assert (tracker.accept(200), counted(health)) == (True, (0, 2, 0))
