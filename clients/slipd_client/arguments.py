"""Parts of the parsers of ``slipctl`` and ``slipd``: types of arguments, and the address where a server listens."""

from __future__ import annotations

import argparse
import ipaddress
import math
import re
import socket
from collections.abc import Callable
from dataclasses import dataclass

Add = Callable[[str, str], argparse.ArgumentParser]
"""Adds a command, given its name and help text."""

DEFAULT_LISTEN = "127.0.0.1:8710"

_LISTEN = re.compile(r"(?P<host>\[[0-9A-Fa-f:.]+\]|[^:\[\]\s]+):(?P<port>\d{1,5})")
_HOST = re.compile(r"(?P<host>\[[0-9A-Fa-f:.]+\]|[^:\[\]\s/@]+)(:\d{1,5})?")


@dataclass(frozen=True)
class ListenAddress:
    """An address of this machine, and a port on it.

    Attributes:
        host: A name or an IP address, without brackets.
        port: The port; 0 is any that is free.
    """

    host: str
    port: int

    @property
    def loopback(self) -> bool:
        """Only programs on this machine can connect."""
        literal = _ip(self.host)
        return self.host == "localhost" if literal is None else literal.is_loopback

    def url(self, port: int) -> str:
        """Return the address for a browser, with the port in use."""
        literal = _ip(self.host)
        host = self.host if literal is None or not literal.is_unspecified else socket.gethostname()
        return f"http://[{host}]:{port}/" if ":" in host else f"http://{host}:{port}/"

    def allows(self, host_header: str) -> bool:
        """Return whether a browser may use this ``Host``: an IP address, or a name of this machine.

        A page of another site can point a name of its own at this machine (DNS rebinding), but neither an IP address
        nor a name of the machine.
        """
        found = _HOST.fullmatch(host_header)
        if found is None:
            return False
        host = found["host"].strip("[]").lower()
        own = socket.gethostname().lower()
        return _ip(host) is not None or host in ("localhost", self.host.lower(), own, f"{own}.local")


def parse_listen(text: str) -> ListenAddress:
    """Return the address that ``HOST:PORT`` names.

    Raises:
        argparse.ArgumentTypeError: It is not an address with a port.
    """
    found = _LISTEN.fullmatch(text)
    if found is None or int(found["port"]) > 65535:
        raise argparse.ArgumentTypeError(f"must be HOST:PORT, e.g. {DEFAULT_LISTEN}, got {text!r:.80}")
    return ListenAddress(found["host"].strip("[]"), int(found["port"]))


def add_listen(parser: argparse.ArgumentParser) -> None:
    """Add the argument ``--listen`` to a command that serves the page."""
    parser.add_argument(
        "--listen",
        type=parse_listen,
        default=DEFAULT_LISTEN,
        metavar="HOST:PORT",
        help="where to serve the page (default: %(default)s; port 0: any free one)",
    )


def finite(text: str) -> float:
    """Return a finite number."""
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be a number, got {text!r:.80}") from None
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"must be finite, got {text}")
    return value


def rate_hz(text: str) -> float:
    """Return a rate of 0.001 to 1e6 Hz."""
    value = finite(text)
    if not 0.001 <= value <= 1e6:
        raise argparse.ArgumentTypeError(f"must be from 0.001 to 1e6 Hz, got {text}")
    return value


def _ip(host: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        return ipaddress.ip_address(host)
    except ValueError:
        return None
