"""An emulated force sensor in a process of its own, until standard input ends: ``python -m soak.calm_sensor PATH``."""

from __future__ import annotations

import asyncio
import sys

from slipd.tools.sim.emulate import prepare_process, serve_until_ended
from slipd.tools.sim.emulators import make_emulator

if __name__ == "__main__":
    sensor = make_emulator("bota")
    prepare_process()
    asyncio.run(serve_until_ended([("bota", sensor, sys.argv[1])], ready=lambda: print("ready", flush=True)))
