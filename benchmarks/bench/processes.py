"""Starts and ends what is measured and what measures it: pseudo-terminals, the daemon, the floor, writer, listener.

Each is a process of its own that ends with its ``with`` block, whatever happens within.
"""

from __future__ import annotations

import contextlib
import ctypes.util
import json
import os
import shutil
import subprocess
import sys
import time
import tty
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import zmq
from bench import child, listener, traffic, writer
from numpy.typing import NDArray
from project import MODULES

from slipd_client.errors import NoAnswer, RequestRefused
from slipd_client.grip import GripClient

HERE = Path(__file__).parent
OPEN_S = 20.0
"""How long the daemon may take to open its ports; some 100 ms are usual."""

LAST_S = 0.3
"""From the last write until nobody waits for its message any more."""

BOOT, CONFIG_ID = "0123456789abcdef", "0123456789ab"
"""What the floor puts for them: as long as the daemon's."""


@dataclass(frozen=True)
class FloorProgram:
    """The built C program and the libzmq it opens."""

    program: Path
    library: str


def build_floor(folder: Path) -> FloorProgram | str:
    """The C program, built into ``folder``; or why there is none."""
    compiler = shutil.which("cc")
    if compiler is None:
        return "no C compiler named cc is here"
    bundled = sorted((Path(zmq.__file__).parents[1] / "pyzmq.libs").glob("libzmq*.so*"))
    library = str(bundled[0]) if bundled else ctypes.util.find_library("zmq")
    if library is None:
        return "no libzmq is found: pyzmq brings none of its own here, and the system has none"
    program = folder / "floor"
    built = subprocess.run(
        [compiler, "-O2", "-o", program, HERE / "floor.c", "-ldl"], capture_output=True, text=True, check=False
    )
    if built.returncode:
        return f"the C program does not build: {(built.stderr.splitlines() or ['cc failed'])[0]}"
    return FloorProgram(program, library)


class Lines:
    """A raw pseudo-terminal for every stream; both ends stay open, so that none ever hangs up.

    Attributes:
        fd: Stream → the device's end.
        other_fd: Stream → the other end, opened by its path for use.
        path: Stream → that path.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self.fd: dict[str, int] = {}
        self.other_fd: dict[str, int] = {}
        self.path: dict[str, str] = {}
        for name in names:
            self.fd[name], self.other_fd[name] = os.openpty()
            tty.setraw(self.other_fd[name])
            os.set_blocking(self.fd[name], False)
            self.path[name] = os.ttyname(self.other_fd[name])

    def __enter__(self) -> Lines:
        return self

    def __exit__(self, *error: object) -> None:
        for fd in (*self.fd.values(), *self.other_fd.values()):
            os.close(fd)


@dataclass(frozen=True)
class Served:
    """A running publisher: the daemon or the floor."""

    process: child.Child
    endpoint: str
    requests: str = ""

    def cpu_s(self) -> float:
        """CPU time of all its threads until now, s."""
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@contextlib.contextmanager
def daemon(folder: Path, lines: Lines, rates: dict[str, Any], *, record: Path | None = None) -> Iterator[Served]:
    """The daemon, as ``slipd run`` starts it, once it has opened all its ports."""
    config = folder / "rig.toml"
    config.write_text(traffic.config_text(lines.path, rates))
    command = [sys.executable, "-m", "slipd", "run", "--config", str(config)]
    command += [] if record is None else ["--record", str(record)]
    environment = os.environ | {"SLIPD_RUNTIME_DIR": str(folder / "run")}
    with child.Child(command, folder, env=environment) as process:
        endpoints = process.told("publish:"), process.told("requests:")
        _wait_for_ports(endpoints[1])
        yield Served(process, *endpoints)


def _wait_for_ports(requests: str) -> None:
    until_s = time.monotonic() + OPEN_S
    while time.monotonic() < until_s:
        with contextlib.suppress(NoAnswer):
            if all(stream["hardware_id"] for stream in status(requests)["streams"].values()):
                return
        time.sleep(0.02)
    raise child.BenchError(f"the daemon did not open its ports within {OPEN_S} s")


def status(requests: str) -> dict[str, Any]:
    """What the daemon tells of itself."""
    with GripClient(requests) as requester:
        return requester.status()


@contextlib.contextmanager
def floor(folder: Path, lines: Lines, built: FloorProgram) -> Iterator[Served]:
    """The C program, once it has opened its port."""
    endpoint = f"ipc://{folder}/floor.ipc"
    (path,) = lines.path.values()
    numbers = (*traffic.rotation().ravel().tolist(), *traffic.LEVER_M, *([0.0] * 6))
    command = [str(built.program), built.library, path, endpoint, BOOT, CONFIG_ID, *map(repr, numbers)]
    with child.Child(command, folder) as process:
        process.told("ready")
        yield Served(process, endpoint)


@dataclass(frozen=True)
class Measured:
    """One run of the writer, from the end of its warm-up.

    Attributes:
        latency_us: Topic → µs from a reading's write to its message, shape (readings,); NaN where there is none.
        readings: Force readings of one stream that were written.
        cpu_s: CPU time that the publisher took.
        seconds: How long it was.
        outcomes: Stream → what the writer tells of it, see `writer.Outcome.summary`.
        heard: What the listener tells.
    """

    latency_us: dict[str, NDArray[np.float64]]
    readings: int
    cpu_s: float
    seconds: float
    outcomes: dict[str, dict[str, float]]
    heard: listener.Heard


def measure(
    served: Served,
    lines: Lines,
    streams: Sequence[traffic.Stream],
    folder: Path,
    *,
    topics: dict[str, str],
    subscription: str,
    warm_up_s: float,
    watched: bool = False,
    priority: int = 0,
) -> Measured:
    """Write all streams to a running publisher, tare its fingers, and hear it.

    Args:
        served: The publisher.
        lines: Its ports.
        streams: What to write.
        folder: For the files in between.
        topics: Topic → stream of the force readings that it tells of.
        subscription: Beginning of the topics to hear.
        warm_up_s: How much of the beginning does not count.
        watched: At every write it is looked how much is unread.
        priority: Real-time priority of the writer and the listener; 0: none.
    """
    first = round(warm_up_s * traffic.WRENCH_HZ)
    count = max(len(stream.frames) for stream in streams)
    arrivals = _zeros(folder / "arrivals.npy", (len(topics), count))
    plans = [_plan(stream, lines, folder, watched=watched) for stream in streams]
    hearing = listener.Plan(served.endpoint, subscription, list(topics), str(arrivals), traffic.index_weights(), first)
    listening = _module("listener", json.dumps(asdict(hearing)))
    writing = _module("writer", writer.encode_plan(plans, round(warm_up_s * 1e9)))
    fds = (*lines.fd.values(), *lines.other_fd.values())
    environment = os.environ | {"PYTHONPATH": MODULES}
    with (
        child.Child(listening, folder, env=environment) as ear,
        child.Child(writing, folder, env=environment, pass_fds=fds) as hand,
    ):
        ear.told("listening")
        if priority:
            raise_threads(ear.pid, priority)
            raise_threads(hand.pid, priority)
        if served.requests:
            tare(served.requests, sorted({stream.name.partition(".")[0] for stream in streams}))
        hand.told("measuring")
        begin_s, cpu_s = time.monotonic(), served.cpu_s()
        outcomes = json.loads("{" + hand.told("{"))
        seconds, cpu_s = time.monotonic() - begin_s, served.cpu_s() - cpu_s
        time.sleep(LAST_S)
        served.process.check()
        ear.terminate()
        heard = listener.Heard(**json.loads("{" + ear.told("{")))
    stamps = {plan.name: np.load(plan.stamps) for plan in plans}
    latency_us = {
        topic: _latency_us(stamps[stream][first:], row[first:])
        for (topic, stream), row in zip(topics.items(), np.load(arrivals), strict=True)
    }
    return Measured(latency_us, count - first, cpu_s, seconds, outcomes, heard)


def tare(requests: str, fingers: Sequence[str]) -> None:
    """Tare the free fingers once their sensors deliver: without a zero there is no verdict to measure.

    Raises:
        BenchError: A tare is refused, or its sensors do not deliver in time.
    """
    until_s = time.monotonic() + traffic.FREE_S
    with GripClient(requests) as client:
        for finger in fingers:
            while True:
                try:
                    client.tare(finger, seconds=traffic.TARE_S)
                    break
                except RequestRefused as refused:
                    if refused.code != "not_ready" or time.monotonic() > until_s:
                        raise child.BenchError(f"{finger} was not tared: {refused}") from refused
                    time.sleep(0.01)


def raise_threads(pid: int, priority: int) -> None:
    """Run every thread of a process under SCHED_FIFO."""
    for thread in Path(f"/proc/{pid}/task").iterdir():
        os.sched_setscheduler(int(thread.name), os.SCHED_FIFO, os.sched_param(priority))


def _plan(stream: traffic.Stream, lines: Lines, folder: Path, *, watched: bool) -> writer.Plan:
    frames = folder / f"{stream.name}.frames.npy"
    np.save(frames, np.frombuffer(b"".join(stream.frames), np.uint8).reshape(len(stream.frames), -1))
    stamps = _zeros(folder / f"{stream.name}.stamps.npy", (len(stream.frames),))
    other_fd = lines.other_fd[stream.name] if watched else -1
    period_ns = round(1e9 / stream.rate_hz)
    phase_ns = round(stream.phase_s * 1e9)
    return writer.Plan(stream.name, lines.fd[stream.name], other_fd, str(frames), str(stamps), period_ns, phase_ns)


def _latency_us(written_ns: NDArray[np.int64], arrived_ns: NDArray[np.int64]) -> NDArray[np.float64]:
    both = (written_ns > 0) & (arrived_ns > 0)
    return np.where(both, (arrived_ns - written_ns) * 1e-3, np.nan)


def _zeros(path: Path, shape: tuple[int, ...]) -> Path:
    np.save(path, np.zeros(shape, np.int64))
    return path


def _module(name: str, argument: str) -> list[str]:
    return [sys.executable, "-m", f"bench.{name}", argument]
