"""Stamps the arrival of every message, over ZeroMQ or over Zenoh, in a process of its own.

    python -m fleet.observer zeromq|zenoh FILE ENDPOINT [ENDPOINT …]

The endpoints are those of the robots, by their numbers, or that of the router. Prints ``observing``. After SIGTERM it
writes robot, topic, number, size in bytes, age and time of each message (CLOCK_MONOTONIC, ns), in the order of arrival.
"""

from __future__ import annotations

import json
import queue
import signal
import sys
import time
from pathlib import Path
from typing import Any

import msgpack
import zenoh
import zmq
from zenoh.ext import HistoryConfig, RecoveryConfig, declare_advanced_subscriber

from slipd_client.fleet.fleet_keys import split_key
from slipd_client.fleet.zenoh_session import Reach, configuration, opened
from slipd_client.messages import WARNING_TOPIC

WAKE_MS = 100
"""How often silence is interrupted to see whether to end."""

Arrival = tuple[str, str, bytes, int]
"""Robot, topic, payload, and time."""


def over_zeromq(endpoints: list[str], ended: list[int]) -> list[Arrival]:
    """Subscribe to everything of every robot."""
    found: list[Arrival] = []
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    poller = zmq.Poller()
    names: dict[Any, str] = {}
    for number, endpoint in enumerate(endpoints):
        socket = context.socket(zmq.SUB)
        socket.setsockopt(zmq.LINGER, 0)
        socket.setsockopt(zmq.RCVHWM, 100_000)
        socket.setsockopt(zmq.SUBSCRIBE, b"")
        socket.connect(endpoint)
        names[socket] = robot_name(number)
        poller.register(socket, zmq.POLLIN)
    print("observing", flush=True)
    while not ended:
        for socket, _ in poller.poll(WAKE_MS):
            topic, payload = socket.recv_multipart()
            found.append((names[socket], topic.decode(), payload, time.monotonic_ns()))
    context.destroy(linger=0)
    return found


def over_zenoh(endpoint: str, ended: list[int]) -> list[Arrival]:
    """Subscribe to everything of the fleet; to warnings with recovery, as `slipctl fleet` does."""
    found: queue.SimpleQueue[tuple[str, bytes, int]] = queue.SimpleQueue()

    def note(sample: zenoh.Sample) -> None:
        now_ns = time.monotonic_ns()
        found.put((str(sample.key_expr), sample.payload.to_bytes(), now_ns))

    def note_other(sample: zenoh.Sample) -> None:
        if not str(sample.key_expr).endswith(f"/{WARNING_TOPIC}"):
            note(sample)

    history, recovery = (
        HistoryConfig(detect_late_publishers=True),
        RecoveryConfig(periodic_queries=None, heartbeat=True),
    )
    with opened(configuration(Reach([endpoint], []), "peer"), endpoint) as session:
        warnings = f"slipd/*/{WARNING_TOPIC}"
        declared = (
            declare_advanced_subscriber(session, warnings, note, history=history, recovery=recovery),
            session.declare_subscriber("slipd/*/*", note_other),
        )
        print("observing", flush=True)
        while not ended:
            time.sleep(WAKE_MS / 1000)
        del declared
    arrivals = []
    while not found.empty():
        key, payload, t_ns = found.get()
        if (names := split_key(key, "slipd")) is not None:
            arrivals.append((*names, payload, t_ns))
    return arrivals


def robot_name(number: int) -> str:
    """Return the name of a robot."""
    return f"r{number:02d}"


def main() -> None:
    """Observe until SIGTERM."""
    ended: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, _: ended.append(number))
    kind, file, *endpoints = sys.argv[1:]
    arrivals = over_zeromq(endpoints, ended) if kind == "zeromq" else over_zenoh(endpoints[0], ended)
    rows = []
    for robot, topic, payload, t_ns in arrivals:
        body = msgpack.unpackb(payload)
        rows.append((robot, topic, body["seq"], len(payload), t_ns - body["t_ns"], t_ns))
    Path(file).write_text(json.dumps(rows), encoding="utf-8")


if __name__ == "__main__":
    main()
