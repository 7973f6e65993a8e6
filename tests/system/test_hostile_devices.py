"""A daemon with hostile devices keeps running, keeps its size, logs few lines, and ends in good order."""

from __future__ import annotations

import base64
import hashlib
import re
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import pytest
from daemon_peers import Client, Device

from slipd.service_run import Endpoints
from slipd.types.device_text import LONGEST

PATIENCE_S = 60.0
HOSTILE_S = 4.0
MOST_GROWTH_MB = 50
MOST_LINES = 200
MANY = 50
SERVERS = 8
SLIPD = str(Path(sys.executable).with_name("slipd"))

GOOD = """
[rates]
status_hz = 10.0
wrench_hz = 1000.0

[finger.good]
mu = 0.5

[finger.good.wrench]
device = "bota"
port = "{port}"
rate_hz = 100.0
"""
XELA = """
[finger.{name}.pad]
device = "xela"
port = "{port}"
sensor = "1"
rate_hz = 100.0
rows = 4
cols = 4
pitch_m = 0.004
electrode_m = 0.003
axis_scale = [1.0, 1.0, -1.0]
"""
NETFT = """
[finger.{name}.wrench]
device = "netft"
port = "{port}"
rate_hz = 1000.0
options = {{ calibration = "config" }}
"""

Handler = Callable[[socket.socket], None]


class Peers:
    """Servers of hostile devices, each in a thread, for the duration of ``with``."""

    def __init__(self) -> None:
        self._stop = threading.Event()
        self._stack = ExitStack()
        self.served: dict[str, int] = {}

    def __enter__(self) -> Peers:
        return self

    def __exit__(self, *error: object) -> None:
        self._stop.set()
        self._stack.close()

    @property
    def going_on(self) -> bool:
        return not self._stop.is_set()

    def tcp(self, name: str, handle: Handler) -> str:
        server = self._stack.enter_context(socket.create_server(("127.0.0.1", 0)))
        server.settimeout(0.2)
        self._run(lambda: self._serve(name, server, handle))
        return f"ws://127.0.0.1:{server.getsockname()[1]}"

    def websocket(self, name: str, handle: Handler) -> str:
        def shake_hands(client: socket.socket) -> None:
            heard = b""
            while not heard.endswith(b"\r\n\r\n") and (more := client.recv(4096)):
                heard += more
            key = re.search(rb"Sec-WebSocket-Key: (.*)\r", heard)
            if key is None:  # the daemon ended meanwhile
                return
            accept = base64.b64encode(hashlib.sha1(key[1] + b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11").digest())
            answer = b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            client.sendall(answer + b"Sec-WebSocket-Accept: " + accept + b"\r\n\r\n")
            handle(client)

        return self.tcp(name, shake_hands)

    def udp(self, datagram: bytes) -> str:
        device = self._stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        device.bind(("127.0.0.1", 0))
        device.settimeout(0.2)

        def flood() -> None:
            peer = None
            while self.going_on:
                try:
                    if peer is None:
                        _, peer = device.recvfrom(100)
                    device.sendto(datagram, peer)
                except OSError:
                    time.sleep(0.01)

        self._run(flood)
        return f"udp://127.0.0.1:{device.getsockname()[1]}"

    def _serve(self, name: str, server: socket.socket, handle: Handler) -> None:
        while self.going_on:
            try:
                client, _ = server.accept()
            except OSError:
                continue
            self.served[name] = self.served.get(name, 0) + 1
            with client:
                client.settimeout(0.5)
                with suppress(OSError):
                    handle(client)

    def _run(self, work: Callable[[], None]) -> None:
        thread = threading.Thread(target=work)
        thread.start()
        self._stack.callback(thread.join)


def frame(payload: bytes, opcode: int = 0x81) -> bytes:
    size = bytes((len(payload),)) if len(payload) < 126 else struct.pack(">BH", 126, len(payload))
    return bytes((opcode,)) + size + payload


def flood(peers: Peers, data: bytes) -> Handler:
    def handle(client: socket.socket) -> None:
        while peers.going_on:
            client.sendall(data)

    return handle


def closes(client: socket.socket) -> None:
    """Close with a different reason each time, which looks like a line of the log."""
    reason = f"bye\nERROR forged: {time.monotonic_ns()}".encode()
    client.sendall(frame(b"x") + frame(struct.pack(">H", 1000) + reason, 0x88))
    time.sleep(0.01)


def answers_at_length(client: socket.socket) -> None:
    client.recv(4096)
    client.sendall(b"HTTP/1.1 503 no\x1b[31m" + b"%d" % time.monotonic_ns() + b"\r\nServer: " + b"x" * 8000)


def hostile(peers: Peers) -> Iterator[tuple[str, str]]:
    """Yield name and table of each device."""
    numbers = b'{"message":1,"1":{"taxels":3500,"calibrated":[' + b".5," * 10_000 + b".5]}}"
    floods = {
        "numbers": frame(numbers),
        "digits": frame(b'{"message":1}') + frame(b'{"message":1' + b"0" * 4000 + b"}"),
        "braces": frame(b"{" * 30_000),
        "tiny": frame(b"{") * 10_000,
        "pings": frame(bytes(125), 0x89) * 1000,
        "fragments": frame(b"", 0x01) + frame(b"", 0x00) * 10_000,
    }
    for name, data in floods.items():
        yield name, XELA.format(name=name, port=peers.websocket(name, flood(peers, data)))
    yield "closes", XELA.format(name="closes", port=peers.websocket("closes", closes))
    yield "talks", XELA.format(name="talks", port=peers.tcp("talks", answers_at_length))
    yield "garbage", NETFT.format(name="garbage", port=peers.udp(bytes(range(256)) * 250))


def size_mb(process: subprocess.Popen[str]) -> float:
    status = Path(f"/proc/{process.pid}/status").read_text(encoding="utf-8")
    found = re.search(r"VmRSS:\s+(\d+) kB", status)
    assert found is not None
    return int(found[1]) / 1024


@pytest.fixture
def sensor(tmp_path: Path) -> Iterator[Device]:
    device = Device(tmp_path / "good")
    device.plug()
    yield device
    device.unplug()


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_no_device_stops_the_daemon_or_the_others(
    sensor: Device, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLIPD_RUNTIME_DIR", str(tmp_path / "run"))
    log = tmp_path / "log"
    with Peers() as peers, log.open("w", encoding="utf-8") as errors:
        tables = dict(hostile(peers))
        rig = tmp_path / "rig.toml"
        rig.write_text(GOOD.format(port=sensor.path) + "".join(tables.values()), encoding="utf-8")
        rig.chmod(0o600)
        daemon = subprocess.Popen(
            [SLIPD, "run", "--config", str(rig)], stdout=subprocess.PIPE, stderr=errors, text=True
        )
        try:
            assert daemon.stdout is not None
            endpoints = Endpoints(*(daemon.stdout.readline().split()[-1] for _ in range(2)))
            status, before_mb, after_mb = watch(daemon, endpoints, sensor, peers)
            daemon.send_signal(signal.SIGTERM)
            assert daemon.wait(PATIENCE_S) == 0
        finally:
            daemon.kill()
            daemon.wait()
            assert daemon.stdout is not None
            daemon.stdout.close()
    assert after_mb - before_mb <= MOST_GROWTH_MB
    for stream in status["streams"].values():
        assert len(stream["message"]) <= LONGEST + 30
        assert stream["message"].isprintable()
    lines = log.read_text(encoding="utf-8").splitlines()
    assert len(lines) <= MOST_LINES
    assert all(line.startswith(("INFO slipd.", "WARNING slipd.")) and len(line) < LONGEST + 200 for line in lines)


def explained(status: dict[str, Any]) -> bool:
    """Return whether the message of a device that sends garbage says so, and no longer that the daemon was late."""
    message: str = status["streams"]["garbage.wrench"]["message"]
    return message.startswith("bytes arrive, none is a record of a Net F/T: is udp://127.0.0.1:")


def watch(
    daemon: subprocess.Popen[str], endpoints: Endpoints, sensor: Device, peers: Peers
) -> tuple[dict[str, Any], float, float]:
    """Feed the good sensor for a while; return the last status, and the sizes before and after."""
    client = Client(endpoints)
    begin_s = time.monotonic()
    before_mb = 0.0
    try:
        while True:
            sensor.send_wrench()
            time.sleep(0.01)
            readings, told = len(client.hear("wrench.good")), client.hear("status")
            if told and not before_mb:
                before_mb = size_mb(daemon)
            passed_s = time.monotonic() - begin_s
            served = len(peers.served) == SERVERS
            if readings > MANY and told and passed_s > HOSTILE_S and served and explained(told[-1]):
                return told[-1], before_mb, size_mb(daemon)
            assert passed_s < PATIENCE_S
            assert daemon.poll() is None
    finally:
        client.close()
