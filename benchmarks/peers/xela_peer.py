"""An independent WebSocket client as the host of the emulated XELA server."""

from __future__ import annotations

import json
from pathlib import Path

import websocket
from peers.comparison import Comparison
from peers.emulation import device_at

from slipd.tools.sim.emulated_pads import REST_COUNTS, TAXELS, USKINS

PORT = 15_907
NOISE_COUNTS = 15
"""Five times the noise of the emulated pads."""


def compare(folder: Path) -> Comparison:
    """Read messages of the emulated server."""
    found = Comparison("xela", "websocket-client", "a WebSocket client reads the emulated server")
    with device_at("xela", f"ws://127.0.0.1:{PORT}"):
        link = websocket.create_connection(f"ws://127.0.0.1:{PORT}", timeout=5.0)
        found.check("welcome", list(json.loads(link.recv())), ["message"])
        messages = [json.loads(link.recv()) for _ in range(20)]
        link.close()
    numbers = [message["message"] for message in messages]
    found.check("message numbers", numbers, list(range(numbers[0], numbers[0] + len(numbers))))
    for sensor in USKINS:
        pad = messages[-1][sensor]
        counts = [int(axis, 16) for axis in pad["data"].split(",")]
        found.check_near(f"counts of pad {sensor}", counts, [REST_COUNTS] * (3 * TAXELS), NOISE_COUNTS)
    found.open.append("the content of the messages: the maker's server is closed and has no package")
    return found
