"""``slipctl fleet --page``: the robots of a fleet in a browser, which asks for them twice a second. It only shows."""

from __future__ import annotations

import asyncio
import time

from websockets.http11 import Response

from slipd_client.arguments import ListenAddress
from slipd_client.fleet.fleet_command import fleet_map
from slipd_client.fleet.fleet_listener import FleetListener
from slipd_client.page.page_server import PageServer, Site, json_answer

TAKE_S = 0.1
"""Time between two updates of the state, s."""

FLEET_DATA = "/data/fleet.json"


async def serve(fleet: str, listener: FleetListener, address: ListenAddress) -> None:
    """Serve the page until the task is cancelled, and print its address.

    Args:
        fleet: Name of the fleet.
        listener: Receives its messages.
        address: Where to serve.

    Raises:
        CallError: The port cannot be opened.
    """

    def on_data(path: str) -> Response | None:
        if path != FLEET_DATA:
            return None
        return json_answer(fleet_map(fleet, listener.state.rows(time.monotonic()), listener.state.unread))

    site = Site({"live": True, "source": fleet}, start="fleet.html")
    async with PageServer(address, site, on_data=on_data).serving() as url:
        print(f"fleet: {url}", flush=True)
        while True:
            listener.take(0)
            await asyncio.sleep(TAKE_S)
