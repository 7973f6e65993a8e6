"""Read the sensors of two fingers and discard the bytes: the baseline for the daemon's processor time.

``python -m soak.reading PLAN``, a JSON list of (force, pad) addresses; an event loop and a callback for each line.
"""

from __future__ import annotations

import asyncio
import json
import os
import signal
import socket
import sys
import tty
from urllib.parse import urlsplit

from slipd.devices.shared import rdt_records as rdt

READ_BYTES = 65_536


async def read(fingers: list[tuple[str, str]]) -> None:
    """Read until SIGTERM."""
    loop, stop = asyncio.get_running_loop(), asyncio.Event()
    loop.add_signal_handler(signal.SIGTERM, stop.set)
    for force_at, pad_at in fingers:
        where = urlsplit(force_at)
        line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        line.setblocking(False)
        line.connect((where.hostname, where.port))
        line.send(rdt.encode_request(rdt.START_BUFFERED))
        port = os.open(pad_at, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(port)
        loop.add_reader(line, line.recv, READ_BYTES)
        loop.add_reader(port, os.read, port, READ_BYTES)
    print("reading", flush=True)
    await stop.wait()


if __name__ == "__main__":
    asyncio.run(read(json.loads(sys.argv[1])))
