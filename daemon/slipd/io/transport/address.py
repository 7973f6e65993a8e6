"""Addresses of network devices: parse them, and connect a socket."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Sequence
from typing import Any
from urllib.parse import urlsplit

from slipd.errors import LinkError

OPEN_TIMEOUT_S = 2.0
"""Longest wait for an answer, s: a device on the local network that takes longer is off or stuck."""


def host_and_port(address: str) -> tuple[str, int | None]:
    """Parse an address such as ``udp://HOST:PORT``; an IPv6 address as host is in brackets.

    Returns:
        Host, and port or None.

    Raises:
        LinkError: The address has no host, or an impossible port.
    """
    try:
        parts = urlsplit(address)
        host, port = parts.hostname, parts.port
    except ValueError as error:
        raise LinkError(
            f"{address}: not an address ({error}); a valid one is {_scheme(address)}://192.168.1.1:49152"
        ) from error
    if not host:
        raise LinkError(f"{address}: has no host; a valid address is {_scheme(address)}://192.168.1.1:49152")
    return host, port


def _scheme(address: str) -> str:
    return address.partition("://")[0]


async def connected(address: str, kind: socket.SocketKind) -> socket.socket:
    """Return a non-blocking socket connected to an address; of several IP addresses, the first that accepts.

    Raises:
        LinkError: The address is invalid, or nothing answers there.
    """
    host, port = host_and_port(address)
    if port is None:
        raise LinkError(f"{address}: has no port; a valid address is {address.rstrip('/')}:49152")
    loop = asyncio.get_running_loop()
    try:
        async with asyncio.timeout(OPEN_TIMEOUT_S):
            found = await loop.getaddrinfo(host, port, type=kind)
            return await _first(found)
    except TimeoutError:
        raise LinkError(
            f"{address}: no answer within {OPEN_TIMEOUT_S:g} s; switch the device on, or correct the address"
        ) from None
    except (OSError, UnicodeError) as error:  # UnicodeError: a part of the host name is empty or too long
        reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
        raise LinkError(
            f"{address}: cannot be reached ({reason}); switch the device on, or correct the address"
        ) from error


async def _first(found: Sequence[tuple[int, int, int, str, tuple[Any, ...]]]) -> socket.socket:
    failure = OSError("the host name has no address")
    for family, kind, protocol, _, target in found:
        made = socket.socket(family, kind, protocol)
        try:
            made.setblocking(False)
            await asyncio.get_running_loop().sock_connect(made, target)
        except OSError as error:
            made.close()
            failure = error
        except BaseException:  # cancelled
            made.close()
            raise
        else:
            return made
    raise failure
