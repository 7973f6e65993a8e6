"""Hostile peers, each in a process of its own: ``python -m soak.hostile KIND ENDPOINT SECONDS``.

They speak ZMTP by themselves, on plain sockets, where a stock ZeroMQ client could not do the same.
"""

from __future__ import annotations

import contextlib
import itertools
import random
import select
import socket
import sys
import time
from collections.abc import Callable, Iterator

import msgpack
import zmq

CHUNK = 1 << 20
"""Bytes offered to the kernel at once."""

BURST = 100
"""Requests of a client that reconnects for the next ones."""

STOCK_CLIENTS = 20
LARGE = 15_000
POLITE_CLIENTS, POLITE_HZ = 70, 4.0

_GREETING = b"\xff" + bytes(7) + b"\x01\x7f\x03\x01" + b"NULL".ljust(20, b"\0") + bytes(32)


def connected(endpoint: str, kind: bytes) -> socket.socket:
    """A connection behind its handshake, as a ZeroMQ socket of this kind."""
    peer = socket.socket(socket.AF_UNIX)
    peer.settimeout(5.0)
    peer.connect(endpoint.removeprefix("ipc://"))
    ready = b"\x05READY\x0bSocket-Type" + len(kind).to_bytes(4, "big") + kind
    peer.sendall(_GREETING + bytes((4, len(ready))) + ready)
    peer.recv(4096)
    return peer


def request(number: object) -> bytes:
    """The body of a request that anybody may send."""
    return msgpack.packb({"v": 1, "id": number, "op": "status"})


def endless(kind: bytes, part: int) -> Callable[[str, float], None]:
    """One message whose parts never end, as fast as the daemon takes it, and again on a new connection."""
    head = bytes((1, part)) if part < 256 else b"\x03" + part.to_bytes(8, "big")
    data = (head + bytes(part)) * max(1, CHUNK // part)

    def run(endpoint: str, seconds: float) -> None:
        for _ in _until(seconds):
            with contextlib.suppress(OSError), connected(endpoint, kind) as peer:
                for _ in _until(seconds):
                    peer.send(data)

    return run


def large_requests(endpoint: str, seconds: float) -> None:
    """Stock clients that send large requests as fast as ZeroMQ takes them, and read no reply."""
    with zmq.Context() as context:
        sockets = [context.socket(zmq.DEALER) for _ in range(STOCK_CLIENTS)]
        for each in sockets:
            each.setsockopt(zmq.LINGER, 0)
            each.setsockopt(zmq.SNDHWM, 100)
            each.connect(endpoint)
        body = msgpack.packb({"v": 1, "id": 1, "op": "status", "padding": bytes(LARGE)})
        for _ in _until(seconds):
            for each in sockets:
                with contextlib.suppress(zmq.Again):
                    each.send(body, zmq.NOBLOCK)
        for each in sockets:
            each.close()


def reconnecting(endpoint: str, seconds: float) -> None:
    """A client that sends a burst, leaves, and comes again for the next."""
    for number in _until(seconds):
        body = request(number)
        with contextlib.suppress(OSError), connected(endpoint, b"DEALER") as peer:
            peer.sendall((bytes((0, len(body))) + body) * BURST)
            peer.recv(65536)


def flooding(endpoint: str, seconds: float) -> None:
    """A client that never reads, and connects again whenever it is disconnected."""
    body = request(1)
    data = (bytes((0, len(body))) + body) * 1000
    for _ in _until(seconds):
        with contextlib.suppress(OSError), connected(endpoint, b"DEALER") as peer:
            for _ in _until(seconds):
                peer.send(data)


def polite(endpoint: str, seconds: float) -> None:
    """Many clients of one process that ask seldom; they heed what they are told."""
    with zmq.Context() as context:
        sockets = [context.socket(zmq.DEALER) for _ in range(POLITE_CLIENTS)]
        for each in sockets:
            each.setsockopt(zmq.LINGER, 0)
            each.connect(endpoint)
        boot = _boot(context, endpoint)
        for number in _until(seconds):
            begun_s = time.monotonic()
            for each in sockets:
                head = {"v": 1, "id": number, "op": "tare.get", "boot": boot, "finger": "left"}
                each.send(msgpack.packb(head | {"deadline_ns": time.monotonic_ns() + 450_000_000}))
            time.sleep(max(0.0, 1.0 / POLITE_HZ - (time.monotonic() - begun_s)))
            for each in sockets:
                while each.poll(0):
                    each.recv()
        for each in sockets:
            each.close()


def _boot(context: zmq.Context[zmq.Socket[bytes]], endpoint: str) -> str:
    with context.socket(zmq.DEALER) as asker:
        asker.connect(endpoint)
        asker.send(msgpack.packb({"v": 1, "id": 0, "op": "hello"}))
        return str(msgpack.unpackb(asker.recv())["result"]["boot"])


def leaving(endpoint: str, seconds: float) -> None:
    """Stock subscribers with heartbeats that subscribe more than is taken, and go; prints how many."""
    count = 0
    with zmq.Context() as context:
        for _ in _until(seconds):
            subscriber = context.socket(zmq.SUB)
            subscriber.setsockopt(zmq.LINGER, 0)
            subscriber.setsockopt(zmq.SNDHWM, 0)
            subscriber.setsockopt(zmq.RECONNECT_IVL, -1)
            subscriber.setsockopt(zmq.HEARTBEAT_IVL, 1)
            subscriber.connect(endpoint)
            for topic in range(600):
                subscriber.setsockopt(zmq.SUBSCRIBE, b"%d" % topic)
            time.sleep(random.uniform(0.002, 0.03))
            subscriber.close()
            count += 1
    print(count, flush=True)


def pinging(kind: bytes) -> Callable[[str, float], None]:
    """Pings as fast as they are taken, and no answer is read; then it goes, with pings still unread."""
    data = b"\x04\x07\x04PING\0\0" * 2000

    def run(endpoint: str, seconds: float) -> None:
        for _ in _until(seconds):
            with contextlib.suppress(OSError), connected(endpoint, kind) as peer:
                peer.setblocking(False)
                for _ in range(random.randrange(1, 50)):
                    select.select([], [peer], [], 0.1)
                    peer.send(data)

    return run


def _until(seconds: float) -> Iterator[int]:
    end_s = time.monotonic() + seconds
    for number in itertools.count():
        if time.monotonic() > end_s:
            return
        yield number


KINDS: dict[str, Callable[[str, float], None]] = {
    "endless message to requests": endless(b"DEALER", 255),
    "endless message to publish": endless(b"SUB", 64),
    "endless message to readings": endless(b"PUSH", 60_000),
    "endless message of large frames to requests": endless(b"DEALER", 15_000),
    f"{STOCK_CLIENTS} stock clients, requests of {LARGE} bytes": large_requests,
    "bursts, each on a new connection": reconnecting,
    "flood": flooding,
    f"{POLITE_CLIENTS} polite clients": polite,
    "subscribers with heartbeats that go": leaving,
    "pings to publish": pinging(b"SUB"),
    "pings to requests": pinging(b"DEALER"),
    "pings to readings": pinging(b"PUSH"),
}


def main() -> None:
    """Do harm for a while."""
    kind, endpoint, seconds = sys.argv[1:]
    print("ready", flush=True)
    KINDS[kind](endpoint, float(seconds))
    print("done", flush=True)


if __name__ == "__main__":
    main()
