"""The health of the streams over a run."""

from __future__ import annotations

from typing import Any

from slipd.evaluation.streams_of_run import StreamHealth, with_status


def body(health: int, samples: int | None, bad: int) -> dict[str, Any]:
    counts = {"samples": samples, "bad": bad, "lost": 0, "dropped": None, "reconnects": 1}
    return {"streams": {"left.wrench": {"health": health, **counts}}}


def test_the_worst_health_stays_and_the_counts_are_the_last() -> None:
    found = with_status(with_status({}, body(2, None, 1)), body(0, 500, 3))
    assert found == {"left.wrench": StreamHealth("left.wrench", 2, 500, 3, 0, 0, 1)}
