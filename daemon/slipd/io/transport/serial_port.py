"""A serial port as a connection: bytes are delivered in the callback that read them.

pyserial-asyncio reads and closes. Writing is done here, because its writer reports an unplugged port as a fault of the
whole loop, spins while the port is full, and queues commands, which would arrive late.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import functools
import logging
import os
import re
import termios
from pathlib import Path

import serial
import serial_asyncio
from serial.tools.list_ports_linux import SysFS

from slipd.errors import LinkError
from slipd.events import LinkSpec
from slipd.io.transport.byte_delivery import ByteDelivery, is_readable
from slipd.io.transport.link import OnBytes
from slipd.io.transport.nonblocking_writer import NonblockingWriter

DRAIN_TIMEOUT_S = 0.2
"""Longest wait for unsent bytes when closing, s: enough for 2 kB at 115200 baud."""

DRAIN_POLL_S = 0.005
"""Period of the checks for unsent bytes when closing, s: the kernel reports their number, but sends no event."""

_REMEDIES = {
    errno.ENOENT: "no such port; plug the device in, or correct the path (/dev/serial/by-id lists the ports)",
    errno.EACCES: "this user may not open it; join the group that owns the port (usually dialout) and log in again",
    errno.EPERM: "this user may not open it; join the group that owns the port (usually dialout) and log in again",
    errno.EBUSY: "another program holds it; stop that program (often ModemManager or a terminal)",
    errno.EWOULDBLOCK: "another program holds it; stop that program (often ModemManager or a terminal)",
    errno.EIO: "the driver cannot reach the device; plug it in again",
    errno.ENOTTY: "not a serial port; give the path of one, e.g. below /dev/serial/by-id",
    errno.EISDIR: "not a serial port; give the path of one, e.g. below /dev/serial/by-id",
}

USB_SERIAL = Path("/sys/bus/usb-serial/devices")
LATENCY_MS = 1
"""Shortest latency timer of an FTDI adapter; its default is 16 ms."""

_NUMBERED = re.compile(r"/dev/tty(USB|ACM)\d+")
"""Paths that belong to whichever device is plugged in first."""

_log = logging.getLogger(__name__)


async def open_serial(spec: LinkSpec, on_bytes: OnBytes) -> SerialConnection:
    """Open a port exclusively and start to read it.

    Opening runs in a thread, because a driver that waits for a dead device blocks for seconds.

    Raises:
        LinkError: The port cannot be opened; the text says why, and what to do.
    """
    _warn_of_number(spec.address)
    opening = asyncio.get_running_loop().run_in_executor(None, _open_port, spec.address, spec.baud)
    try:
        port = await asyncio.shield(opening)
    except asyncio.CancelledError:
        opening.add_done_callback(_close_unclaimed)
        raise
    except (OSError, ValueError, termios.error) as error:
        raise LinkError(why_not_opened(spec.address, error)) from error
    try:
        return SerialConnection(port, on_bytes)
    except (OSError, termios.error) as error:  # the transport configures the port again, which may be unplugged by now
        port.close()
        raise LinkError(why_not_opened(spec.address, error)) from error


def why_not_opened(path: str, error: Exception) -> str:
    """Return why a port cannot be opened, and what to do.

    Args:
        path: Path of the port.
        error: The error of the attempt; pyserial hides some causes in the context of its own error.
    """
    for cause in (error, error.__context__):
        code = cause.args[0] if cause is not None and cause.args else None
        if code in _REMEDIES:
            return f"{path}: {_REMEDIES[code]}"
    return f"{path}: cannot be opened: {error}"


def probe(path: str) -> object:
    """Return a token of the port at a path: equal as long as port and access rights stay; None if there is none.

    It contains the time of change, because numbers of pseudo-terminals are reused and udev sets access rights late.
    """
    try:
        found = os.stat(path)  # noqa: PTH116 - one call, 50 times a second
    except OSError:
        return None
    return found.st_dev, found.st_ino, found.st_rdev, found.st_ctime_ns


class SerialConnection(asyncio.Protocol):
    """An open port; see `slipd.io.transport.link.Connection` for the contract of each method."""

    overruns = 0  # drivers count them, but few of them correctly

    def __init__(self, port: _Port, on_bytes: OnBytes) -> None:
        self.identity = port.identity
        self.latency = port.latency
        self._loop = asyncio.get_running_loop()
        self._port = port
        self._delivery = ByteDelivery(on_bytes)
        self._writer = NonblockingWriter(port.fileno(), self._lose)
        self._closed = asyncio.Event()
        self._transport = serial_asyncio.SerialTransport(self._loop, self, port)

    async def until_lost(self) -> str:
        """Wait until the port is gone and return the reason, or raise the exception of the consumer."""
        return await self._delivery.until_lost()

    def write(self, data: bytes) -> bool:
        """Send at once or not at all; return False while the device does not read."""
        return not self._delivery.ended and self._writer.write(data)

    def unread(self) -> bool:
        """Return whether bytes wait to be read."""
        return not self._delivery.ended and is_readable(self._port.fileno())

    async def close(self) -> None:
        """Wait at most DRAIN_TIMEOUT_S for unsent bytes, then release the port."""
        self._transport.pause_reading()
        try:
            if not self._delivery.ended:
                await self._drain()
        finally:
            self._transport.close()
        await self._closed.wait()

    def data_received(self, data: bytes) -> None:
        """Deliver bytes; called by the transport."""
        if not self._delivery.deliver(data):
            self._transport.pause_reading()

    def connection_lost(self, exc: Exception | None) -> None:
        """End the connection; called by the transport, which closes the port after this returns."""
        self._lose(exc)
        self._closed.set()

    def _lose(self, error: Exception | None) -> None:
        self._writer.stop()
        self._delivery.lose(f"{self._port.port}: the port is gone ({error}); it is opened again when it is back")

    async def _drain(self) -> None:
        deadline_s = self._loop.time() + DRAIN_TIMEOUT_S
        with contextlib.suppress(OSError):  # unplugged by now
            while (self._writer.under_way or self._port.out_waiting) and self._loop.time() < deadline_s:  # noqa: ASYNC110 - there is no event
                await asyncio.sleep(DRAIN_POLL_S)


class _Port(serial.Serial):  # type: ignore[misc]  # pyserial has no types
    """A port that never blocks: ``flush`` discards unsent bytes, ``read`` returns the bytes that are there.

    The transport flushes on the loop before it closes, and the flush of pyserial waits until the device has read
    everything, which may be for ever. The transport reads when the loop reports bytes; pyserial would check again
    before each read.

    Attributes:
        identity: Path of the port, and the USB device that it belongs to.
        latency: What `shorten_latency` returned.
    """

    identity: str
    latency: str

    def read(self, size: int = 1) -> bytes:
        try:
            data = os.read(self.fd, size)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise serial.SerialException(f"read failed: {error}") from error
        if not data:
            raise serial.SerialException("the device is gone: its port is readable but empty")
        return data

    def flush(self) -> None:
        with contextlib.suppress(OSError, termios.error):  # unplugged
            if self.out_waiting:
                self.reset_output_buffer()


def _open_port(path: str, baud: int) -> _Port:
    port = _Port(path, baud, exclusive=True)
    with contextlib.suppress(
        ValueError, OSError, NotImplementedError
    ):  # pseudo-terminals and some drivers have no such mode
        port.set_low_latency_mode(True)
    with contextlib.suppress(OSError, termios.error):  # unplugged by now, which reading will report
        attributes = termios.tcgetattr(port.fd)
        attributes[2] &= ~termios.HUPCL  # closing must not reset boards that treat a falling DTR as a reset
        termios.tcsetattr(port.fd, termios.TCSANOW, attributes)
    port.identity = identity_of(path)
    port.latency = shorten_latency(path)
    return port


def shorten_latency(path: str) -> str:
    """Let a USB adapter with a latency timer hold bytes back for no longer than a millisecond.

    The driver does so itself for low latency; where it did not, the timer is written, which needs rights.

    Returns:
        "" if it is so, or the adapter has no timer; otherwise what holds the bytes back, for people.
    """
    timer = USB_SERIAL / Path(path).resolve().name / "latency_timer"
    with contextlib.suppress(OSError, ValueError):
        if int(timer.read_text()) <= LATENCY_MS:
            return ""
        with contextlib.suppress(OSError):
            timer.write_text(f"{LATENCY_MS}\n")
        held_ms = int(timer.read_text())
        if held_ms > LATENCY_MS:
            return f"the USB adapter of {path} holds bytes back for up to {held_ms} ms, in {timer}"
    return ""


def identity_of(path: str) -> str:
    """Return the path of a port and, if it belongs to a USB device, vendor, product and serial number."""
    try:
        found = SysFS(path)
    except (OSError, TypeError, ValueError):  # unplugged by now
        return path
    if found.vid is None:
        return path
    return f"{path}, usb {found.vid:04x}:{found.pid:04x} {found.serial_number or ''}".rstrip()


@functools.cache
def _warn_of_number(path: str) -> None:
    """Log once that a path may later belong to another device."""
    if _NUMBERED.fullmatch(path):
        _log.warning("%s: belongs to whichever device is plugged in first; use a path below /dev/serial/by-id", path)


def _close_unclaimed(opening: asyncio.Future[_Port]) -> None:
    """Close a port whose opening was cancelled before the driver finished."""
    if not opening.cancelled() and opening.exception() is None:
        opening.result().close()
