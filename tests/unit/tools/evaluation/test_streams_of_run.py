"""The health of the streams over a run."""

from __future__ import annotations

from typing import Any

from slipd.tools.evaluation.streams_of_run import StreamHealth, with_status


def body(health: int, samples: int | None, bad: int) -> dict[str, Any]:
    counts = {"samples": samples, "bad": bad, "lost": 0, "dropped": None, "reconnects": 1}
    return {"streams": {"left.wrench": {"health": health, **counts}}}


def test_the_worst_health_since_the_first_reading_stays_and_the_counts_are_the_last() -> None:
    found: dict[str, StreamHealth] = {}
    for health, samples, bad in ((3, None, 0), (0, 100, 0), (2, 200, 1), (0, 500, 3)):
        found = with_status(found, body(health, samples, bad))
    assert found == {"left.wrench": StreamHealth("left.wrench", 2, 500, 3, 0, 0, 1)}


def test_a_stream_without_readings_has_its_last_health() -> None:
    found = with_status(with_status({}, body(3, None, 0)), body(2, 0, 0))
    assert found["left.wrench"].health == 2


def test_a_stream_that_was_well_from_its_first_reading_on_is_ok() -> None:
    found = with_status(with_status({}, body(3, 0, 0)), body(0, 100, 0))
    assert found["left.wrench"].health == 0
