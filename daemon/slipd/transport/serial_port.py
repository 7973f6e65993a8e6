"""A serial port as a connection: bytes are handed on within the callback in which they were read.

pyserial-asyncio reads and closes; writing is done here, because its writer raises an unplugged port as a fault of the
whole loop, spins while a full port takes nothing, and queues commands that nobody wants late.
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

import serial
import serial_asyncio
from serial.tools.list_ports_linux import SysFS

from slipd.errors import LinkError
from slipd.events import LinkSpec
from slipd.transport.byte_delivery import ByteDelivery
from slipd.transport.link import OnBytes
from slipd.transport.nonblocking_writer import NonblockingWriter

DRAIN_TIMEOUT_S = 0.2
"""How long closing waits for the last bytes to leave: 2 kB at 115200 baud, far more than any farewell."""

DRAIN_POLL_S = 0.005
"""How often closing looks whether they have left: the kernel tells how many are unsent, not when none are."""

_REMEDIES = {
    errno.ENOENT: "no such port; plug the device in, or correct the path (/dev/serial/by-id names what is there)",
    errno.EACCES: "this user may not open it; join the group that owns the port (usually dialout) and log in again",
    errno.EPERM: "this user may not open it; join the group that owns the port (usually dialout) and log in again",
    errno.EBUSY: "another program holds it; stop that program (often ModemManager or a terminal)",
    errno.EWOULDBLOCK: "another program holds it; stop that program (often ModemManager or a terminal)",
    errno.EIO: "its driver does not reach the device; plug the device in again",
    errno.ENOTTY: "not a serial port; give the path of one, e.g. below /dev/serial/by-id",
    errno.EISDIR: "not a serial port; give the path of one, e.g. below /dev/serial/by-id",
}

_NUMBERED = re.compile(r"/dev/tty(USB|ACM)\d+")
"""Paths that go to whichever device is plugged in first."""

_log = logging.getLogger(__name__)


async def open_serial(spec: LinkSpec, on_bytes: OnBytes) -> SerialConnection:
    """Open a port for this process alone and start to read it.

    Opening runs in a thread: a driver that waits for a dead device would hold the loop for seconds.

    Raises:
        LinkError: It cannot be opened; says why and what would be right.
    """
    _advise(spec.address)
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
    except (OSError, termios.error) as error:  # its transport configures the port once more; unplugged meanwhile
        port.close()
        raise LinkError(why_not_opened(spec.address, error)) from error


def why_not_opened(path: str, error: Exception) -> str:
    """Say what keeps a port from being opened, and what would be right.

    Args:
        path: Of the port.
        error: What opening it raised; pyserial hides some causes in the context of its own error.
    """
    for cause in (error, error.__context__):
        code = cause.args[0] if cause is not None and cause.args else None
        if code in _REMEDIES:
            return f"{path}: {_REMEDIES[code]}"
    return f"{path}: cannot be opened: {error}"


def look(path: str) -> object:
    """What is at a path: equal as long as it is the same port with the same access; None while there is nothing.

    The time of change tells a pseudo-terminal, whose numbers are used again, and rights that udev sets late.
    """
    try:
        found = os.stat(path)  # noqa: PTH116 - one call, 50 times a second
    except OSError:
        return None
    return found.st_dev, found.st_ino, found.st_rdev, found.st_ctime_ns


class SerialConnection(asyncio.Protocol):
    """An open port; see `slipd.transport.link.Connection` for what each method promises."""

    overruns = 0  # drivers count them, and few of them right

    def __init__(self, port: _Port, on_bytes: OnBytes) -> None:
        self.identity = port.identity
        self._loop = asyncio.get_running_loop()
        self._port = port
        self._delivery = ByteDelivery(on_bytes)
        self._writer = NonblockingWriter(port.fileno(), self._lose)
        self._closed = asyncio.Event()
        self._transport = serial_asyncio.SerialTransport(self._loop, self, port)

    async def until_lost(self) -> str:
        """Return why the port went away, or raise what the consumer of its bytes raised."""
        return await self._delivery.until_lost()

    def write(self, data: bytes) -> bool:
        """Send now or never; False while the device does not read."""
        return not self._delivery.ended and self._writer.write(data)

    async def close(self) -> None:
        """Let the last bytes leave for at most DRAIN_TIMEOUT_S, then release the port."""
        self._transport.pause_reading()
        try:
            if not self._delivery.ended:
                await self._drain()
        finally:
            self._transport.close()
        await self._closed.wait()

    def data_received(self, data: bytes) -> None:
        """Hand on; called by the transport."""
        if not self._delivery.deliver(data):
            self._transport.pause_reading()

    def connection_lost(self, exc: Exception | None) -> None:
        """End; called by the transport, which closes the port right after this returns."""
        self._lose(exc)
        self._closed.set()

    def _lose(self, error: Exception | None) -> None:
        self._writer.stop()
        self._delivery.lose(f"{self._port.port}: went away ({error}); it is opened again when it is back")

    async def _drain(self) -> None:
        deadline_s = self._loop.time() + DRAIN_TIMEOUT_S
        with contextlib.suppress(OSError):  # unplugged meanwhile
            while (self._writer.under_way or self._port.out_waiting) and self._loop.time() < deadline_s:  # noqa: ASYNC110 - nothing tells
                await asyncio.sleep(DRAIN_POLL_S)


class _Port(serial.Serial):  # type: ignore[misc]  # pyserial has no types
    """A port that never waits: its ``flush`` discards what is still unsent, its ``read`` takes what is there.

    The transport flushes before it closes, on the loop, and pyserial's flush waits until the device has read
    everything: behind a device that stopped reading it waits for ever. It reads when the loop says that there is
    something, and pyserial would ask once more, for each read.

    Attributes:
        identity: Its path, and the USB device that it belongs to.
    """

    identity: str

    def read(self, size: int = 1) -> bytes:
        try:
            data = os.read(self.fd, size)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise serial.SerialException(f"read failed: {error}") from error
        if not data:
            raise serial.SerialException("the device is gone: its port is ready and holds nothing")
        return data

    def flush(self) -> None:
        with contextlib.suppress(OSError, termios.error):  # unplugged
            if self.out_waiting:
                self.reset_output_buffer()


def _open_port(path: str, baud: int) -> _Port:
    port = _Port(path, baud, exclusive=True)
    with contextlib.suppress(ValueError, OSError, NotImplementedError):  # ptys and some drivers have no such mode
        port.set_low_latency_mode(True)
    with contextlib.suppress(OSError, termios.error):  # unplugged meanwhile: reading will tell
        attributes = termios.tcgetattr(port.fd)
        attributes[2] &= ~termios.HUPCL  # closing must not reset the boards that take a falling DTR for that
        termios.tcsetattr(port.fd, termios.TCSANOW, attributes)
    port.identity = identity_of(path)
    return port


def identity_of(path: str) -> str:
    """A port's path, and where it belongs to a USB device, vendor, product and serial number of that."""
    try:
        found = SysFS(path)
    except (OSError, TypeError, ValueError):  # unplugged while it was looked at
        return path
    if found.vid is None:
        return path
    return f"{path}, usb {found.vid:04x}:{found.pid:04x} {found.serial_number or ''}".rstrip()


@functools.cache
def _advise(path: str) -> None:
    """Say once that a path may become another device's."""
    if _NUMBERED.fullmatch(path):
        _log.warning("%s: goes to whichever device is plugged in first; /dev/serial/by-id has paths that stay", path)


def _close_unclaimed(opening: asyncio.Future[_Port]) -> None:
    """Close a port whose opening was given up while the driver was still at it."""
    if not opening.cancelled() and opening.exception() is None:
        opening.result().close()
