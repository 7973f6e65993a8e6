"""The processes of a fleet on this machine: publishing daemons, bridges, a router, observers."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

from bench.child import Child
from fleet.observer import robot_name
from fleet.robot import Plan
from project import MODULES
from zenoh_peers import free_endpoint

TICKS = os.sysconf("SC_CLK_TCK")
PAGE_MB = os.sysconf("SC_PAGE_SIZE") / 1e6
SPREAD_S = 1.0
"""The robots begin within this time."""


class Network:
    """A fleet, used in ``with``; every process ends with it.

    Args:
        folder: For sockets and files.
        course: File of the recorded run that every daemon publishes.
        robots: Number of robots.

    Attributes:
        endpoint: Of the router.
        sockets: Where each daemon publishes, by the number of the robot.
        robots: The publishing daemons.
        bridges: The bridges.
        router: The router.
    """

    def __init__(self, folder: Path, course: Path, robots: int) -> None:
        self._folder, self._course, self._number = folder, course, robots
        self._stack = contextlib.ExitStack()
        self.endpoint = free_endpoint()
        self.sockets = [f"ipc://{folder}/{robot_name(number)}" for number in range(robots)]
        self.robots: list[Child] = []
        self.bridges: list[Child] = []

    def __enter__(self) -> Network:
        self.start_router()
        for number, socket in enumerate(self.sockets):
            plan = Plan(socket, str(self._course), f"boot-{number}", SPREAD_S * number / self._number)
            self.robots.append(self.child(sys.executable, "-m", "fleet.robot", json.dumps(asdict(plan))))
            self.bridges.append(self.bridge(socket, robot_name(number), self.endpoint))
        for robot, bridge in zip(self.robots, self.bridges, strict=True):
            robot.told("publishing")
            bridge.told("bridge: ")
        return self

    def __exit__(self, *error: object) -> None:
        self._stack.__exit__(*error)

    def bridge(self, socket: str, robot: str, endpoint: str) -> Child:
        """Start the bridge of a daemon."""
        command = ("--publish", socket, "bridge", "--robot", robot, "--connect", endpoint)
        return self.child(sys.executable, "-m", "slipd_client.slipctl", *command)

    def start_router(self) -> None:
        """Start the router, and wait until it listens."""
        self.router = self.child(sys.executable, "-m", "zenoh_peers", self.endpoint, stdin=subprocess.PIPE)
        self.router.told("listening")

    @contextlib.contextmanager
    def observed(self, kind: str, file: Path) -> Iterator[None]:
        """Let a process note every arrival over ``kind`` while the block runs; it then writes ``file``."""
        endpoints = self.sockets if kind == "zeromq" else [self.endpoint]
        observer = self.child(sys.executable, "-m", "fleet.observer", kind, str(file), *endpoints)
        observer.told("observing")
        yield
        observer.terminate()
        observer.ended(60.0)

    def child(self, *command: str, **options: int) -> Child:
        """Start a process that ends with the network."""
        return self._stack.enter_context(
            Child(command, self._folder, env=os.environ | {"PYTHONPATH": MODULES}, **options)
        )


def cpu_s(pid: int) -> float:
    """Return the processor time of a process so far, s."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def memory_mb(pid: int) -> float:
    """Return the resident memory of a process, MB."""
    return int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1]) * PAGE_MB


def stopped(child: Child) -> None:
    """Stop a process as a machine that freezes does: its connections stay open, and nothing is sent."""
    os.kill(child.pid, signal.SIGSTOP)


def go_on(child: Child) -> None:
    """Let a stopped process go on."""
    os.kill(child.pid, signal.SIGCONT)


def killed(child: Child) -> None:
    """Kill a process."""
    os.kill(child.pid, signal.SIGKILL)
