"""Ten minutes of two fingers, each with 4000 force readings and 500 images of 128 taxels a second: does anything grow?

The force comes as a Net F/T sends it, 40 records a datagram; the images on pseudo-terminals. Daemon, devices and
subscriber are processes of their own.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from bench import processes
from bench.child import BenchError, Child
from bench.tables import Table
from project import MODULES
from soak import devices

from slipd.tools.sim.scene_parts import Pad
from slipd_client.errors import NoAnswer, RequestRefused
from slipd_client.grip import GripClient
from slipd_client.subscriber import Subscriber

QUICK_SECONDS = 10.0
CPU_SECONDS, CPU_ROUNDS = 15.0, 4
"""Of each way to run, in turn: the machine's speed changes from minute to minute."""

SILENT = "".join(["[rates]\n", *(f"{topic}_hz = 0.001\n" for topic in ("slip", "wrench", "tactile", "status"))])
WARM_UP_S = 3.0
OPEN_S = 60.0
WINDOW_SHARE = 0.1
"""The beginning and the end that are compared."""

FINGERS = ("left", "right")
PORTS = {"left": 49_170, "right": 49_171}
HOSTS = {"left": "127.0.0.6", "right": "127.0.0.7"}
"""Each Net F/T answers its inquiry on a port of its own, and so needs a host of its own."""


def run(folder: Path, seconds: float, *, quick: bool) -> list[Table]:
    """Measure.

    Raises:
        BenchError: A process failed.
    """
    seconds = QUICK_SECONDS if quick else seconds
    cpu = _processor_time(folder, quick=quick)
    first, last, took_s, cpu_s, rows, ear = _load(folder / "long", seconds, "")
    return [
        cpu,
        _streams(first, last, took_s, 100.0 * cpu_s / took_s),
        _growth(rows, ear, seconds),
    ]


def _processor_time(folder: Path, *, quick: bool) -> Table:
    """The daemon, publishing next to nothing and at the default rates, beside a program that reads alone."""
    seconds, rounds = (QUICK_SECONDS, 1) if quick else (CPU_SECONDS, CPU_ROUNDS)
    head = ("round", "reading alone", "publishing next to nothing", "at the default rates")
    table = Table(f"Two fingers: processor time, % of a core, {rounds} x {seconds:g} s each", head)
    shares = []
    for number in range(rounds):
        alone = _read_alone(folder / f"alone-{number}", seconds)
        _, _, silent_took_s, silent_s, _, _ = _load(folder / f"silent-{number}", seconds, SILENT)
        _, _, took_s, cpu_s, _, _ = _load(folder / f"default-{number}", seconds, "")
        shares.append((alone, 100.0 * silent_s / silent_took_s, 100.0 * cpu_s / took_s))
        table.rows.append((str(number + 1), *shares[-1]))
    table.rows.append(("median", *np.median(shares, axis=0).tolist()))
    table.notes += [
        "Wanted: at most 25 % publishing next to nothing and 33 % at the default rates, on a machine on which reading"
        " alone takes 3 to 4 %.",
        "Reading alone: an event loop of Python that takes the bytes of all four lines and does nothing with them.",
    ]
    return table


def _read_alone(folder: Path, seconds: float) -> float:
    folder.mkdir()
    plan, pads = _plan(folder)
    environment = os.environ | {"PYTHONPATH": MODULES}
    with Child([sys.executable, "-m", "soak.devices", plan], folder, env=environment) as hand:
        hand.told(pads[FINGERS[-1]])
        os.kill(hand.pid, signal.SIGUSR1)
        with Child([sys.executable, "-m", "soak.reading", plan], folder, env=environment) as process:
            process.told("reading")
            time.sleep(WARM_UP_S)
            begin_s, cpu_s = time.monotonic(), _cpu_s(process.pid)
            time.sleep(seconds)
            return 100.0 * (_cpu_s(process.pid) - cpu_s) / (time.monotonic() - begin_s)


def _plan(folder: Path) -> tuple[str, dict[str, str]]:
    """Where the sensors are, as `soak.devices` takes it, and the pads by finger."""
    pads = {finger: str(folder / f"{finger}-pad") for finger in FINGERS}
    return json.dumps([(_force(finger), pads[finger]) for finger in FINGERS]), pads


def _force(finger: str) -> str:
    return f"udp://{HOSTS[finger]}:{PORTS[finger]}"


def _load(
    folder: Path, seconds: float, rates: str
) -> tuple[dict[str, Any], dict[str, Any], float, float, list[tuple[int, int]], _Ear]:
    """Status before and after, time and processor time taken, what was watched, what was heard."""
    folder.mkdir()
    plan, pads = _plan(folder)
    config = folder / "load.toml"
    config.write_text(rates + "".join(_finger(finger, _force(finger), pads[finger]) for finger in FINGERS))
    emulate = [sys.executable, "-m", "soak.devices", plan]
    daemon = [sys.executable, "-m", "slipd", "run", "--config", str(config)]
    environment = os.environ | {"PYTHONPATH": MODULES}
    with Child(emulate, folder, env=environment) as hand, Child(daemon, folder, env=environment) as process:
        hand.told(pads[FINGERS[-1]])
        publish, requests = process.told("publish:"), process.told("requests:")
        _wait(requests, lambda stream: stream["rate_hz"])
        processes.tare(requests, FINGERS)
        _wait(requests, lambda stream: stream["tare_origin"])  # a pad's is observed after that of the force
        os.kill(hand.pid, signal.SIGUSR1)  # pressed from here on
        time.sleep(WARM_UP_S)
        ear = _Ear(publish)
        first, begin_s, cpu_s = _status(requests), time.monotonic(), _cpu_s(process.pid)
        rows = _watch(process, requests, seconds)
        took_s, cpu_s = time.monotonic() - begin_s, _cpu_s(process.pid) - cpu_s
        last = _status(requests)
        ear.stop()
    return first, last, took_s, cpu_s, rows, ear


def _finger(name: str, force: str, pad: str) -> str:
    return f"""
[finger.{name}]
mu = 0.55
[finger.{name}.wrench]
device = "netft"
port = "{force}"
rate_hz = {devices.FORCE_HZ}
[finger.{name}.pad]
device = "pvdf"
port = "{pad}"
rate_hz = {devices.IMAGE_HZ}
rows = {Pad().rows}
cols = {Pad().cols}
pitch_m = {Pad().pitch_m}
electrode_m = {Pad().electrode_m}
axis_scale = [{1.0 / devices.COUNTS_PER_N}]
threshold = 0.02
"""


class _Ear:
    """A subscriber of slip messages: how old each was when it came."""

    def __init__(self, endpoint: str) -> None:
        self.ages_ms: list[float] = []
        self.at_s: list[float] = []
        self.missed = 0
        self._stopped = False
        self._thread = threading.Thread(target=self._listen, args=(endpoint,))
        self._thread.start()

    def _listen(self, endpoint: str) -> None:
        with Subscriber(endpoint, ("slip.",)) as subscriber:
            while not self._stopped:
                message = subscriber.receive(0.1)
                if message is not None:
                    self.ages_ms.append(1e3 * message.age_s)
                    self.at_s.append(time.monotonic())
                    self.missed += message.missed

    def stop(self) -> None:
        self._stopped = True
        self._thread.join()


def _wait(requests: str, ready: Callable[[dict[str, Any]], Any]) -> None:
    """Wait until the status of every stream shows that it is ready."""
    until_s = time.monotonic() + OPEN_S
    while time.monotonic() < until_s:
        if all(ready(each) for each in _status(requests)["streams"].values()):
            return
        time.sleep(0.1)
    raise BenchError(f"the streams are not ready within {OPEN_S:g} s: {_status(requests)['streams']}")


def _status(requests: str) -> dict[str, Any]:
    for _ in range(10):
        try:
            with GripClient(requests) as requester:
                return requester.status()
        except (NoAnswer, RequestRefused):  # the machine is busy
            time.sleep(0.1)
    raise BenchError("the daemon does not answer")


def _watch(process: Child, requests: str, seconds: float) -> list[tuple[int, int]]:
    """Every second: memory in kB, and bytes that wait in the sockets of the force sensors."""
    rows = []
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s:
        process.check()
        status = Path(f"/proc/{process.pid}/status").read_text()
        memory_kb = next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmRSS:"))
        rows.append((memory_kb, _unread_udp()))
        time.sleep(1.0)
    return rows


def _unread_udp() -> int:
    """Bytes that the kernel holds for sockets connected to the force sensors."""
    unread = 0
    for line in Path("/proc/net/udp").read_text().splitlines()[1:]:
        fields = line.split()
        if int(fields[2].rpartition(":")[2], 16) in PORTS.values():
            unread += int(fields[4].partition(":")[2], 16)
    return unread


def _cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _streams(first: dict[str, Any], last: dict[str, Any], took_s: float, cpu: float) -> Table:
    table = Table(f"Two fingers, {took_s:.0f} s: readings", ("stream", "taken/s", "lost", "spoilt", "dropped"))
    for name, told in last["streams"].items():
        before = first["streams"][name]
        counts = [told[key] - before[key] for key in ("lost", "bad", "dropped")]
        table.rows.append((name, (told["samples"] - before["samples"]) / took_s, *counts))
    levels = ", ".join(f"{name} {finger['level']}" for name, finger in last["fingers"].items())
    table.notes += [
        f"The daemon took {cpu:.1f} % of a core, publishing at the default rates.",
        f"Levels at the end: {levels}.",
    ]
    return table


def _growth(rows: list[tuple[int, int]], ear: _Ear, seconds: float) -> Table:
    head = ("what", "first tenth", "last tenth", "most")
    table = Table(f"Two fingers, {seconds:.0f} s: what grows", head)
    at_s, ages = np.array(ear.at_s), np.array(ear.ages_ms)
    if not len(ages):
        raise BenchError("no slip message came")
    window_s = WINDOW_SHARE * (at_s[-1] - at_s[0])
    early, late = ages[at_s <= at_s[0] + window_s], ages[at_s >= at_s[-1] - window_s]
    for share in (50, 99):
        name = f"age of a slip message, p{share}, ms"
        table.rows.append((name, *(float(np.percentile(part, share)) for part in (early, late)), float(ages.max())))
    part = max(1, round(WINDOW_SHARE * len(rows)))
    for column, name in enumerate(("memory, kB", "unread bytes of force datagrams")):
        values = [row[column] for row in rows]
        table.rows.append((name, float(np.median(values[:part])), float(np.median(values[-part:])), max(values)))
    table.notes += [
        f"{len(ages)} slip messages, {ear.missed} missing by their numbers.",
        "The age counts from the acquisition; up to 10 ms of it pass in the sensor, which fills a datagram.",
    ]
    return table
