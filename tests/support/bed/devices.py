"""All devices of the bed in one process: ``python -m bed.devices PLAN``, a JSON list of (device, address)."""

from __future__ import annotations

import asyncio
import json
import sys

from bed.rig import make_device

from slipd.tools.sim.emulate import prepare_process, serve_until_ended

if __name__ == "__main__":
    plan = [(name, make_device(name, address), address) for name, address in json.loads(sys.argv[1])]
    prepare_process()
    asyncio.run(serve_until_ended(plan))
