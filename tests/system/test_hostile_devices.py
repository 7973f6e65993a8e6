"""A daemon with hostile devices keeps running, keeps its size, logs few lines, and ends in good order."""

from __future__ import annotations

import re
import socket
import struct
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

from daemon_peers import PATIENCE_S, Device, until
from service_rig import started
from websockets.sync.server import ServerConnection, serve

from slipd.types.device_text import LONGEST

HOSTILE_S = 2.0
MOST_GROWTH_MB = 50
MOST_LINES = 200
MANY = 50
SERVERS = 7

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
    """Servers of hostile devices, in threads of their own, for the duration of ``with``.

    Attributes:
        served: Names of the devices to which the daemon has connected.
    """

    def __init__(self) -> None:
        self._ended = threading.Event()
        self._stack = ExitStack()
        self.served: set[str] = set()

    def __enter__(self) -> Peers:
        return self

    def __exit__(self, *error: object) -> None:
        self._ended.set()
        self._stack.close()

    def websocket(self, name: str, handle: Handler) -> str:
        """Serve what a handler does with a connection after the handshake; return the address."""

        def meet(connection: ServerConnection) -> None:
            self._serve(name, handle, connection.socket)

        server = self._stack.enter_context(serve(meet, "127.0.0.1", 0, compression=None))
        threading.Thread(target=server.serve_forever).start()
        return f"ws://127.0.0.1:{server.socket.getsockname()[1]}"

    def udp(self, datagram: bytes) -> str:
        """Answer the first datagram with a flood; return the address."""
        device = self._stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        device.bind(("127.0.0.1", 0))

        def flood() -> None:
            _, peer = device.recvfrom(100)
            while not self._ended.is_set():
                with suppress(OSError):
                    device.sendto(datagram, peer)

        threading.Thread(target=flood, daemon=True).start()
        return f"udp://127.0.0.1:{device.getsockname()[1]}"

    def flood(self, data: bytes) -> Handler:
        def handle(client: socket.socket) -> None:
            while not self._ended.is_set():
                client.sendall(data)

        return handle

    def _serve(self, name: str, handle: Handler, client: socket.socket, *_: object) -> None:
        self.served.add(name)
        client.settimeout(0.5)
        with suppress(OSError):
            handle(client)


def frame(payload: bytes, opcode: int = 0x81) -> bytes:
    size = bytes((len(payload),)) if len(payload) < 126 else struct.pack(">BH", 126, len(payload))
    return bytes((opcode,)) + size + payload


def closes(client: socket.socket) -> None:
    """Close with a different reason each time, which looks like a line of the log."""
    reason = f"bye\nERROR forged: {time.monotonic_ns()}".encode()
    client.sendall(frame(b"x") + frame(struct.pack(">H", 1000) + reason, 0x88))
    time.sleep(0.01)


def hostile(peers: Peers) -> Iterator[str]:
    """Yield the table of each device."""
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
        yield XELA.format(name=name, port=peers.websocket(name, peers.flood(data)))
    yield XELA.format(name="closes", port=peers.websocket("closes", closes))
    yield NETFT.format(name="garbage", port=peers.udp(bytes(range(256)) * 250))


def size_mb(process: subprocess.Popen[str]) -> float:
    (size_kb,) = re.findall(r"VmRSS:\s+(\d+) kB", Path(f"/proc/{process.pid}/status").read_text(encoding="utf-8"))
    return int(size_kb) / 1024


def explained(status: dict[str, Any]) -> bool:
    """Return whether the message of a device that sends garbage says so, and no longer that the daemon was late."""
    message: str = status["streams"]["garbage.wrench"]["message"]
    return message.startswith("bytes arrive, none is a record of a Net F/T: is udp://127.0.0.1:")


async def test_no_device_stops_the_daemon_or_the_others(tmp_path: Path, runtime: Path) -> None:
    sensor, log, rig = Device(tmp_path / "good"), tmp_path / "log", tmp_path / "rig.toml"
    with Peers() as peers, log.open("w", encoding="utf-8") as errors:
        rig.write_text(GOOD.format(port=sensor.path) + "".join(hostile(peers)), encoding="utf-8")
        with started(rig, stderr=errors) as (daemon, client):
            await until(lambda: client.hear("status"), sensor.send_wrench)
            before_mb, until_s = size_mb(daemon), time.monotonic() + HOSTILE_S
            await until(lambda: time.monotonic() > until_s and len(peers.served) == SERVERS, sensor.send_wrench)
            await until(lambda: len(client.hear("wrench.good")) > MANY, sensor.send_wrench)
            await until(lambda: explained(client.newest("status")), sensor.send_wrench)
            status, growth_mb = client.newest("status"), size_mb(daemon) - before_mb
            daemon.terminate()
            assert daemon.wait(PATIENCE_S) == 0
    sensor.unplug()
    assert growth_mb <= MOST_GROWTH_MB
    messages = [stream["message"] for stream in status["streams"].values()]
    assert [text for text in messages if len(text) > LONGEST + 30 or not text.isprintable()] == []
    lines = log.read_text(encoding="utf-8").splitlines()
    assert len(lines) <= MOST_LINES
    assert all(line.startswith(("INFO slipd.", "WARNING slipd.")) and len(line) < LONGEST + 200 for line in lines)
