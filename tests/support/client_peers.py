"""Real ZeroMQ peers of a client: a publisher that the test drives, and a daemon's request side in a thread."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import zmq

from slipd_client.messages import PROTOCOL_VERSION, decode, encode

PATIENCE_S = 60.0

Handler = Callable[[dict[str, Any]], dict[str, Any] | bytes | None]

NEEDED: dict[str, dict[str, Any]] = {
    "slip": {"finger": "left", "level": "stable"},
    "warning": {"finger": "left", "level": "stable", "previous": "unknown", "rising": False},
    "wrench": {"finger": "left"},
    "tactile": {"finger": "left", "rows": 1, "cols": 1},
    "motion": {"safety": 1.25, "wanted_acceleration_mps2": 3.0},
}
"""What a message of each topic has at least."""


def until(condition: Callable[[], Any], meanwhile: Callable[[], object] = lambda: None) -> Any:
    """Wait until a condition holds, and return its value."""
    end_s = time.monotonic() + PATIENCE_S
    while not (found := condition()):
        assert time.monotonic() < end_s, "it never came"
        meanwhile()
        threading.Event().wait(0.005)  # a test may replace time.sleep
    return found


def refuse(code: str, message: str = "no", field: str | None = None) -> Handler:
    """Return a handler that refuses a request."""
    return lambda _: {"error": {"code": code, "message": message, "field": field}}


class Publisher:
    """The publishing side of a daemon."""

    def __init__(self, endpoint: str, boot: str = "boot-1") -> None:
        self.endpoint, self.boot = endpoint, boot
        self.topics: set[bytes] = set()
        self._seq = 0
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.XPUB)
        self._socket.bind(endpoint)

    def subscribed(self) -> set[bytes]:
        """Return the beginnings of topics that are subscribed to now."""
        while self._socket.poll(0):
            asked = self._socket.recv()
            change = self.topics.add if asked[:1] == b"\x01" else self.topics.discard
            change(asked[1:])
        return self.topics

    def wait_for(self, *topics: bytes) -> None:
        """Wait until somebody subscribes to these beginnings of topics; without any, to one at least."""
        until(lambda: self.subscribed() >= set(topics) and self.topics)

    def send(self, topic: str, seq: int | None = None, **fields: Any) -> int:
        """Send a message with all that its class needs, and what is given; return its number."""
        self._seq = self._seq + 1 if seq is None else seq
        header = {"v": PROTOCOL_VERSION, "seq": self._seq, "boot": self.boot, "t_ns": time.monotonic_ns()}
        self.send_frames(topic.encode(), encode(header | NEEDED.get(topic.partition(".")[0], {}) | fields))
        return self._seq

    def send_frames(self, *frames: bytes) -> None:
        self._socket.send_multipart(frames)

    def close(self) -> None:
        self._context.destroy(linger=0)


class Daemon(threading.Thread):
    """The request side of a daemon: records what it is asked and answers what ``handlers`` say.

    A handler returns a result, an ``{"error": …}``, raw bytes to send as they are, or None for no answer.
    """

    def __init__(self, endpoint: str, *, ahead_ns: int = 0, secret: bytes = b"") -> None:
        super().__init__(name="daemon", daemon=True)
        self.endpoint, self.boot, self.ahead_ns = endpoint, "boot-1", ahead_ns
        self.requests: list[dict[str, Any]] = []
        self.handlers: dict[str, Handler] = {
            "hello": lambda _: {
                "boot": self.boot, "t_ns": self.now_ns(), "version": PROTOCOL_VERSION, "fingers": ["left"],
            },
            **dict.fromkeys(("tare.get", "tare.undo"), lambda _: {"tare_id": 0, "busy": False}),
        }  # fmt: skip
        self._secret = secret
        self._closing, self._bound = threading.Event(), threading.Event()
        self.start()
        assert self._bound.wait(PATIENCE_S)

    @property
    def ops(self) -> list[str]:
        return [request["op"] for request in self.requests]

    @property
    def asked(self) -> list[dict[str, Any]]:
        """Every request but greetings and renewals, which a client repeats while a busy machine answers slowly."""
        return [request for request in self.requests if request["op"] not in ("hello", "lease.renew")]

    @property
    def asked_ops(self) -> list[str]:
        return [request["op"] for request in self.asked]

    def now_ns(self) -> int:
        return time.monotonic_ns() + self.ahead_ns

    def run(self) -> None:
        with zmq.Context() as context, context.socket(zmq.ROUTER) as router:
            router.setsockopt(zmq.LINGER, 0)
            if self._secret:
                router.setsockopt(zmq.CURVE_SERVER, 1)
                router.setsockopt(zmq.CURVE_SECRETKEY, self._secret)
            router.bind(self.endpoint)
            self._bound.set()
            while not self._closing.is_set():
                if router.poll(10):
                    client, data = router.recv_multipart()
                    answer = self._answer(decode(data))
                    if answer is not None:
                        router.send_multipart([client, answer])

    def _answer(self, request: dict[str, Any]) -> bytes | None:
        request["arrived_ns"] = self.now_ns()
        self.requests.append(request)
        handler = self.handlers.get(request["op"], lambda _: {})
        outcome = (handler if request.get("boot", self.boot) == self.boot else refuse("wrong_boot"))(request)
        if outcome is None or isinstance(outcome, bytes):
            return outcome
        head = {"v": PROTOCOL_VERSION, "id": request["id"], "t_ns": self.now_ns(), "ok": "error" not in outcome}
        return encode(head | (outcome if "error" in outcome else {"result": outcome}))

    def close(self) -> None:
        self._closing.set()
        self.join()
