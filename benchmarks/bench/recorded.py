"""Recording beside the live path: latency from the last byte to the message, in turns with and without ``--record``."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from bench import processes, traffic
from bench.tables import Cell, Table

HEAD = ("round", "p50", "p50 recording", "p99", "p99 recording", "p50 ratio", "p99 ratio", "CPU", "CPU recording")
SHOWN = ("slip", "wrench")


def run(folder: Path, *, rounds: int, seconds: float, warm_up_s: float) -> Table:
    """Measure ``rounds`` rounds of each kind, ``seconds`` each."""
    streams = traffic.two_fingers(seconds + warm_up_s)
    without, recording = [], []
    for number in range(rounds):
        without.append(_round(folder, streams, warm_up_s, None))
        recording.append(_round(folder, streams, warm_up_s, folder / f"recorded-{number}.mcap"))
    table = Table(f"Recording: two fingers, with and without --record, {rounds} x {seconds:g} s each, µs", HEAD)
    for number in range(rounds):
        table.rows.append(_row(str(number + 1), without[number : number + 1], recording[number : number + 1]))
    table.rows.append(_row("all", without, recording))
    size = sum(path.stat().st_size for path in folder.glob("recorded-*.mcap"))
    for path in folder.glob("recorded-*.mcap"):
        path.unlink()
    table.notes += [
        f"From just before the write of a force reading's last byte to its {' or '.join(SHOWN)} message at the default"
        " rates.",
        "CPU is user and system time of the whole process for each force reading of one finger, the writer thread"
        " included.",
        f"A recording grows by {size / rounds / (seconds + warm_up_s) / 1e6:.2f} MB/s;"
        f" {os.cpu_count()} processors share daemon, writer of the streams, and subscriber.",
    ]
    return table


def _round(folder: Path, streams: list[traffic.Stream], warm_up_s: float, record: Path | None) -> processes.Measured:
    names = [stream.name for stream in streams]
    topics = {
        f"{kind}.{finger}": f"{finger}.wrench"
        for kind in SHOWN
        for finger in sorted({name.partition(".")[0] for name in names})
    }
    with processes.Lines(names) as lines, processes.daemon(folder, lines, {}, record=record) as served:
        return processes.measure(served, lines, streams, folder, topics=topics, subscription="", warm_up_s=warm_up_s)


def _row(name: str, without: list[processes.Measured], recording: list[processes.Measured]) -> list[Cell]:
    (p50, p99), (recorded_50, recorded_99) = _percentiles_us(without), _percentiles_us(recording)
    row: list[Cell] = [name, p50, recorded_50, p99, recorded_99, recorded_50 / p50, recorded_99 / p99]
    return [*row, _cpu_us(without), _cpu_us(recording)]


def _percentiles_us(rounds: list[processes.Measured]) -> tuple[float, float]:
    found = np.concatenate([latencies for one in rounds for latencies in one.latency_us.values()])
    p50, p99 = np.nanpercentile(found, (50, 99)).tolist()
    return p50, p99


def _cpu_us(rounds: list[processes.Measured]) -> float:
    return 1e6 * sum(one.cpu_s for one in rounds) / sum(one.readings for one in rounds)
