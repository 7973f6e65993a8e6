"""Arguments of ``slipctl bridge`` and ``slipctl fleet``."""

from __future__ import annotations

import argparse
import re
import socket
from pathlib import Path

from slipd_client.argument_types import Add, rate_hz
from slipd_client.errors import CallError
from slipd_client.fleet.fleet_keys import check_name
from slipd_client.listen_address import DEFAULT_LISTEN, parse_listen
from slipd_client.messages.schema.topics import TOPICS

FLEET = "slipd"
"""Name of the fleet where none is given."""

RATE_HZ = 10.0
"""Most messages per second of each topic but ``warning``, where nothing else is given."""

ENDPOINT = "tcp/10.0.0.1:7447"

_ON_NETWORK = re.compile(r"(tcp|udp|tls|quic|ws)/(\[[0-9A-Fa-f:.%]+\]|[^/:\[\]\s]+):(?P<port>\d{1,5})([?#]\S*)?")
_ON_MACHINE = re.compile(r"unixsock-stream/\S+")


def add_bridge(add: Add) -> None:
    """Add the command ``bridge``; ``add`` adds a command, given its name and help text."""
    bridge = add("bridge", "publish the messages of this robot to its fleet over Zenoh (docs/fleet.md)")
    bridge.add_argument(
        "--robot", type=_name, default=_host(), metavar="NAME", help="name of the robot (default: %(default)s)"
    )
    _add_reach(bridge, "accept connections there, instead of a router's")
    bridge.add_argument(
        "--rate",
        type=_rate_or_all,
        default=RATE_HZ,
        metavar="HZ",
        help='most messages per second of each topic but warning, of which all are sent; "all" for no bound '
        "(default: %(default)g)",
    )
    bridge.add_argument(
        "--topics",
        nargs="+",
        choices=tuple(TOPICS),
        metavar="WORD",
        help=f"publish these topics only, of {', '.join(TOPICS)}; warning and status always are (default: all)",
    )


def add_fleet(add: Add) -> None:
    """Add the command ``fleet``."""
    fleet = add("fleet", "show level, health and age of every robot of a fleet (docs/fleet.md)")
    _add_reach(fleet, "be the router that bridges connect to")
    how = fleet.add_mutually_exclusive_group()
    how.add_argument("--once", action="store_true", help="show the fleet once and exit")
    how.add_argument(
        "--page",
        type=parse_listen,
        nargs="?",
        const=DEFAULT_LISTEN,
        metavar="HOST:PORT",
        help=f"serve it to browsers instead; prints the address of the page (default: {DEFAULT_LISTEN})",
    )
    fleet.add_argument("--json", action="store_true", help="print the fleet as JSON, once a second")
    fleet.add_argument(
        "--robots",
        type=_name,
        nargs="+",
        default=[],
        metavar="NAME",
        help="the robots of this fleet: they come first, also before they were ever heard, and are never displaced",
    )


def _add_reach(command: argparse.ArgumentParser, listening: str) -> None:
    command.add_argument(
        "--fleet", type=_name, default=FLEET, metavar="NAME", help="name of the fleet (default: %(default)s)"
    )
    command.add_argument(
        "--connect",
        type=_endpoint,
        action="append",
        default=[],
        metavar="ENDPOINT",
        help=f"connect to a Zenoh router there, e.g. {ENDPOINT}; may be repeated",
    )
    command.add_argument(
        "--listen",
        type=_endpoint,
        action="append",
        default=[],
        metavar="ENDPOINT",
        help=f"{listening}, e.g. tcp/0.0.0.0:7447",
    )
    command.add_argument(
        "--zenoh-config",
        type=Path,
        metavar="FILE",
        help="configuration of Zenoh (JSON5), for TLS and access control; --connect and --listen outrank it",
    )


def _host() -> str:
    """Return the name of this machine, without its domain."""
    return socket.gethostname().partition(".")[0]


def _name(text: str) -> str:
    try:
        return check_name("the name", text)
    except CallError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _endpoint(text: str) -> str:
    """Return an endpoint of Zenoh, which itself waits for ever for one that can never be reached."""
    found = _ON_NETWORK.fullmatch(text)
    if not (found and int(found["port"]) <= 65535) and not _ON_MACHINE.fullmatch(text):
        raise argparse.ArgumentTypeError(
            f"must be like {ENDPOINT}, with one of tcp, udp, tls, quic and ws, or like unixsock-stream/PATH, "
            f"got {text!r:.80}"
        )
    return text


def _rate_or_all(text: str) -> float | None:
    if text == "all":
        return None
    try:
        return rate_hz(text)
    except argparse.ArgumentTypeError as error:
        raise argparse.ArgumentTypeError(f'{error}; "all" sets no bound') from None
