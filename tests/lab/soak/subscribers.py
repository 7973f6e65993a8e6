"""A hundred subscribers of everything that never read, beside ten that do: do these lose anything, or hear it later?

Rounds without and with the stalled ones alternate on one daemon. A reading carries its number, so that a message tells
which write it is about; a latency is from just before that write to the message in a live subscriber's hands.

The live and the stalled ones are a process each: ``python -m soak.subscribers live|stalled ENDPOINT COUNT FILE``.
"""

from __future__ import annotations

import gc
import json
import os
import signal
import sys
import time
import tty
from array import array
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
import zmq
from bench import traffic, writer
from bench.child import BenchError, Child
from bench.tables import Table
from numpy.typing import NDArray
from project import MODULES

from slipd_client.errors import NoAnswer
from slipd_client.grip import GripClient

LIVE, STALLED = 10, 100
QUIET_S, QUICK_S = 60.0, 2.0
"""Seconds of a round without stalled ones, and of every round of a quick run."""

WARM_UP_S, QUICK_WARM_UP_S = 5.0, 1.0
"""Until the stalled ones are full: some two thousand messages each, in their own queue, the kernel's and ours."""

OPEN_S, LAST_S = 60.0, 0.5
WANTED_RATIO = 1.2
STREAM, TOPIC = "left.wrench", b"wrench.left"
CYCLE = 16_384
"""Numbers of readings begin again behind this one, before what they add to the force is a pull to speak of."""

WAKE_MS = 100


@dataclass
class Heard:
    """What the live subscribers of one round heard.

    Attributes:
        messages: Of all of them.
        missing: By the numbers of the messages.
        latency_us: Of each force message that is about a reading behind the warm-up.
    """

    messages: int
    missing: int
    latency_us: NDArray[np.float64]


@dataclass
class Round:
    """One round: whether there were stalled ones, how long it was, what was heard, what the daemon took."""

    stalled: bool
    seconds: float
    heard: Heard
    memory_kb: int
    cpu: float


def run(folder: Path, seconds: float, *, quick: bool) -> Table:
    """Measure: two rounds with stalled subscribers, ``seconds`` in all, and one without before each.

    Raises:
        BenchError: A process failed.
    """
    each_s = QUICK_S if quick else seconds / 2
    quiet_s = min(each_s, QUIET_S)
    warm_up_s = QUICK_WARM_UP_S if quick else WARM_UP_S
    with _daemon(folder) as (process, publish, fds):
        rounds = [
            _round(
                process,
                publish,
                fds,
                folder,
                stalled=stalled,
                seconds=each_s if stalled else quiet_s,
                warm_up_s=warm_up_s,
            )
            for stalled in (False, True, False, True)
        ]
    return _table(rounds)


@contextmanager
def _daemon(folder: Path) -> Iterator[tuple[Child, str, tuple[int, int]]]:
    """The daemon with one force sensor, which publishes every reading; its endpoint, both ends of its line."""
    ours, other = os.openpty()
    with ExitStack() as stack:
        stack.callback(os.close, ours)
        stack.callback(os.close, other)
        tty.setraw(other)
        os.set_blocking(ours, False)
        config = folder / "subscribers.toml"
        rates = {"wrench_hz": traffic.EVERY_READING_HZ}
        config.write_text(traffic.config_text({STREAM: os.ttyname(other)}, rates))
        process = stack.enter_context(Child([sys.executable, "-m", "slipd", "run", "--config", str(config)], folder))
        publish, requests = process.told("publish:"), process.told("requests:")
        _wait(requests)
        yield process, publish, (ours, other)


def _wait(requests: str) -> None:
    until_s = time.monotonic() + OPEN_S
    while time.monotonic() < until_s:
        try:
            with GripClient(requests) as requester:
                if requester.status()["streams"][STREAM]["hardware_id"]:
                    return
        except NoAnswer:  # the machine is busy
            time.sleep(0.05)
        time.sleep(0.05)
    raise BenchError(f"the daemon did not open its port within {OPEN_S:g} s")


def _round(
    process: Child, publish: str, fds: tuple[int, int], folder: Path, *, stalled: bool, seconds: float, warm_up_s: float
) -> Round:
    count = round((seconds + warm_up_s) * traffic.WRENCH_HZ)
    first = round(warm_up_s * traffic.WRENCH_HZ)
    stamps = folder / "stamps.npy"
    np.save(stamps, np.zeros(count, np.int64))
    plan = writer.Plan(
        STREAM, fds[0], -1, str(_frames(folder, count)), str(stamps), 1_000_000_000 // traffic.WRENCH_HZ, 0
    )
    writing = _module("bench.writer", writer.encode_plan([plan], round(warm_up_s * 1e9)))
    arrivals = folder / "arrivals.npy"
    with ExitStack() as stack:
        ear = stack.enter_context(
            _child(folder, _module("soak.subscribers", "live", publish, str(LIVE), str(arrivals)))
        )
        ear.told("ready")
        if stalled:
            deaf = _module("soak.subscribers", "stalled", publish, str(STALLED), "")
            stack.enter_context(_child(folder, deaf)).told("ready")
        hand = stack.enter_context(_child(folder, writing, pass_fds=fds))
        hand.told("measuring")
        begun_s, cpu_s = time.monotonic(), _cpu_s(process.pid)
        hand.told("{")
        took_s, cpu_s = time.monotonic() - begun_s, _cpu_s(process.pid) - cpu_s
        time.sleep(LAST_S)
        process.check()
        memory_kb = _memory_kb(process.pid)
        ear.terminate()
        told = json.loads("{" + ear.told("{"))
    latency_us = _latency_us(np.load(stamps), np.load(arrivals), first)
    heard = Heard(told["messages"], told["missing"], latency_us)
    return Round(stalled, seconds, heard, memory_kb, 100.0 * cpu_s / took_s)


def _frames(folder: Path, count: int) -> Path:
    """The readings of a round: a hold whose pull tells the number, again and again."""
    cycle = traffic.wrench_frames(traffic.steady(CYCLE), traffic.PATCH, 0)
    path = folder / "frames.npy"
    rows = np.frombuffer(b"".join(cycle), np.uint8).reshape(CYCLE, -1)
    np.save(path, rows[np.arange(count) % CYCLE])
    return path


def _latency_us(written_ns: NDArray[np.int64], arrivals: NDArray[np.int64], first: int) -> NDArray[np.float64]:
    """Latencies of the readings from ``first`` on.

    Args:
        written_ns: When each reading was written; 0 where it was not.
        arrivals: Subscriber, number within the cycle, and time of each message in the order of arrival, shape (n, 3).
        first: Number of the first reading that counts.
    """
    found = []
    for subscriber in range(LIVE):
        _, number, at_ns = arrivals[arrivals[:, 0] == subscriber].T
        number = number + CYCLE * np.concatenate(([0], np.cumsum(np.diff(number) < 0)))
        counts = (number >= first) & (number < len(written_ns))
        number, at_ns = number[counts], at_ns[counts]
        found.append((at_ns - written_ns[number])[written_ns[number] > 0] * 1e-3)
    return np.concatenate(found)


def _table(rounds: list[Round]) -> Table:
    head = ("round", "s", "messages", "missing", "p50 µs", "p99 µs", "memory kB", "CPU %")
    table = Table(f"Stalled subscribers: {STALLED} beside {LIVE} live ones", head)
    medians = []
    for one in rounds:
        p50, p99 = (float(np.percentile(one.heard.latency_us, share)) for share in (50, 99))
        medians.append(p50)
        name = f"{STALLED} stalled" if one.stalled else "none stalled"
        heard = one.heard
        table.rows.append((name, one.seconds, heard.messages, heard.missing, p50, p99, one.memory_kb, one.cpu))
    ratios = [medians[1] / medians[0], medians[3] / medians[2]]
    ratio = (medians[1] + medians[3]) / (medians[0] + medians[2])
    missing = sum(one.heard.missing for one in rounds)
    late = "yes" if ratio <= WANTED_RATIO else "no"
    table.notes += [
        f"Missing at the live ones by the numbers of the messages: {missing}; wanted: 0.",
        f"Median with stalled ones over that without: {ratio:.2f}, least to most {min(ratios):.2f} to "
        f"{max(ratios):.2f}; wanted: at most {WANTED_RATIO:g}; reached: {late}.",
        "All subscribe to everything; the stalled ones never read, and buffer one message before they block the line.",
        f"{traffic.WRENCH_HZ} readings/s, each published; memory is the daemon's at the end of the round.",
    ]
    return table


def _module(name: str, *arguments: str) -> list[str]:
    return [sys.executable, "-m", name, *arguments]


def _child(folder: Path, command: list[str], **options: Any) -> Child:
    return Child(command, folder, env=os.environ | {"PYTHONPATH": MODULES}, **options)


def _memory_kb(pid: int) -> int:
    status = Path(f"/proc/{pid}/status").read_text(encoding="ascii", errors="replace")
    return next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmRSS:"))


def _cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@dataclass
class _Live:
    """One live subscriber."""

    socket: zmq.Socket[bytes]
    seq: dict[bytes, int] = field(default_factory=dict)
    messages: int = 0
    missing: int = 0


def _listen(context: zmq.Context[zmq.Socket[bytes]], endpoint: str, count: int, file: str, ended: list[int]) -> None:
    """Hears everything ``count`` times; stamps first, and looks at what came behind that."""
    poller, live = zmq.Poller(), {}
    for number in range(count):
        one = _Live(_connected(context, endpoint, 1_000))
        live[one.socket] = number, one
        poller.register(one.socket, zmq.POLLIN)
    weights = traffic.index_weights()
    stamps = array("q")
    gc.disable()
    print("ready", flush=True)
    while not ended:
        came = []
        for socket, _ in poller.poll(WAKE_MS):
            frames = socket.recv_multipart()
            came.append((socket, frames, time.monotonic_ns()))
        for socket, frames, at_ns in came:
            number, one = live[socket]
            index = _take(one, frames, weights)
            if index is not None:
                stamps.extend((number, index, at_ns))
    np.save(file, np.frombuffer(stamps, np.int64).reshape(-1, 3))
    ones = [one for _, one in live.values()]
    told = {"messages": sum(one.messages for one in ones), "missing": sum(one.missing for one in ones)}
    print(json.dumps(told), flush=True)


def _take(one: _Live, frames: list[bytes], weights: list[float]) -> int | None:
    """Takes note of a message; the number of the reading that it is about, where it is about one."""
    topic, body = frames[0], msgpack.unpackb(frames[1])
    last = one.seq.get(topic, body["seq"] - 1)
    if body["seq"] <= last:  # the last message again, for one that came late
        return None
    one.messages += 1
    one.missing += body["seq"] - last - 1
    one.seq[topic] = body["seq"]
    if topic != TOPIC or body["tangential_n"] is None:
        return None
    felt = (*body["tangential_n"], body["normal_n"])
    return round(sum(weight * value for weight, value in zip(weights, felt, strict=True)))


def _connected(context: zmq.Context[zmq.Socket[bytes]], endpoint: str, kept: int) -> zmq.Socket[bytes]:
    socket = context.socket(zmq.SUB)
    socket.setsockopt(zmq.RCVHWM, kept)
    socket.setsockopt(zmq.LINGER, 0)
    socket.setsockopt(zmq.SUBSCRIBE, b"")
    socket.connect(endpoint)
    return socket


def main() -> None:
    """Hears, or does not, until SIGTERM."""
    kind, endpoint, count, file = sys.argv[1:]
    ended: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, _: ended.append(number))
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    if kind == "live":
        _listen(context, endpoint, int(count), file, ended)
    else:
        sockets = [_connected(context, endpoint, 1) for _ in range(int(count))]
        print("ready", flush=True)
        while not ended:
            time.sleep(WAKE_MS * 1e-3)
        for socket in sockets:
            socket.close()
    context.destroy(linger=0)


if __name__ == "__main__":
    main()
