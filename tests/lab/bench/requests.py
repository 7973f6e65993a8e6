"""Round trip of a request to the daemon, compared with a bare echo over the same kind of socket.

One client asks the daemon, an echo that is nothing but a ROUTER in an asyncio loop, and one in C, in turns of a second,
so that what else the machine does falls on all alike. The bytes and the pace are the same for all.

    requests.py ENDPOINT      is that echo
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import zmq
from bench import child, processes
from bench.tables import Table
from gripper_table import gripper_table
from project import MODULES

from slipd_client.messages import MESSAGE_LIMITS, PROTOCOL_VERSION, decode, encode

CLIENTS = 12
"""The daemon hears each of them 50 times a second at most."""

PERIOD_NS = 2_500_000
WARM_UP = 50
DEADLINE_NS = 400_000_000
TIMEOUT_MS = 2_000
LEASE_MS = 200
WANTED_RATIO = 2.0
RENEW, ASK = "lease.renew", "tare.get"
HEAD = ("round", RENEW, ASK, f"{RENEW} p99", "echo", "echo p99", "C echo", f"{RENEW} / echo", f"{ASK} / echo")


@dataclass
class _Asker:
    """Some clients of one server.

    Attributes:
        took_us: What was asked → µs of each.
    """

    sockets: list[zmq.Socket[bytes]]
    boot: str = ""
    took_us: dict[str, list[float]] = field(default_factory=dict)

    def ask(self, number: int, op: str, **fields: Any) -> dict[str, Any]:
        """One request, and how long it took."""
        socket = self.sockets[number]
        deadline_ns = time.monotonic_ns() + DEADLINE_NS
        head = {"v": PROTOCOL_VERSION, "id": next(_NUMBERS), "op": op, "boot": self.boot, "deadline_ns": deadline_ns}
        data = encode(head | fields)
        begun_ns = time.monotonic_ns()
        socket.send(data)
        if not socket.poll(TIMEOUT_MS):
            raise child.BenchError(f"no answer to {op}")
        reply = socket.recv()
        self.took_us.setdefault(op, []).append((time.monotonic_ns() - begun_ns) * 1e-3)
        return decode(reply, MESSAGE_LIMITS)

    def turn(self, seconds: float) -> None:
        """As many requests as there is time for, at the pace that the daemon grants: the first client renews."""
        due_ns = time.monotonic_ns()
        end_ns = due_ns + round(seconds * 1e9)
        for number in itertools.cycle(range(CLIENTS)):
            due_ns = max(due_ns + PERIOD_NS, time.monotonic_ns())
            if due_ns >= end_ns:
                return
            time.sleep(max(0, due_ns - time.monotonic_ns()) * 1e-9)
            op, fields = (ASK, {"finger": "left"}) if number else (RENEW, {})
            reply = self.ask(number, op, **fields)
            if reply.get("ok") is False:
                raise child.BenchError(f"{op} is refused: {reply['error']}")

    def begin(self) -> None:
        """What the requests of a turn need: which run this is, and the lease."""
        self.boot = self.ask(0, "hello").get("result", {}).get("boot", "0" * 16)
        self.ask(0, "lease.acquire", ttl_ms=LEASE_MS)

    def taken(self) -> dict[str, list[float]]:
        """What was asked → times since this was last called."""
        taken, self.took_us = self.took_us, {}
        return taken


_NUMBERS = itertools.count(1)


def run(folder: Path, *, rounds: int, seconds: float) -> Table:
    """Measure: ``seconds`` for each of the servers in each round."""
    built = _build(folder)
    with contextlib.ExitStack() as stack:
        lines = stack.enter_context(processes.Lines(["left.wrench"]))
        bus = stack.enter_context(processes.Lines(["gripper"]))
        extra = gripper_table(bus.path["gripper"])
        served = stack.enter_context(processes.daemon(folder, lines, {}, extra=extra))
        context = stack.enter_context(_context())
        servers = {"ours": _Asker(_connected(context, served.requests))}
        for name, command in {"echo": [sys.executable, "-m", "bench.requests"], "C echo": built}.items():
            if isinstance(command, list):
                endpoint = f"ipc://{folder}/{name.replace(' ', '-')}.socket"
                environment = os.environ | {"PYTHONPATH": MODULES}
                echo = child.Child([*command, endpoint], folder, env=environment)
                stack.enter_context(echo).told("ready")
                servers[name] = _Asker(_connected(context, endpoint))
        rows = []
        for number in range(rounds + 1):
            taken = {}
            for name, asker in servers.items():
                asker.begin()
                asker.turn(seconds if number else min(seconds, WARM_UP * PERIOD_NS * 1e-9))
                taken[name] = asker.taken()
            served.process.check()
            rows.append(taken)
    return _table(rows[1:], built if isinstance(built, str) else "", seconds)


def _table(rounds: list[dict[str, dict[str, list[float]]]], why: str, seconds: float) -> Table:
    title = f"Requests over ipc: from sending one to its reply, µs, {len(rounds)} x {seconds:g} s each"
    table = Table(title, HEAD if not why else tuple(name for name in HEAD if name != "C echo"))
    together: dict[str, dict[str, list[float]]] = {}
    for number, taken in enumerate(rounds):
        table.rows.append((str(number + 1), *_figures(taken)))
        for name, times in taken.items():
            for op, took_us in times.items():
                together.setdefault(name, {}).setdefault(op, []).extend(took_us)
    table.rows.append(("all", *_figures(together)))
    ratios = [float(row[-2]) for row in table.rows[:-1]]
    reached = "yes" if float(table.rows[-1][-2]) <= WANTED_RATIO else "no"
    table.notes += [
        "Medians where nothing else is said; the echo's are of the same bytes.",
        f"{RENEW} over the echo of it in the same loop, least to most of the rounds: {min(ratios):.2f} to "
        f"{max(ratios):.2f}; wanted: at most {WANTED_RATIO:g}; reached: {reached}.",
        f"{CLIENTS} connections, {1e9 / PERIOD_NS:g} requests/s in all: the daemon grants each 50.",
    ]
    if why:
        table.notes.append(f"The echo in C is not measured: {why}.")
    return table


def _figures(taken: dict[str, dict[str, list[float]]]) -> tuple[float, ...]:
    ours, echo = taken["ours"], taken["echo"]
    renew, ask, echoed, echoed_ask = (
        float(np.median(times)) for times in (ours[RENEW], ours[ASK], echo[RENEW], echo[ASK])
    )
    p99, echo_p99 = (float(np.percentile(times[RENEW], 99)) for times in (ours, echo))
    in_c = [float(np.median(taken["C echo"][RENEW]))] if "C echo" in taken else []
    return (renew, ask, p99, echoed, echo_p99, *in_c, renew / echoed, ask / echoed_ask)


def _build(folder: Path) -> list[str] | str:
    """The echo in C, as a command; or why there is none."""
    floor = processes.build_floor(folder)
    if isinstance(floor, str):
        return floor
    program = folder / "echo-in-c"
    command = ["cc", "-O2", "-o", str(program), str(processes.HERE / "echo.c"), "-ldl"]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    if built.returncode:
        return f"the C program does not build: {(built.stderr.splitlines() or ['cc failed'])[0]}"
    return [str(program), floor.library]


@contextlib.contextmanager
def _context() -> Iterator[zmq.Context[zmq.Socket[bytes]]]:
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    try:
        yield context
    finally:
        context.destroy(linger=0)


def _connected(context: zmq.Context[zmq.Socket[bytes]], endpoint: str) -> list[zmq.Socket[bytes]]:
    sockets = []
    for _ in range(CLIENTS):
        socket = context.socket(zmq.DEALER)
        socket.connect(endpoint)
        sockets.append(socket)
    return sockets


async def _echo(endpoint: str) -> None:
    """A ROUTER in an asyncio loop, read as its descriptor asks for, that sends back what came."""
    loop, stop = asyncio.get_running_loop(), asyncio.Event()
    loop.add_signal_handler(signal.SIGTERM, stop.set)
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    socket = context.socket(zmq.ROUTER)
    socket.bind(endpoint)

    def answer() -> None:
        with contextlib.suppress(zmq.Again):
            while True:
                socket.send_multipart(socket.recv_multipart(zmq.NOBLOCK), zmq.NOBLOCK)

    loop.add_reader(int(socket.getsockopt(zmq.FD)), answer)
    answer()
    print("ready", flush=True)
    await stop.wait()
    context.destroy(linger=0)


if __name__ == "__main__":
    asyncio.run(_echo(sys.argv[1]))
