"""The chain: one force sensor at 1 kHz, from the last byte in to the message at a subscriber, beside the C program.

Rounds of the two alternate, so that what else the machine does falls on both. Both get the same bytes from the same
writer, publish the same message, and are heard by the same subscriber.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from bench import processes, traffic
from bench.tables import Cell, Table
from numpy.typing import NDArray

TOPIC = "wrench.left"
STREAM = "left.wrench"

HEAD = ("round", "daemon p50", "daemon p99", "C p50", "C p99", "p50 ratio", "p99 ratio", "daemon CPU", "C CPU")
HEAD_ALONE = (*HEAD[:3], HEAD[7])


@dataclass
class _Side:
    """All rounds of one of the two."""

    rounds: list[processes.Measured] = field(default_factory=list)

    def latency_us(self, number: int | None = None) -> NDArray[np.float64]:
        chosen = self.rounds if number is None else [self.rounds[number]]
        return np.concatenate([one.latency_us[TOPIC] for one in chosen])

    def percentile_us(self, q: float, number: int | None = None) -> float:
        return float(np.nanpercentile(self.latency_us(number), q))

    def cpu_us(self, number: int | None = None) -> float:
        chosen = self.rounds if number is None else [self.rounds[number]]
        return 1e6 * sum(one.cpu_s for one in chosen) / sum(one.readings for one in chosen)

    def missing(self) -> int:
        return int(np.isnan(self.latency_us()).sum())

    def message(self) -> str:
        heard = self.rounds[0].heard
        return f"{heard.bytes[TOPIC]:.0f} bytes in {len(heard.keys[TOPIC])} keys"


def run(folder: Path, built: processes.FloorProgram | str, *, rounds: int, seconds: float, warm_up_s: float) -> Table:
    """Measure, ``seconds`` a round."""
    forces = traffic.grip(round((seconds + warm_up_s) * traffic.WRENCH_HZ), traffic.WRENCH_HZ)
    stream = traffic.Stream(STREAM, traffic.wrench_frames(forces, traffic.PATCH, 0), traffic.WRENCH_HZ)
    ours, theirs = _Side(), _Side()
    for _ in range(rounds):
        ours.rounds.append(_round(folder, stream, None, warm_up_s))
        if isinstance(built, processes.FloorProgram):
            theirs.rounds.append(_round(folder, stream, built, warm_up_s))
    title = f"Chain: one force sensor, {traffic.WRENCH_HZ} readings/s, {rounds} x {seconds:g} s each, µs"
    if isinstance(built, str):
        return _alone(title, ours, built)
    return _beside(title, ours, theirs)


def _round(
    folder: Path, stream: traffic.Stream, built: processes.FloorProgram | None, warm_up_s: float
) -> processes.Measured:
    rates = {"slip_hz": 1.0, "wrench_hz": traffic.EVERY_READING_HZ}
    with processes.Lines([STREAM]) as lines:
        serving = processes.daemon(folder, lines, rates) if built is None else processes.floor(folder, lines, built)
        with serving as served:
            return processes.measure(
                served,
                lines,
                [stream],
                folder,
                topics={TOPIC: STREAM},
                subscription=TOPIC,
                warm_up_s=warm_up_s,
            )


def _beside(title: str, ours: _Side, theirs: _Side) -> Table:
    numbers = [*range(len(ours.rounds)), None]
    rows: list[list[Cell]] = []
    for number in numbers:
        a50, a99 = ours.percentile_us(50, number), ours.percentile_us(99, number)
        b50, b99 = theirs.percentile_us(50, number), theirs.percentile_us(99, number)
        name = "all" if number is None else str(number + 1)
        rows.append([name, a50, a99, b50, b99, a50 / b50, a99 / b99, ours.cpu_us(number), theirs.cpu_us(number)])
    spread = [[float(row[column]) for row in rows[:-1]] for column in (5, 6)]
    table = Table(title, HEAD, list(rows), _notes(ours))
    table.notes.append(
        f"Daemon over C, least to most of the rounds: p50 {min(spread[0]):.2f} to {max(spread[0]):.2f}, "
        f"p99 {min(spread[1]):.2f} to {max(spread[1]):.2f}."
    )
    same = ours.rounds[0].heard.keys == theirs.rounds[0].heard.keys
    table.notes.append(
        f"The message: {ours.message()} from the daemon, {theirs.message()} from C, "
        f"{'the same keys' if same else 'NOT THE SAME KEYS'}."
    )
    table.notes.append(f"{_missing(ours)}; C {theirs.missing()}.")
    return table


def _alone(title: str, ours: _Side, why: str) -> Table:
    numbers = [*range(len(ours.rounds)), None]
    table = Table(title, HEAD_ALONE, notes=_notes(ours))
    for number in numbers:
        name = "all" if number is None else str(number + 1)
        table.rows.append((name, ours.percentile_us(50, number), ours.percentile_us(99, number), ours.cpu_us(number)))
    table.notes.append(f"The C program is not measured: {why}.")
    table.notes.append(f"The message: {ours.message()} from the daemon.")
    table.notes.append(f"{_missing(ours)}.")
    return table


def _notes(ours: _Side) -> list[str]:
    late = max(one.outcomes[STREAM]["late_p99_us"] for one in ours.rounds)
    return [
        "From just before the write of a reading's last byte to its message in the subscriber's hands.",
        "CPU is user and system time of the whole process for each reading; the daemon also decides on it, C does not.",
        f"The writer was late by {late:.0f} µs (p99).",
    ]


def _missing(ours: _Side) -> str:
    return f"Readings without a message (the daemon publishes one of several in one read): daemon {ours.missing()}"
