"""``slipctl serve foxglove``: serve the messages to viewers until interrupted, or write layouts for them."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from slipd_client.errors import CallError, Silence
from slipd_client.serving import follow, pads_of, read_config
from slipd_client.subscriber import Subscriber
from slipd_client.viewers import layouts
from slipd_client.viewers.layouts import Levels
from slipd_client.viewers.viewer_server import ViewerServer

if TYPE_CHECKING:
    from slipd_client.arguments import ListenAddress
    from slipd_client.keys import Keys


def run(chosen: argparse.Namespace, keys: Keys | None) -> None:
    """Carry out the command.

    Raises:
        CallError: An argument is wrong, a file cannot be read or written, or foxglove-sdk is not installed.
    """
    if chosen.write_layouts is not None:
        for path in layouts.write(chosen.write_layouts, chosen.fingers, levels_of(chosen.config)):
            print(path)
        return
    pads = None if chosen.config is None else pads_of(chosen.config)
    listen: ListenAddress = chosen.listen
    with Subscriber(chosen.publish, ("",), keys=keys) as subscriber:
        server = ViewerServer(listen.host, listen.port, pads)
        try:
            print(f"foxglove: ws:{listen.url(server.port).removeprefix('http:').rstrip('/')}", flush=True)
            if not listen.loopback:
                print(f"slipctl: every program that reaches port {server.port} can read every message", file=sys.stderr)
            _serve(subscriber, server)
        finally:
            server.stop()


def _serve(subscriber: Subscriber, server: ViewerServer) -> None:
    silent = False
    for arrived in follow(subscriber, idle=lambda: not server.watched):
        if isinstance(arrived, Silence):
            if not silent:
                server.silent(str(arrived))
            silent = True
            continue
        if silent:
            server.alive()
        silent = False
        if arrived.restarted:
            server.restart()
        server.publish(arrived.topic, arrived.raw)


def levels_of(path: Path | None) -> Levels:
    """Return the levels of a config of the daemon; its defaults without a config.

    Raises:
        CallError: The file cannot be read, or its levels are not numbers.
    """
    stated = {} if path is None else read_config(path).get("levels", {})
    given = {name: stated[name] for name in ("caution", "warning") if name in stated}
    if not all(type(value) in (int, float) for value in given.values()):
        raise CallError(f"{path}: caution and warning of [levels] must be numbers; check it: slipd check")
    return Levels(**given) if path is None else Levels(**given, origin=path.name)
