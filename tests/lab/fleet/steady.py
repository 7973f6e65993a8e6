"""Every robot publishes: how much later messages come through bridge and router, what is lost, and what it costs."""

from __future__ import annotations

import json
import os
import time
from collections import Counter
from pathlib import Path

import numpy as np
from bench.tables import Table
from fleet.network import Network, cpu_s, memory_mb

WARM_S = 5.0
LAST_S = 1.0
"""Kept apart at both ends: a message must have had the time to arrive on both ways."""

Key = tuple[str, str, int]
"""Robot, topic, number."""


def run(network: Network, folder: Path, seconds: float) -> Table:
    """Observe both ways for some seconds."""
    direct, fleet = folder / "direct.json", folder / "fleet.json"
    with network.observed("zeromq", direct), network.observed("zenoh", fleet):
        time.sleep(WARM_S)
        before = [cpu_s(child.pid) for child in (*network.bridges, network.router)]
        begin_ns = time.monotonic_ns()
        time.sleep(seconds)
        spent = [cpu_s(child.pid) - was for child, was in zip((*network.bridges, network.router), before, strict=True)]
        end_ns = time.monotonic_ns()
        memory = [memory_mb(child.pid) for child in (*network.bridges, network.router)]
        load = os.getloadavg()[0]
        time.sleep(LAST_S)
    took_s = (end_ns - begin_ns) * 1e-9
    sent, sizes, ages = arrivals(direct)
    came, *_ = arrivals(fleet)
    counted = {key for key, t_ns in sent.items() if begin_ns <= t_ns < end_ns}
    head = (
        "topic",
        "published /s",
        "through /s",
        "of warnings lost",
        "bytes",
        "direct p50 ms",
        "added p50",
        "p90",
        "p99",
        "largest",
    )
    table = Table(f"{len(network.robots)} robots, {seconds:.0f} s, load average {load:.1f}", head)
    for word in sorted({topic.partition(".")[0] for _, topic, _ in counted}):
        keys = [key for key in counted if key[1].partition(".")[0] == word]
        through = [key for key in keys if key in came]
        added = np.array([came[key] - sent[key] for key in through]) * 1e-6
        lost: str | int = len(keys) - len(through) if word == "warning" else "–"
        size = float(np.mean([sizes[key] for key in keys]))
        quantiles = [float(np.median([ages[key] for key in keys])) * 1e-6]
        quantiles += [float(np.percentile(added, share)) for share in (50, 90, 99, 100)]
        table.rows.append((word, len(keys) / took_s, len(through) / took_s, lost, size, *quantiles))
    *bridges, router = spent
    published = len(counted) / len(network.robots) / took_s
    passed = Counter(key in came for key in counted)[True] / took_s
    table.notes += [
        "Direct: from the publication to a direct subscriber of the daemon.",
        "Added: arrival through bridge and router less arrival at a direct subscriber of the daemon, both in Python. "
        "A message that its rate holds back, because no other follows, comes up to 0.2 s later by design.",
        f"A bridge takes {100 * sum(bridges) / len(bridges) / took_s:.2f} % of a core for {published:.0f} messages/s, "
        f"and {sum(memory[:-1]) / len(bridges):.0f} MB; the router {100 * router / took_s:.1f} % for {passed:.0f} "
        f"messages/s to one subscriber, and {memory[-1]:.0f} MB.",
    ]
    return table


def arrivals(file: Path) -> tuple[dict[Key, int], dict[Key, int], dict[Key, int]]:
    """Return the time of the first arrival of each message, ns, its size in bytes, and its age on arrival, ns."""
    times: dict[Key, int] = {}
    sizes: dict[Key, int] = {}
    ages: dict[Key, int] = {}
    for robot, topic, seq, size, age_ns, t_ns in json.loads(file.read_text(encoding="utf-8")):
        times.setdefault((robot, topic, seq), t_ns)
        sizes[robot, topic, seq] = size
        ages.setdefault((robot, topic, seq), age_ns)
    return times, sizes, ages
