"""A serial port as a connection. pyserial-asyncio reads and closes it.

Writing is that of `FileConnection`: the library's writer spins while the port is full, and queues commands, which would
arrive late. No call here ever waits for the device.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import os
import termios
from pathlib import Path

import serial
import serial_asyncio
from serial.tools.list_ports_linux import SysFS

from slipd.errors import LinkError
from slipd.events import LinkSpec
from slipd.io.transport.link_connection import FileConnection, OnBytes

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


async def open_serial(spec: LinkSpec, on_bytes: OnBytes) -> SerialConnection:
    """Open a port exclusively and start to read it.

    Opening runs in a thread, because a driver that waits for a dead device blocks for seconds.

    Raises:
        LinkError: The port cannot be opened; the text says why, and what to do.
    """
    opening = asyncio.get_running_loop().run_in_executor(None, _open_port, spec.address, spec.baud)
    try:
        port, identity, latency = await asyncio.shield(opening)
    except asyncio.CancelledError:
        opening.add_done_callback(_close_unclaimed)
        raise
    except (OSError, ValueError, termios.error) as error:
        raise LinkError(why_not_opened(spec.address, error)) from error
    try:
        connection = SerialConnection(spec.address, port, on_bytes)
    except (OSError, termios.error) as error:  # the library configures the port again, which may be unplugged by now
        port.close()
        raise LinkError(why_not_opened(spec.address, error)) from error
    connection.identity, connection.latency = identity, latency
    return connection


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


class SerialConnection(FileConnection, asyncio.Protocol):
    """An open port."""

    _opened: Port

    async def close(self) -> None:
        """Wait at most DRAIN_TIMEOUT_S for unsent bytes, then release the port."""
        await super().close()
        await self._closed.wait()

    data_received = FileConnection.deliver  # called by the library

    def connection_lost(self, exc: Exception | None) -> None:
        """End the connection; called by the library, which closes the port after this returns."""
        self._fail(exc)
        self._closed.set()

    def _start_reading(self) -> None:
        self._closed = asyncio.Event()
        self._transport = serial_asyncio.SerialTransport(self._loop, self, self._opened)

    def _stop_reading(self) -> None:
        self._transport.pause_reading()

    def _unsent(self) -> bool:
        with contextlib.suppress(OSError):  # unplugged by now
            return super()._unsent() or self._opened.out_waiting > 0
        return False

    def _release(self) -> None:
        self._transport.close()

    def _fail(self, error: object) -> None:
        self.lose(f"{self._address}: the port is gone ({error}); it is opened again when it is back")


class Port(serial.Serial):  # type: ignore[misc]  # pyserial has no types
    """A port that never blocks: ``flush`` discards unsent bytes, ``read`` returns the bytes that are there.

    The library flushes before it closes, and the flush of pyserial waits until the device has read everything, which
    may be for ever. The library reads when the loop reports bytes; pyserial would check again before each read.
    """

    def read(self, size: int = 1) -> bytes:
        """Return what has arrived, at most ``size`` bytes.

        Raises:
            SerialException: The device is gone.
        """
        try:
            data = os.read(self.fd, size)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise serial.SerialException(str(error)) from error
        if not data:
            raise serial.SerialException("it is readable but empty")
        return data

    def flush(self) -> None:
        """Discard what the device has not read."""
        with contextlib.suppress(OSError, termios.error):  # unplugged
            if self.out_waiting:
                self.reset_output_buffer()


def _open_port(path: str, baud: int) -> tuple[Port, str, str]:
    """Return a port, its identity, and what `shorten_latency` returned."""
    port = Port(path, baud, exclusive=True, timeout=0)
    with contextlib.suppress(
        ValueError, OSError, NotImplementedError
    ):  # pseudo-terminals and some drivers have no such mode
        port.set_low_latency_mode(True)
    with contextlib.suppress(OSError, termios.error):  # unplugged by now, which reading will report
        attributes = termios.tcgetattr(port.fd)
        attributes[2] &= ~termios.HUPCL  # closing must not reset boards that treat a falling DTR as a reset
        termios.tcsetattr(port.fd, termios.TCSANOW, attributes)
    return port, identity_of(path), shorten_latency(path)


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


def _close_unclaimed(opening: asyncio.Future[tuple[Port, str, str]]) -> None:
    """Close a port whose opening was cancelled before the driver finished."""
    if not opening.cancelled() and opening.exception() is None:
        opening.result()[0].close()
