"""All devices of the bed in one process: ``python -m bed.devices PLAN``, a JSON list of (device, address)."""

from __future__ import annotations

import asyncio
import json
import sys

from slipd.sim.emulate import emulator_for, serve_until_told

if __name__ == "__main__":
    plan = json.loads(sys.argv[1])
    asyncio.run(serve_until_told([(name, emulator_for(name, address, 1), address) for name, address in plan]))
