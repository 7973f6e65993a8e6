"""A daemon with hostile devices keeps running, keeps its size, logs few lines, and ends in good order."""

from __future__ import annotations

import re
import socket
import struct
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path

from daemon_peers import Device
from loop_waits import PATIENCE_S, eventually
from service_rig import started
from websockets.sync.server import ServerConnection, serve

from slipd.errors import LONGEST_TEXT

HOSTILE_S = 2.0
MOST_GROWTH_MB = 50
MOST_LINES = 200
MANY = 50

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


def frame(payload: bytes, opcode: int = 0x81) -> bytes:
    size = bytes((len(payload),)) if len(payload) < 126 else struct.pack(">BH", 126, len(payload))
    return bytes((opcode,)) + size + payload


NUMBERS = b'{"message":1,"1":{"taxels":3500,"calibrated":[' + b".5," * 10_000 + b".5]}}"
FLOODS = {
    "numbers": frame(NUMBERS),
    "digits": frame(b'{"message":1}') + frame(b'{"message":1' + b"0" * 4000 + b"}"),
    "braces": frame(b"{" * 30_000),
    "tiny": frame(b"{") * 10_000,
    "pings": frame(bytes(125), 0x89) * 1000,
    "fragments": frame(b"", 0x01) + frame(b"", 0x00) * 10_000,
}
"""What devices with a WebSocket send again and again."""


def farewell() -> bytes:
    """Return a frame that ends the connection, each time with another reason that looks like a line of the log."""
    return frame(struct.pack(">H", 1000) + f"bye\nERROR forged: {time.monotonic_ns()}".encode(), 0x88)


@contextmanager
def hostile_devices() -> Iterator[tuple[str, set[str]]]:
    """Serve hostile devices; yield their tables, and the names of those to which the daemon has connected."""
    ended = threading.Event()
    served: set[str] = set()

    def flood(name: str, connection: ServerConnection) -> None:
        served.add(name)
        connection.socket.settimeout(0.5)
        with suppress(OSError):
            while not ended.is_set():
                connection.socket.sendall(FLOODS.get(name) or farewell())

    def flood_datagrams(device: socket.socket) -> None:
        _, peer = device.recvfrom(100)
        while not ended.is_set():
            with suppress(OSError):
                device.sendto(bytes(range(256)) * 250, peer)

    with ExitStack() as stack, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as device:
        device.bind(("127.0.0.1", 0))
        threading.Thread(target=flood_datagrams, args=(device,), daemon=True).start()
        tables = NETFT.format(name="garbage", port=f"udp://127.0.0.1:{device.getsockname()[1]}")
        for name in (*FLOODS, "farewell"):
            server = stack.enter_context(serve(partial(flood, name), "127.0.0.1", 0, compression=None))
            threading.Thread(target=server.serve_forever).start()
            tables += XELA.format(name=name, port=f"ws://127.0.0.1:{server.socket.getsockname()[1]}")
        stack.callback(ended.set)
        yield tables, served


def size_mb(process: subprocess.Popen[str]) -> float:
    (size_kb,) = re.findall(r"VmRSS:\s+(\d+) kB", Path(f"/proc/{process.pid}/status").read_text(encoding="utf-8"))
    return int(size_kb) / 1024


async def test_no_device_stops_the_daemon_or_the_others(tmp_path: Path, runtime: Path) -> None:
    sensor, log, rig = Device(tmp_path / "good"), tmp_path / "log", tmp_path / "rig.toml"
    with hostile_devices() as (tables, served), log.open("w", encoding="utf-8") as errors:
        rig.write_text(GOOD.format(port=sensor.path) + tables, encoding="utf-8")
        with started(rig, stderr=errors) as (daemon, client):
            await eventually(lambda: client.hear("status"), sensor.send_wrench)
            before_mb, until_s = size_mb(daemon), time.monotonic() + HOSTILE_S
            await eventually(lambda: time.monotonic() > until_s and len(served) > len(FLOODS), sensor.send_wrench)
            await eventually(lambda: len(client.hear("wrench.good")) > MANY, sensor.send_wrench)
            found = "bytes arrive, none is a record of a Net F/T: is udp://127.0.0.1:"  # and no longer: it was late
            await eventually(
                lambda: client.newest("status")["streams"]["garbage.wrench"]["message"].startswith(found),
                sensor.send_wrench,
            )
            status, growth_mb = client.newest("status"), size_mb(daemon) - before_mb
            daemon.terminate()
            assert daemon.wait(PATIENCE_S) == 0
    sensor.unplug()
    assert growth_mb <= MOST_GROWTH_MB
    messages = [stream["message"] for stream in status["streams"].values()]
    assert [text for text in messages if len(text) > LONGEST_TEXT + 30 or not text.isprintable()] == []
    lines = log.read_text(encoding="utf-8").splitlines()
    assert len(lines) <= MOST_LINES
    assert all(line.startswith(("INFO slipd.", "WARNING slipd.")) and len(line) < LONGEST_TEXT + 200 for line in lines)
