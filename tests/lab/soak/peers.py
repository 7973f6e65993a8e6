"""Hostile peers at the real daemon: does it survive, how much memory do they take, how long do other peers wait?

A lease holder renews, and a newcomer asks for the tare, while each kind of peer does its worst.
"""

from __future__ import annotations

import contextlib
import os
import sys
import time
import tty
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
import zmq
from bench.child import Child
from bench.tables import Table
from gripper_table import gripper_table
from project import MODULES
from soak import hostile

SECONDS, QUICK_SECONDS = 10.0, 0.5
SETTLE_S = 0.5
LEASE_MS = 200
PERIOD_S = 0.05
"""From one request of each of the others to its next: 40 a second of both."""

ANSWER_MS = 2000
WANTED_MB, WANTED_MS = 50.0, 20.0
DEADLINE_NS = 400_000_000
OPEN_S = 60.0
RENEW, ASK = "lease.renew", "tare.get"

CASES: dict[str, tuple[tuple[str, str, int], ...]] = {
    "nobody": (),
    **{
        kind: ((kind, endpoint, 1),)
        for kind in hostile.KINDS
        for endpoint in ("publish", "requests", "readings")
        if kind.endswith(endpoint)
    },
    "subscribers with heartbeats that go": (("subscribers with heartbeats that go", "publish", 2),),
    **{
        kind: ((kind, "requests", count),)
        for kind, count in (
            (f"{hostile.STOCK_CLIENTS} stock clients, requests of {hostile.LARGE} bytes", 1),
            ("bursts, each on a new connection", 1),
            (f"{hostile.POLITE_CLIENTS} polite clients", 1),
            ("flood", 10),
        )
    },
}
"""What goes on → the kinds of hostile peers, the endpoint of each, and how many processes."""

CONFIG = """
[finger.left]
mu = 0.5
[finger.left.wrench]
device = "external"
port = "ipc://{folder}/readings"
sensor = "left.wrench"
rate_hz = 100.0
"""


@dataclass
class Served:
    """The daemon, and how each of its endpoints is reached."""

    process: Child
    endpoints: dict[str, str]


@dataclass
class Others:
    """What the holder and the other client met with.

    Attributes:
        took_ms: Of each request that was answered.
        refused: Answers other than what was asked for.
        unanswered: Requests without any.
    """

    took_ms: list[float]
    refused: int = 0
    unanswered: int = 0


def run(folder: Path, *, quick: bool) -> Table:
    """Measure; a daemon of its own for each case.

    Raises:
        BenchError: A daemon died.
    """
    seconds = QUICK_SECONDS if quick else SECONDS
    head = ("peers", "memory +MB", "others p50 ms", "p99", "most", "refused", "unanswered")
    table = Table(f"Hostile peers: {seconds:g} s each", head)
    for case, peers in CASES.items():
        table.rows.append((case, *_case(folder, peers, seconds)))
    table.notes += [
        f"Memory: highest of the daemon over what it had before; wanted: {WANTED_MB:g} MB at most.",
        "Others: a client that renews its lease and one that asks for the tare, 20 times a second each; wanted: "
        f"{WANTED_MS:g} ms at most (p99), none refused.",
        "The daemon survived every case; this is checked after each one.",
    ]
    return table


def _case(folder: Path, peers: tuple[tuple[str, str, int], ...], seconds: float) -> tuple[float | int, ...]:
    with daemon(folder) as served, ExitStack() as stack:
        context = stack.enter_context(zmq.Context())
        asker = Asker(context, served.endpoints["requests"])
        stack.callback(asker.close)
        before_kb = memory_kb(served.process.pid, "VmRSS")
        for kind, endpoint, count in peers:
            command = [sys.executable, "-m", "soak.hostile", kind, served.endpoints[endpoint], str(seconds)]
            environment = os.environ | {"PYTHONPATH": MODULES}
            for _ in range(count):
                stack.enter_context(Child(command, folder, env=environment)).told("ready")
        others = asker.ask(seconds)
        served.process.check()
        grown_mb = (memory_kb(served.process.pid, "VmHWM") - before_kb) / 1024
    took = np.array(others.took_ms or [np.inf])
    p50, p99 = (float(np.percentile(took, share)) for share in (50, 99))
    return grown_mb, p50, p99, float(took.max()), others.refused, others.unanswered


@contextlib.contextmanager
def daemon(folder: Path, *options: str) -> Iterator[Served]:
    """The daemon with one force sensor that others push, and a gripper that never answers."""
    ours, other = os.openpty()
    with ExitStack() as stack:
        stack.callback(os.close, ours)
        stack.callback(os.close, other)
        tty.setraw(other)
        config = folder / "peers.toml"
        config.write_text(CONFIG.format(folder=folder) + gripper_table(os.ttyname(other)))
        command = [sys.executable, "-m", "slipd", "run", "--config", str(config), *options]
        process = stack.enter_context(Child(command, folder))
        endpoints = {"publish": process.told("publish:"), "requests": process.told("requests:")}
        endpoints["readings"] = f"ipc://{folder}/readings"
        until_s = time.monotonic() + OPEN_S
        while not Path(f"{folder}/readings").exists() and time.monotonic() < until_s:
            time.sleep(0.01)
        yield Served(process, endpoints)


class Asker:
    """The holder of the lease, and another client."""

    def __init__(self, context: zmq.Context[zmq.Socket[bytes]], endpoint: str) -> None:
        self._sockets = [context.socket(zmq.DEALER) for _ in range(2)]
        for each in self._sockets:
            each.setsockopt(zmq.LINGER, 0)
            each.connect(endpoint)
        self._number = 0
        self._boot = self._exchange(self._sockets[0], "hello")["result"]["boot"]

    def ask(self, seconds: float) -> Others:
        """Renew and ask, in turns; an answer of an earlier request is not taken for that of a later one."""
        found = Others([])
        holder, client = self._sockets
        self._exchange(holder, "lease.acquire", ttl_ms=LEASE_MS)
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            begun_s = time.monotonic()
            for socket, op in ((holder, RENEW), (client, ASK)):
                sent_s = time.monotonic()
                reply = self._exchange(socket, op, **({} if op == RENEW else {"finger": "left"}))
                if reply is None:
                    found.unanswered += 1
                    continue
                found.took_ms.append(1e3 * (time.monotonic() - sent_s))
                if not reply["ok"]:
                    found.refused += 1
                    self._exchange(holder, "lease.acquire", ttl_ms=LEASE_MS)
            time.sleep(max(0.0, PERIOD_S - (time.monotonic() - begun_s)))
        return found

    def close(self) -> None:
        """Leave."""
        for each in self._sockets:
            each.close()

    def _exchange(self, socket: zmq.Socket[bytes], op: str, **fields: Any) -> Any:
        self._number += 1
        head = {"v": 1, "id": self._number, "op": op}
        if op != "hello":
            head |= {"boot": self._boot, "deadline_ns": time.monotonic_ns() + DEADLINE_NS}
        socket.send(msgpack.packb(head | fields))
        while socket.poll(ANSWER_MS):
            reply = msgpack.unpackb(socket.recv())
            if reply["id"] == self._number:
                return reply
        return None


def memory_kb(pid: int, what: str) -> int:
    """What a process has ("VmRSS"), or had at most ("VmHWM"), kB."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="ascii", errors="replace")
    return next(int(line.split()[1]) for line in status.splitlines() if line.startswith(f"{what}:"))
