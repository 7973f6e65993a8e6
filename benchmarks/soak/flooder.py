"""The end of a device that floods, in a process of its own: ``python -m soak.flooder KIND RATE_HZ PATH``.

KIND is "frames" (a Bota's) or "noise" (random bytes); RATE_HZ 0 writes as fast as the line takes it. Writes to a
pseudo-terminal it makes at PATH, until standard input closes; then prints how many frames the line took.
"""

from __future__ import annotations

import os
import random
import select
import sys
import time
from pathlib import Path

from slipd.devices import bota
from slipd.tools.sim.device_line import PtyLine
from slipd.tools.sim.emulate import prepare_process

CHUNK = 64
"""Frames a write at most; where the line takes no more, the flood pauses for a moment."""


def main() -> None:
    """Flood."""
    kind, rate_hz, path = sys.argv[1], float(sys.argv[2]), Path(sys.argv[3])
    frames = [bota.encode_frame((1.0, 2.0, 3.0), (0.0, 0.0, 0.0), n * 1000) for n in range(4096)]
    size = len(frames[0])
    if kind == "noise":
        frames = [random.Random(n).randbytes(size) for n in range(4096)]
    port = PtyLine(path)
    poll = select.poll()
    poll.register(0, select.POLLIN)
    prepare_process()
    print("ready", flush=True)
    begin_ns, sent, offered = time.monotonic_ns(), 0, 0
    while True:
        if poll.poll(0) and not os.read(0, 100):
            break
        port.listen()
        due = round((time.monotonic_ns() - begin_ns) * 1e-9 * rate_hz) if rate_hz else sent + CHUNK
        count, whole = min(due - sent, CHUNK), False
        if count > 0:
            before = port.dropped
            port.send([frames[(sent + n) % len(frames)] for n in range(count)])
            offered += count * size - (port.dropped - before)
            sent += count
            whole = port.dropped == before
        if not whole:
            time.sleep(0.0005)
    port.close()
    print(offered // size, flush=True)


if __name__ == "__main__":
    main()
