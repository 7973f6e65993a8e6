"""The far ends of a whole daemon: a serial port that can be unplugged, and a client of both endpoints."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from typing import Any

import link_ends
import numpy as np
import zmq

from slipd.devices import bota
from slipd.devices.pvdf import encode_scan
from slipd.service_run import Endpoints
from slipd_client.messages import MESSAGE_LIMITS, decode, encode


class Device(link_ends.Device):
    """A device at a serial port, which sends whether or not a daemon has the port open."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._sent = 0
        self.plug()

    def send(self, data: bytes) -> None:
        with contextlib.suppress(OSError):  # nobody has the port open
            os.write(self.fd, data)

    def send_wrench(self, normal_n: float = 10.0) -> None:
        self._sent += 1
        self.read()  # so that the line never fills
        noise_nm = 1e-6 * (self._sent % 7)  # a sensor whose readings repeat is stuck
        self.send(bota.encode_frame((1.0, 0.0, -normal_n), (noise_nm, 0.0, 0.0), 10_000 * self._sent))

    def send_image(self) -> None:
        self._sent += 1
        self.send(encode_scan(np.full((4, 4), 100), self._sent, 10_000.0 * self._sent, 5.0))


class Client:
    """A subscriber of everything and a requester, in a context of their own."""

    def __init__(self, endpoints: Endpoints) -> None:
        self.endpoints = endpoints
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._sub, self._dealer = self._context.socket(zmq.SUB), self._context.socket(zmq.DEALER)
        self._sub.connect(endpoints.publish)
        self._sub.setsockopt(zmq.SUBSCRIBE, b"")
        self._dealer.connect(endpoints.requests)
        self.heard: list[tuple[str, dict[str, Any]]] = []

    def hear(self, topic: str) -> list[dict[str, Any]]:
        """Bodies of a topic so far."""
        while self._sub.poll(0):
            frames = self._sub.recv_multipart()
            assert len(frames) == 2
            self.heard.append((frames[0].decode(), decode(frames[1], MESSAGE_LIMITS)))
        return [body for name, body in self.heard if name == topic]

    def newest(self, topic: str) -> dict[str, Any]:
        """Body of the newest message of a topic; empty before the first."""
        heard = self.hear(topic)
        return heard[-1] if heard else {}

    def ask(self, **body: Any) -> None:
        self._dealer.send(encode({"v": 1, "id": 1} | body))

    def answer(self) -> dict[str, Any] | None:
        return decode(self._dealer.recv(), MESSAGE_LIMITS) if self._dealer.poll(0) else None

    def close(self) -> None:
        self._context.destroy(linger=0)
