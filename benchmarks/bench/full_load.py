"""Full load: two fingers, each with 1000 force readings and 200 images of 128 taxels a second, held in contact.

The daemon runs with the rates it has by default. What is asked: does it take every reading, does every message arrive,
and is it at the end as prompt as at the beginning.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from bench import processes, traffic
from bench.tables import Cell, Table

WINDOW_S = 5.0
"""The beginning and the end that are compared; at most a third of the time each."""

FINGERS = ("left", "right")


def run(folder: Path, *, seconds: float, warm_up_s: float) -> list[Table]:
    """Measure for ``seconds``."""
    streams = traffic.two_fingers(seconds + warm_up_s)
    topics = {f"{kind}.{finger}": f"{finger}.wrench" for kind in ("slip", "wrench") for finger in FINGERS}
    names = [stream.name for stream in streams]
    with processes.Lines(names) as lines, processes.daemon(folder, lines, {}) as served:
        measured = processes.measure(
            served,
            lines,
            streams,
            folder,
            topics=topics,
            subscription="",
            warm_up_s=warm_up_s,
            watched=True,
        )
        taken = processes.status(served.requests)["streams"]
    return [_streams(measured, streams, taken, seconds), _latencies(measured, seconds), _messages(measured)]


def _streams(
    measured: processes.Measured, streams: Sequence[traffic.Stream], taken: dict[str, Any], seconds: float
) -> Table:
    head = ("stream", "written", "refused", "taken", "spoilt", "lost", "bytes each", "unread p99", "unread most")
    table = Table(f"Full load: two fingers, {seconds:g} s: readings written and taken", head)
    for stream in streams:
        outcome, told = measured.outcomes[stream.name], taken[stream.name]
        table.rows.append(
            (
                stream.name,
                int(outcome["written"]),
                int(outcome["refused"]),
                int(told["samples"]),
                int(told["bad"]),
                int(told["lost"]),
                len(stream.frames[0]),
                int(outcome["unread_p99"]),
                int(outcome["unread_most"]),
            )
        )
    models = measured.heard.models
    exact = 100.0 * models.get("exact", 0) / max(1, sum(models.values()))
    late = max(outcome["late_p99_us"] for outcome in measured.outcomes.values())
    missed = sum(int(row[1]) - int(row[3]) for row in table.rows)
    table.notes += [
        f"Readings written and not taken: {missed}.",
        f"The daemon took {100 * measured.cpu_s / measured.seconds:.1f} % of a core.",
        f"{measured.heard.active} taxels of 128 in contact; {exact:.1f} % of the verdicts by the exact solver.",
        "Unread: bytes of a stream that the daemon had not read when the next reading of it was due.",
        f"The writer was late by {late:.0f} µs (p99); it writes late readings at once, one after another.",
    ]
    return table


def _latencies(measured: processes.Measured, seconds: float) -> Table:
    window_s = min(WINDOW_S, seconds / 3)
    window = round(window_s * traffic.WRENCH_HZ)
    head = ("message", "first p50 µs", "first p99 µs", "last p50 µs", "last p99 µs", "last/first p50")
    table = Table(f"Full load: the first {window_s:g} s and the last {window_s:g} s", head)
    for kind in ("slip", "wrench"):
        sides = [measured.latency_us[f"{kind}.{finger}"] for finger in FINGERS]
        row: list[Cell] = []
        for chosen in (slice(None, window), slice(-window, None)):
            both = np.concatenate([side[chosen] for side in sides])
            row += [float(q) for q in np.nanpercentile(both, (50, 99))]
        table.rows.append((kind, *row, float(row[2]) / float(row[0])))
    table.notes += ["A backlog that grows would show as a last p50 far above the first."]
    return table


def _messages(measured: processes.Measured) -> Table:
    table = Table("Full load: messages", ("topic", "messages", "gaps", "bytes each"))
    heard = measured.heard
    for topic in sorted(heard.messages):
        table.rows.append((topic, heard.messages[topic], heard.gaps[topic], heard.bytes[topic]))
    total, gaps = sum(heard.messages.values()), sum(heard.gaps.values())
    table.notes.append(f"{total} messages, {gaps} missing by their numbers; the warm-up is counted.")
    return table
