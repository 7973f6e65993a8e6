"""Stalled subscribers beside live ones: a short share of ``python -m soak --only subscribers``."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from soak import subscribers
from soak.subscribers import CYCLE, LIVE


@pytest.fixture
def folder() -> Iterator[Path]:
    """A short path: that of a socket has at most 107 bytes."""
    with tempfile.TemporaryDirectory() as name:
        yield Path(name)


@pytest.mark.process
def test_Z1_live_subscribers_lose_nothing_beside_stalled_ones(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SLIPD_RUNTIME_DIR", str(folder / "run"))
    monkeypatch.setattr(subscribers, "QUICK_S", 0.5)
    monkeypatch.setattr(subscribers, "QUICK_WARM_UP_S", 0.3)
    table = subscribers.run(folder, 0.0, quick=True)
    assert [row[0] for row in table.rows] == ["none stalled", "100 stalled"] * 2
    for _, _, messages, missing, p50, p99, memory_kb, _ in table.rows:
        assert messages > LIVE * 100
        assert missing == 0
        assert 0.0 < p50 <= p99
        assert memory_kb > 0


def test_a_latency_belongs_to_the_write_that_the_message_is_about() -> None:
    written_ns = np.arange(1, 2 * CYCLE + 1, dtype=np.int64) * 1_000_000
    written_ns[CYCLE + 2] = 0  # never written
    heard = [
        (subscriber, number % CYCLE, int(written_ns[number]) + 1_000 * (subscriber + 1))
        for number in (5, 9, CYCLE - 1, CYCLE, CYCLE + 2, CYCLE + 7)
        for subscriber in range(LIVE)
    ]
    latency_us = subscribers._latency_us(written_ns, np.array(heard, np.int64), first=9)
    assert sorted(latency_us) == sorted([float(n) for n in range(1, LIVE + 1)] * 4)
