"""Bytes on the wire between a bridge and the router: a relay counts them."""

from __future__ import annotations

import contextlib
import selectors
import socket
import threading
import time
from collections.abc import Iterator, Sequence
from typing import Any

from bench.tables import Table
from fleet.network import Network
from zenoh_peers import free_endpoint, session

SECONDS = 10.0
WARM_S = 3.0
BLOCK = 65536
ROBOT = "counted"

VIEWS: tuple[tuple[str, Sequence[str]], ...] = (
    ("nobody", ()),
    ("`slipctl fleet`: status and warnings", ("status", "warning")),
    ("every topic", ("*",)),
)
"""Who subscribes, and to which topics."""


class CountingRelay(threading.Thread):
    """Passes bytes between connections to ``endpoint`` and ``target``, and counts them.

    Attributes:
        endpoint: Where it accepts connections.
        upward: Bytes from those that connect.
    """

    def __init__(self, target: str) -> None:
        super().__init__(name="relay", daemon=True)
        self.endpoint, self._target = free_endpoint(), target
        self.upward = 0
        self._ended = threading.Event()
        self._selector = selectors.DefaultSelector()
        self._accepting = socket.create_server(_address(self.endpoint))
        self._selector.register(self._accepting, selectors.EVENT_READ)

    def run(self) -> None:
        """Relay until `stop`."""
        while not self._ended.is_set():
            for key, _ in self._selector.select(0.1):
                if key.fileobj is self._accepting:
                    self._accept()
                else:
                    self._pass(key)
        for key in list(self._selector.get_map().values()):
            key.fileobj.close()  # type: ignore[union-attr]

    def stop(self) -> None:
        """End."""
        self._ended.set()
        self.join()

    def _accept(self) -> None:
        client, server = self._accepting.accept()[0], socket.create_connection(_address(self._target))
        for one, other, upward in ((client, server, True), (server, client, False)):
            one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._selector.register(one, selectors.EVENT_READ, (other, upward))

    def _pass(self, key: Any) -> None:
        other, upward = key.data
        with contextlib.suppress(OSError):
            if data := key.fileobj.recv(BLOCK):
                self.upward += len(data) if upward else 0
                other.sendall(data)
                return
        for each in (key.fileobj, other):
            with contextlib.suppress(KeyError, ValueError):
                self._selector.unregister(each)
            each.close()


def run(network: Network) -> Table:
    """Count what one more bridge of the first robot sends, for each kind of view."""
    head = ("who subscribes", "messages /s", "payload bytes/s", "bytes/s on the wire", "bytes beside the payload, each")
    table = Table(f"One robot on the wire, {SECONDS:g} s each", head)
    with _bridged(network) as relay:
        for who, topics in VIEWS:
            messages, payload, sent = _counted(network, relay, topics)
            beside: float | str = (sent - payload) / messages if messages else "–"
            table.rows.append((who, messages / SECONDS, payload / SECONDS, sent / SECONDS, beside))
    table.notes.append("TCP payload from the bridge to the router, heartbeats and keep-alives included.")
    return table


def _counted(network: Network, relay: CountingRelay, topics: Sequence[str]) -> tuple[int, int, int]:
    """Return messages, bytes of their payloads, and bytes that the relay passed on, of some seconds."""
    sizes: list[int] = []
    with session(network.endpoint) as here:
        declared = [
            here.declare_subscriber(f"slipd/{ROBOT}/{topic}", lambda sample: sizes.append(len(sample.payload)))
            for topic in topics
        ]
        time.sleep(WARM_S)
        before, first = relay.upward, len(sizes)
        time.sleep(SECONDS)
        sent, counted = relay.upward - before, sizes[first:]
        del declared
    return len(counted), sum(counted), sent


@contextlib.contextmanager
def _bridged(network: Network) -> Iterator[CountingRelay]:
    """Let a further bridge of the first robot reach the router through a relay."""
    relay = CountingRelay(network.endpoint)
    relay.start()
    bridge = network.bridge(network.sockets[0], ROBOT, relay.endpoint)
    bridge.told("bridge: ")
    try:
        yield relay
    finally:
        bridge.terminate()
        relay.stop()


def _address(endpoint: str) -> tuple[str, int]:
    """Return host and port of an endpoint."""
    host, _, port = endpoint.removeprefix("tcp/").rpartition(":")
    return host, int(port)
