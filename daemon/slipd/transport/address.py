"""Addresses of network devices: what they name, and sockets connected to it."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Sequence
from typing import Any
from urllib.parse import urlsplit

from slipd.errors import LinkError

OPEN_TIMEOUT_S = 2.0
"""A device stands beside the robot: one that takes longer to answer is off, or wedged."""


def host_and_port(address: str) -> tuple[str, int | None]:
    """What an address such as ``udp://HOST:PORT`` names; a literal IPv6 host stands in brackets.

    Raises:
        LinkError: It names no host, or no port that exists.
    """
    try:
        parts = urlsplit(address)
        host, port = parts.hostname, parts.port
    except ValueError as error:
        raise LinkError(f"{address}: no address: {error}; one is {_scheme(address)}://192.168.1.1:49152") from error
    if not host:
        raise LinkError(f"{address}: names no host; one with a host is {_scheme(address)}://192.168.1.1:49152")
    return host, port


def _scheme(address: str) -> str:
    return address.partition("://")[0]


async def connected(address: str, kind: socket.SocketKind) -> socket.socket:
    """A non-blocking socket connected to what the address names, at the first of its addresses that takes it.

    Raises:
        LinkError: It names nothing, or nothing there answers; says what would be right.
    """
    host, port = host_and_port(address)
    if port is None:
        raise LinkError(f"{address}: names no port; one that does is {address.rstrip('/')}:49152")
    loop = asyncio.get_running_loop()
    try:
        async with asyncio.timeout(OPEN_TIMEOUT_S):
            found = await loop.getaddrinfo(host, port, type=kind)
            return await _first(found)
    except TimeoutError:
        raise LinkError(
            f"{address}: nothing answers within {OPEN_TIMEOUT_S:g} s; switch the device on, or correct the address"
        ) from None
    except (OSError, UnicodeError) as error:  # a name with an empty or too long part cannot even be asked for
        reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
        raise LinkError(f"{address}: not reached ({reason}); switch the device on, or correct the address") from error


async def _first(found: Sequence[tuple[int, int, int, str, tuple[Any, ...]]]) -> socket.socket:
    failure = OSError("the name has no address")
    for family, kind, protocol, _, target in found:
        made = socket.socket(family, kind, protocol)
        try:
            made.setblocking(False)
            await asyncio.get_running_loop().sock_connect(made, target)
        except OSError as error:
            made.close()
            failure = error
        except BaseException:  # given up meanwhile
            made.close()
            raise
        else:
            return made
    raise failure
