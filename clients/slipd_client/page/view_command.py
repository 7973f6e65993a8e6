"""``slipctl view``: shows a running slipd in a browser."""

from __future__ import annotations

import argparse
import asyncio
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from slipd_client.arguments import ListenAddress
from slipd_client.errors import CallError
from slipd_client.page.commission_page import CommissionPage
from slipd_client.page.emulated_hand import EmulatedHand
from slipd_client.page.live_feed import LiveFeed
from slipd_client.page.page_server import PageServer, Site
from slipd_client.page.requests_of_page import ADJUST_N, PageRequests
from slipd_client.paths import publish_endpoint

if TYPE_CHECKING:
    from slipd_client.keys import Keys


def run(chosen: argparse.Namespace, keys: Keys | None) -> None:
    """Carry out the command until interrupted.

    Raises:
        CallError: The config is missing; see `view`.
    """
    if chosen.config is not None and not chosen.config.is_file():
        raise CallError(f"{chosen.config}: there is no such file")
    named = {"--publish": chosen.publish, "--requests": chosen.requests}
    named |= {"--key": chosen.key, "--server-key": chosen.server_key}
    guide = CommissionPage(chosen.config, [part for each in named.items() if each[1] is not None for part in each])
    options = {"keys": keys, "buttons": chosen.buttons, "emulation": chosen.emulation, "commission": guide}
    asyncio.run(view(chosen.publish, chosen.requests, chosen.listen, **options))


async def view(
    publish: str | None,
    requests: str | None,
    address: ListenAddress,
    *,
    keys: Keys | None = None,
    buttons: bool | None = None,
    emulation: Path | None = None,
    commission: CommissionPage | None = None,
) -> None:
    """Serve the page of a running slipd until the task is cancelled, and print its address.

    Args:
        publish: Endpoint on which slipd publishes; its default when None.
        requests: Endpoint on which it accepts requests, likewise.
        address: Where to serve the page.
        keys: Keys of this client, for a daemon across a network; None on this machine.
        buttons: The page may request; None: only where no other machine can open it.
        emulation: Folder of a running ``slipd emulate``, whose pads can be pressed on the page; None: no pad can.
        commission: Serves the page ``/commission``; None: the live view has no such page.

    Raises:
        CallError: An endpoint is wrong, the port cannot be opened, or a page that only shows is to press pads.
    """
    allowed = address.loopback if buttons is None else buttons
    if emulation is not None and not allowed:
        raise CallError("--emulation needs a page with buttons: add --buttons, or serve it on this machine only")
    where = publish_endpoint() if publish is None else publish
    hand = None if emulation is None else EmulatedHand(emulation)
    feed = LiveFeed(where, PageRequests(requests, keys) if allowed else None, keys, hand)
    guide = commission.view if commission is not None and allowed else None
    site = Site({"live": True, "source": where, "buttons": allowed, "adjust_n": ADJUST_N})
    async with PageServer(address, site, feed.view, on_commission=guide).serving() as url:
        print(f"view: {url}", flush=True)
        if hand is not None and not hand.path.exists():
            print(f"no emulation runs in {emulation} yet: slipd emulate CONFIG --dir {emulation}", file=sys.stderr)
        await feed.run()
