"""Arguments of ``slipctl viewers`` and ``slipctl relay``."""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from slipd_client.argument_types import Add
from slipd_client.listen_address import parse_listen

VIEWERS_LISTEN = "127.0.0.1:8765"
"""The port that Foxglove proposes."""

RELAY_LISTEN = "tcp://127.0.0.1:9872"
"""The port that PlotJuggler proposes."""


def add_viewers(add: Add) -> None:
    """Add both commands; ``add`` adds a command, given its name and help text."""
    viewers = add("viewers", "serve live messages to Foxglove, Lichtblick and PlotJuggler (docs/viewers.md)")
    viewers.add_argument(
        "--listen",
        type=parse_listen,
        default=VIEWERS_LISTEN,
        metavar="HOST:PORT",
        help="where to serve (default: %(default)s; port 0: any); who reaches it can read everything",
    )
    viewers.add_argument(
        "--config",
        type=Path,
        metavar="FILE",
        help="config of the daemon: the places of its pads become /tf, its levels the lines of the layouts",
    )
    viewers.add_argument(
        "--write-layouts", type=Path, metavar="FOLDER", help="write layouts for these viewers and exit"
    )
    viewers.add_argument(
        "--fingers",
        nargs="+",
        type=_finger,
        default=["left", "right"],
        metavar="NAME",
        help="fingers of the layouts (default: left right)",
    )
    relay = add("relay", "publish the messages on a TCP port of this machine, for PlotJuggler's ZeroMQ source")
    relay.add_argument(
        "--listen",
        default=RELAY_LISTEN,
        metavar="ENDPOINT",
        help="where to publish (default: %(default)s; port *: any)",
    )
    relay.add_argument(
        "--time-frame",
        action="store_true",
        help="add the time as a third frame: PlotJuggler 4 wants it, a third frame breaks PlotJuggler 3",
    )


def _finger(text: str) -> str:
    if not re.fullmatch("[a-z0-9]{1,32}", text):
        raise argparse.ArgumentTypeError(f"must be the name of a finger, a-z and 0-9, got {text!r:.80}")
    return text
