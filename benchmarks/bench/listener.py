"""The subscriber, in a process of its own: a plain blocking ZeroMQ socket that stamps what arrives.

A stamp is CLOCK_MONOTONIC as soon as both frames of a message are received, before they are unpacked; it stands at the
number of the force reading that the message is about. The first arrival counts.

    python -m bench.listener PLAN  (JSON, see `Plan`)

Prints ``listening`` when it is connected, and a JSON `Heard` after SIGTERM.
"""

from __future__ import annotations

import gc
import json
import signal
import sys
import time
from collections import Counter
from dataclasses import asdict, dataclass, field
from typing import Any

import msgpack
import numpy as np
import zmq

WAKE_MS = 100
"""How often silence is interrupted to see whether to end."""


@dataclass(frozen=True)
class Plan:
    """What to hear.

    Attributes:
        endpoint: Where.
        subscription: Beginning of the topics to hear.
        topics: The topics whose arrivals are stamped.
        arrivals: File of the stamps to be made, shape (topics, readings) (.npy, int64); 0: nothing arrived.
        index_weights: What (tangential x, tangential y, normal force) give the reading's number with.
        first: Number of the first reading after the warm-up.
    """

    endpoint: str
    subscription: str
    topics: list[str]
    arrivals: str
    index_weights: list[float]
    first: int


@dataclass
class Heard:
    """What came.

    Attributes:
        messages: Topic → messages.
        gaps: Topic → messages that its numbers show to be missing.
        bytes: Topic → median size of a message, without the topic.
        keys: Topic → keys of its messages.
        models: How the verdicts on readings after the warm-up were found → how many.
        active: Active taxels in the newest image that can be used; None without one.
    """

    messages: dict[str, int] = field(default_factory=dict)
    gaps: dict[str, int] = field(default_factory=dict)
    bytes: dict[str, float] = field(default_factory=dict)
    keys: dict[str, list[str]] = field(default_factory=dict)
    models: dict[str, int] = field(default_factory=dict)
    active: int | None = None


class Listener:
    """Takes messages; what it counts becomes `heard` at the end."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._rows = {topic: row for row, topic in enumerate(plan.topics)}
        self._arrivals = np.lib.format.open_memmap(plan.arrivals, mode="r+")
        self._arrivals[:] = 0  # touches every page before it counts
        self._seq: dict[str, int] = {}
        self._gaps: Counter[str] = Counter()
        self._sizes: dict[str, list[int]] = {}
        self._models: Counter[str] = Counter()
        self._keys: dict[str, list[str]] = {}
        self._active: int | None = None

    def take(self, frames: list[bytes], t_ns: int) -> None:
        """Count one message that arrived at ``t_ns``."""
        topic = frames[0].decode()
        body: dict[str, Any] = msgpack.unpackb(frames[1])
        last = self._seq.get(topic, body["seq"] - 1)
        if body["seq"] <= last:  # the last message again, for a subscriber that came late
            return
        self._gaps[topic] += body["seq"] - last - 1
        self._seq[topic] = body["seq"]
        self._sizes.setdefault(topic, []).append(len(frames[1]))
        if topic not in self._keys:
            self._keys[topic] = list(body)
        if body.get("active") is not None:
            self._active = body["active"]
        if topic in self._rows and body["tangential_n"] is not None:
            self._stamp(topic, body, t_ns)

    def _stamp(self, topic: str, body: dict[str, Any], t_ns: int) -> None:
        felt = (*body["tangential_n"], body["normal_n"])
        index = round(sum(weight * value for weight, value in zip(self._plan.index_weights, felt, strict=True)))
        row = self._arrivals[self._rows[topic]]
        if 0 <= index < len(row) and row[index] == 0:
            row[index] = t_ns
            if index >= self._plan.first and "model" in body:
                self._models[body["model"]] += 1

    def heard(self) -> Heard:
        """What came until now."""
        counts = {topic: len(sizes) for topic, sizes in self._sizes.items()}
        sizes = {topic: float(np.median(sizes)) for topic, sizes in self._sizes.items()}
        return Heard(counts, dict(self._gaps), sizes, self._keys, dict(self._models), self._active)


def main() -> None:
    """Hear it all."""
    plan = Plan(**json.loads(sys.argv[1]))
    ended: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, _: ended.append(number))
    listener = Listener(plan)
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    socket = context.socket(zmq.SUB)
    socket.setsockopt(zmq.RCVTIMEO, WAKE_MS)
    socket.setsockopt(zmq.LINGER, 0)
    socket.setsockopt(zmq.SUBSCRIBE, plan.subscription.encode())
    socket.connect(plan.endpoint)
    gc.disable()
    print("listening", flush=True)
    while not ended:
        try:
            frames = socket.recv_multipart()
        except zmq.Again:
            continue
        listener.take(frames, time.monotonic_ns())
    socket.close()
    context.term()
    print(json.dumps(asdict(listener.heard())), flush=True)


if __name__ == "__main__":
    main()
