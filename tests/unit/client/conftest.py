"""Real ZeroMQ peers for the client: a publisher driven by the test, and a daemon's request side in a thread."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import zmq

from slipd_client import lease_keeper
from slipd_client.aio import AsyncGripClient
from slipd_client.client_base import GripClientBase
from slipd_client.grip import GripClient
from slipd_client.messages import PROTOCOL_VERSION, decode, encode
from slipd_client.slipctl import main

PATIENCE_MS = 60_000

NEEDED: dict[str, dict[str, Any]] = {
    "slip": {"finger": "left", "level": "stable"},
    "warning": {"finger": "left", "level": "stable", "previous": "unknown", "rising": False},
    "wrench": {"finger": "left"},
    "tactile": {"finger": "left", "rows": 1, "cols": 1},
}
"""What a message of each topic has at least."""

Handler = Callable[[dict[str, Any]], dict[str, Any] | bytes | None]


class Publisher:
    """The publishing side of a daemon."""

    def __init__(self, endpoint: str, boot: str = "boot-1") -> None:
        self.endpoint = endpoint
        self.boot = boot
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.XPUB)
        self._socket.bind(endpoint)

    def wait_for_subscriber(self, meanwhile: Callable[[], object] = lambda: None) -> bytes:
        """The beginning of topics that somebody subscribed to; each subscription is told once.

        ``meanwhile``: a subscriber of this thread joins a second publisher only while it receives.
        """
        until = time.monotonic() + PATIENCE_MS / 1000
        while not self._socket.poll(20):
            assert time.monotonic() < until, "nobody subscribed"
            meanwhile()
        return self._socket.recv()[1:]

    def wait_for(self, topic: bytes) -> None:
        """Wait until somebody subscribes to a beginning of topics, which each subscriber does one after the other."""
        while self.wait_for_subscriber() != topic:
            pass

    def send(self, topic: str, seq: int, **fields: Any) -> None:
        """A message with all that its class needs, and what is given."""
        header = {"v": PROTOCOL_VERSION, "seq": seq, "boot": self.boot, "t_ns": time.monotonic_ns()}
        self.send_frames(topic.encode(), encode(header | NEEDED.get(topic.partition(".")[0], {}) | fields))

    def send_frames(self, *frames: bytes) -> None:
        self._socket.send_multipart(frames)

    def close(self) -> None:
        self._socket.close(linger=0)
        self._context.term()


class Daemon(threading.Thread):
    """The request side of a daemon: records what it is asked and answers what ``handlers`` say.

    A handler returns a result, an ``{"error": …}``, raw bytes to send as they are, or None for no answer.
    """

    def __init__(self, endpoint: str, boot: str = "boot-1", ahead_ns: int = 0, secret: bytes = b"") -> None:
        super().__init__(name="daemon", daemon=True)
        self.endpoint = endpoint
        self.boot = boot
        self.ahead_ns = ahead_ns
        self.secret = secret
        self.requests: list[dict[str, Any]] = []
        self.handlers: dict[str, Handler] = {"hello": self._hello}
        self.handlers |= dict.fromkeys(("tare.get", "tare.undo"), lambda _: {"tare_id": 0, "busy": False})
        self._stopping = threading.Event()
        self._bound = threading.Event()
        self.start()
        assert self._bound.wait(PATIENCE_MS / 1000)

    @property
    def ops(self) -> list[str]:
        return [request["op"] for request in self.requests]

    @property
    def asked(self) -> list[dict[str, Any]]:
        """Every request but the greetings, which a client repeats while a busy machine answers slowly."""
        return [request for request in self.requests if request["op"] != "hello"]

    @property
    def asked_ops(self) -> list[str]:
        return [request["op"] for request in self.asked]

    def now_ns(self) -> int:
        return time.monotonic_ns() + self.ahead_ns

    def run(self) -> None:
        with zmq.Context() as context, context.socket(zmq.ROUTER) as router:
            router.setsockopt(zmq.LINGER, 0)
            if self.secret:
                router.setsockopt(zmq.CURVE_SERVER, 1)
                router.setsockopt(zmq.CURVE_SECRETKEY, self.secret)
            router.bind(self.endpoint)
            self._bound.set()
            while not self._stopping.is_set():
                if router.poll(10):
                    client, data = router.recv_multipart()
                    for answer in self._answers(decode(data)):
                        router.send_multipart([client, answer])

    def _answers(self, request: dict[str, Any]) -> list[bytes]:
        request["arrived_ns"] = self.now_ns()
        self.requests.append(request)
        if request.get("boot", self.boot) != self.boot:
            outcome: Any = {"error": {"code": "wrong_boot", "message": "another run", "field": "boot"}}
        else:
            outcome = self.handlers.get(request["op"], lambda _: {})(request)
        if outcome is None:
            return []
        if isinstance(outcome, bytes):
            return [outcome]
        head = {"v": PROTOCOL_VERSION, "id": request["id"], "t_ns": self.now_ns(), "ok": "error" not in outcome}
        return [encode(head | (outcome if "error" in outcome else {"result": outcome}))]

    def _hello(self, _: dict[str, Any]) -> dict[str, Any]:
        return {"boot": self.boot, "t_ns": self.now_ns(), "version": PROTOCOL_VERSION, "fingers": ["left"]}

    def stop(self) -> None:
        self._stopping.set()
        self.join()


@pytest.fixture
def slipctl() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Starts slipctl as a process of its own, with its output in pipes unless told otherwise."""
    started: list[subprocess.Popen[str]] = []

    def start(*arguments: str, **options: Any) -> subprocess.Popen[str]:
        command = [sys.executable, "-m", "slipd_client.slipctl", *arguments]
        pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "encoding": "utf-8"}
        started.append(subprocess.Popen(command, **(pipes | options)))
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.communicate()


@pytest.fixture
def call(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Runs slipctl in this process; returns its exit code, output and errors."""

    def run(*arguments: str) -> tuple[int, str, str]:
        capsys.readouterr()
        try:
            code = main(arguments)
        except SystemExit as end:
            code = int(end.code or 0)
        return code, *capsys.readouterr()

    return run


@pytest.fixture
def publish(tmp_path: Path) -> str:
    return f"ipc://{tmp_path}/publish"


@pytest.fixture
def requests(tmp_path: Path) -> str:
    return f"ipc://{tmp_path}/requests"


@pytest.fixture
def start_publisher(publish: str) -> Iterator[Callable[..., Publisher]]:
    started: list[Publisher] = []

    def start(boot: str = "boot-1") -> Publisher:
        started.append(Publisher(publish, boot))
        return started[-1]

    yield start
    for publisher in started:
        publisher.close()


@pytest.fixture
def publisher(start_publisher: Callable[..., Publisher]) -> Publisher:
    return start_publisher()


@pytest.fixture
def start_daemon(requests: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Daemon]]:
    """Starts daemons; unless a test says otherwise, clients wait for them however long this machine stands still."""
    for kind in (GripClientBase, GripClient):
        patient = {"keys": None, "timeout_s": PATIENCE_MS / 1000}
        monkeypatch.setattr(kind.__init__, "__kwdefaults__", patient)
    started: list[Daemon] = []

    def start(boot: str = "boot-1", ahead_ns: int = 0, secret: bytes = b"") -> Daemon:
        started.append(Daemon(requests, boot, ahead_ns, secret))
        return started[-1]

    yield start
    for daemon in started:
        daemon.stop()


@pytest.fixture
def daemon(start_daemon: Callable[..., Daemon]) -> Daemon:
    return start_daemon()


@pytest.fixture(autouse=True)
def long_leases(monkeypatch: pytest.MonkeyPatch) -> None:
    """Unless a test says otherwise, no lease ends or is renewed while this machine does something else."""
    monkeypatch.setattr(GripClient.lease.__wrapped__, "__defaults__", (60_000,))
    monkeypatch.setattr(AsyncGripClient.lease.__wrapped__, "__defaults__", (60_000,))


@pytest.fixture
def stepped(monkeypatch: pytest.MonkeyPatch) -> Callable[[Any], Any]:
    """Lets a module wait in a time of its own, in which no stall counts; returns its clock."""
    now_s = [0.0]

    def sleep(seconds: float) -> None:
        now_s[0] += seconds

    clock = SimpleNamespace(monotonic=lambda: now_s[0], sleep=sleep)

    def step(module: Any) -> Any:
        monkeypatch.setattr(module, "time", clock)
        return clock

    return step


@pytest.fixture
def often(monkeypatch: pytest.MonkeyPatch) -> int:
    """Life of a lease, ms, that no stall ends and that is renewed often all the same."""
    monkeypatch.setattr(lease_keeper, "RENEWALS", 10_000)
    return 60_000
