"""Devices on the network: a TCP port as a stream of bytes, datagrams of UDP, and what is asked before over TCP."""

from __future__ import annotations

import array
import asyncio
import contextlib
import socket
from urllib.parse import urlsplit

from slipd.config import address_fault
from slipd.devices import Inquiry
from slipd.errors import LinkError
from slipd.events import LinkSpec
from slipd.io.transport.link_connection import READ_BYTES, FileConnection, OnBytes
from slipd.io.zmtp.endpoint import set_tcp_options

OPEN_TIMEOUT_S = 2.0
"""Longest wait for an answer, s: a device on the local network that takes longer is off or stuck."""

RECEIVE_BUFFER_BYTES = 512 * 1024
"""Requested receive buffer: the kernel counts about 1 kB for each small datagram, so it holds 100 ms at 4 kHz."""

DATAGRAMS_PER_WAKE = 32
"""Most datagrams read before other tasks of the loop run, even if they are empty; READ_BYTES is a limit too."""

MAX_DATAGRAM_BYTES = 2048
"""Most bytes read of a datagram; the rest is dropped. Devices send at most 1440 bytes, which are 40 records."""

SO_MEMINFO, MEMINFO_WORDS, MEMINFO_DROPS = 55, 9, 8
"""Linux <asm-generic/socket.h> and <linux/sock_diag.h>: counters of a socket, of which the last is the drops."""

INQUIRY_TIMEOUT_S = 2.0
"""Longest duration of request and answer, s: a working device takes some milliseconds."""

MAX_REPLY_BYTES = 65_536
"""Longest answer of unknown length: several times the settings page of a sensor."""


async def open_tcp(spec: LinkSpec, on_bytes: OnBytes) -> FileConnection:
    """Connect to a device.

    Raises:
        LinkError: The address is invalid, or nothing answers there.
    """
    opened = await connected(spec.address, socket.SOCK_STREAM)
    set_tcp_options(opened)
    return FileConnection(spec.address, opened, on_bytes)


async def open_udp(spec: LinkSpec, on_bytes: OnBytes) -> UdpConnection:
    """Open a socket to the device; only its datagrams show that it is there.

    The socket is connected, so datagrams of other senders never reach it, and the host of a device that does not listen
    reports so.

    Raises:
        LinkError: The address is invalid, or there is no route to it.
    """
    opened = await connected(spec.address, socket.SOCK_DGRAM)
    opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
    return UdpConnection(spec.address, opened, on_bytes)


class UdpConnection(FileConnection):
    """A device that sends datagrams: each is delivered as one piece of bytes."""

    _opened: socket.socket

    @property
    def overruns(self) -> int:
        """Datagrams that the kernel dropped because the daemon was late or they were damaged."""
        try:
            counters = self._opened.getsockopt(socket.SOL_SOCKET, SO_MEMINFO, 4 * MEMINFO_WORDS)
        except OSError:  # a kernel without these counters
            return 0
        return array.array("I", counters)[MEMINFO_DROPS] if len(counters) == 4 * MEMINFO_WORDS else 0

    def _read(self) -> None:
        read_bytes = 0
        for _ in range(DATAGRAMS_PER_WAKE):
            data = self._receive(MAX_DATAGRAM_BYTES)
            if data is None:
                return
            self.deliver(data)
            read_bytes += len(data)
            if self.ended or read_bytes >= READ_BYTES:
                return

    def _fail(self, error: object) -> None:
        what = "nothing listens on this port" if isinstance(error, ConnectionRefusedError) else error
        self.lose(f"{self._address}: {what}; switch the device on, or correct the address")


async def connected(address: str, kind: socket.SocketKind) -> socket.socket:
    """Return a non-blocking socket connected to an address; of several IP addresses, the first that accepts.

    Raises:
        LinkError: The address is invalid, or nothing answers there.
    """
    host, port = host_and_port(address)
    try:
        async with asyncio.timeout(OPEN_TIMEOUT_S):
            return await _first(host, port, kind)
    except TimeoutError:
        reason = f"no answer within {OPEN_TIMEOUT_S:g} s"
    except OSError as error:
        reason = f"cannot be reached ({error.strerror or error})"
    raise LinkError(f"{address}: {reason}; switch the device on, or correct the address")


async def _first(host: str, port: int, kind: socket.SocketKind) -> socket.socket:
    loop, failure = asyncio.get_running_loop(), OSError("the host name has no address")
    for family, _, protocol, _, target in await loop.getaddrinfo(host, port, type=kind):
        with contextlib.ExitStack() as on_failure:
            made = on_failure.enter_context(socket.socket(family, kind, protocol))
            made.setblocking(False)
            try:
                await loop.sock_connect(made, target)
            except OSError as error:
                failure = error
                continue
            on_failure.pop_all()
            return made
    raise failure


def host_and_port(address: str) -> tuple[str, int]:
    """Return host and port of an address such as ``udp://HOST:PORT``; an IPv6 address as host is in brackets.

    Raises:
        LinkError: The address has no host, or no possible port.
    """
    if fault := address_fault(address):
        scheme = address.partition("://")[0]
        raise LinkError(f"{address}: {fault}; a valid one is {scheme}://192.168.1.1:49152")
    parts = urlsplit(address)
    return parts.hostname or "", parts.port or 0


async def inquire(address: str, inquiry: Inquiry) -> bytes:
    """Ask the host of a link over TCP for what its stream does not contain, such as the calibration of a sensor.

    The request of the inquiry is sent, then the change that the answer calls for. A change that fails is no fault of
    the link: the answer shows it.

    Returns:
        The newest whole answer.

    Raises:
        LinkError: No answer within INQUIRY_TIMEOUT_S, an answer that is cut off or too long, or one that fails its
            check.
    """
    answer = await _checked(address, inquiry)
    if request := inquiry.change(answer):
        with contextlib.suppress(LinkError):
            await _checked(address, Inquiry(inquiry.port, request, 0))
        with contextlib.suppress(LinkError):
            answer = await _checked(address, inquiry)
    return answer


async def _checked(address: str, inquiry: Inquiry) -> bytes:
    host, _ = host_and_port(address)
    try:
        async with asyncio.timeout(INQUIRY_TIMEOUT_S):
            answer = await _ask(host, inquiry)
        fault = inquiry.check(answer)
    except TimeoutError:
        fault = f"no answer within {INQUIRY_TIMEOUT_S:g} s"
    except asyncio.IncompleteReadError as error:
        fault = f"the answer must have {inquiry.reply_bytes} bytes, got {len(error.partial)}"
    except (OSError, ValueError) as error:
        fault = str(error)
    if not fault:
        return answer
    raise LinkError(
        f"{address}: inquiry on TCP port {inquiry.port} failed: {fault}; switch the device on, correct the address, or"
        " state in the options what the device would answer"
    )


async def _ask(host: str, inquiry: Inquiry) -> bytes:
    reader, writer = await asyncio.open_connection(host, inquiry.port, limit=MAX_REPLY_BYTES)
    try:
        writer.write(inquiry.request)
        if inquiry.reply_bytes:
            return await reader.readexactly(inquiry.reply_bytes)
        answer = b""
        while chunk := await reader.read(MAX_REPLY_BYTES):
            answer += chunk
            if len(answer) > MAX_REPLY_BYTES:
                raise ValueError(f"the answer has more than {MAX_REPLY_BYTES} bytes")
        if not answer:
            raise ValueError("the device closed the connection without an answer")
        return answer
    finally:
        writer.transport.abort()  # nothing is left to send
