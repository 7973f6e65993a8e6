"""``slipd doctor``: read a device for some seconds, report what is right and wrong, and keep a capture of the bytes."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import platform
import time
import tomllib
from pathlib import Path
from typing import Any, cast

from slipd import __version__
from slipd.config import transport_of
from slipd.devices import Device, Session
from slipd.errors import SlipdError, UsageError, one_line
from slipd.events import Bytes, Event, HostNotice, LinkDown, LinkSpec, LinkUp
from slipd.io.transport import Links
from slipd.io.transport.link import Link
from slipd.tools.devices_command import package_of, usable_device
from slipd.tools.discovery.examination import SUFFIX, Capture, Finding, Piece, decode, examine, read_capture
from slipd.tools.discovery.port_probe import question_options

OPEN_S = 3.0
"""Longest wait for the line to open, s."""

POLL_S = 0.001
"""Period at which the deadlines of the session are checked, s."""

LINK = "device"


def doctor(
    port: str, name: str | None, seconds: float, out: Path, baud: int | None, options: str, rate_hz: float | None
) -> bool:
    """Read a device, or take a capture, and print what is found; write capture and report of a device that was read.

    Args:
        port: Path of a serial port, or address; or path of a capture.
        name: Name of the device.
        seconds: How long to read.
        out: Folder for capture and report.
        baud: Speed of a serial line; None: the default of the device.
        options: Options of the device, the inside of a TOML inline table.
        rate_hz: Expected readings per second; None: any rate of the device.

    Returns:
        Whether nothing is wrong.

    Raises:
        UsageError: The device is unknown or not named, or an option is wrong.
        SlipdError: The port cannot be opened, the file is not a capture, or its device is not installed.
    """
    again = port.endswith(SUFFIX)
    capture = _earlier(Path(port)) if again else _captured(port, name, seconds, baud, options)
    findings = examine(capture, rate_hz)
    report = report_text(capture, findings)
    print(report, end="")
    if not again:
        _write(out / f"doctor-{name}-{time.strftime('%Y%m%d-%H%M%S')}", capture, report)
    return all(finding.level != "wrong" for finding in findings)


def _earlier(path: Path) -> Capture:
    """Return the capture of a file, which the installed device can decode; errors are those of `doctor`."""
    capture = read_capture(path)
    try:
        decode(capture)
    except KeyError:
        raise SlipdError(f"{path}: needs the device {capture.device!r} of {capture.package}") from None
    except (TypeError, ValueError) as error:
        raise SlipdError(f"{path}: its options are not those of {capture.device}: {error}") from error
    return capture


def _captured(port: str, name: str | None, seconds: float, baud: int | None, options: str) -> Capture:
    """Read a device; errors are those of `doctor`."""
    if name is None:
        raise UsageError("--device is missing: give the name of the device, as `slipd devices` lists it")
    (found, device), transport = usable_device(name), transport_of(port)
    if transport not in device.transports:
        raise UsageError(f"PORT must be the {' or '.join(device.transports)} line of {name}, got {port}")
    given = json.loads(json.dumps(question_options(device, transport) | _parsed(options)))  # as they are read back
    capture = Capture(
        name, package_of(found), transport, (baud or device.baud or 0) if transport == "serial" else 0,
        given, seconds,
    )  # fmt: skip
    log = logging.getLogger(Link.__module__)
    log.disabled = True  # what the link logs is printed here
    try:
        asyncio.run(_Reading(device, port, capture).run())
    finally:
        log.disabled = False
    return capture


def _write(stem: Path, capture: Capture, report: str) -> None:
    try:
        for path, text in ((stem.with_suffix(SUFFIX), capture.text()), (stem.with_suffix(".txt"), report)):
            with path.open("x", encoding="utf-8") as file:
                file.write(text)
            print(f"{path}: written")
    except OSError as error:
        raise SlipdError(f"{error.filename}: cannot be written: {error.strerror}") from error


def report_text(capture: Capture, findings: list[Finding]) -> str:
    """Return the report: versions, line, and the findings; it names no port, host or user."""
    line = f"{capture.transport}, {capture.baud} bit/s" if capture.baud else capture.transport
    head = f"slipd {__version__}, Python {platform.python_version()}; {capture.device} of {capture.package} on {line}"
    options = f"options: {dict(capture.options)}\n" if capture.options else ""
    body = "".join(f"{finding.level:5}  {one_line(finding.text)}\n" for finding in findings)
    return f"{head}\n{options}{capture.seconds:g} s\n{body}"


def _parsed(options: str) -> dict[str, Any]:
    try:
        parsed: dict[str, Any] = tomllib.loads(f"options = {{ {options} }}")["options"]
    except tomllib.TOMLDecodeError as error:
        raise UsageError(f"--options must be keys and values as in a config, got {options!r}: {error}") from None
    return parsed


class _Reading:
    """The conversation with a device for the time of a capture, whose pieces it adds."""

    def __init__(self, device: Device, port: str, capture: Capture) -> None:
        try:
            self._session: Session | None = device.session(**capture.options) if device.session is not None else None
            if self._session is None:
                device.decoder(**capture.options)
            inquiry = device.inquiry(**capture.options) if device.inquiry is not None else None
        except (TypeError, ValueError) as error:
            raise SlipdError(f"--options: {error}") from None
        self._spec = LinkSpec(LINK, capture.transport, port, capture.baud, inquiry)
        self._capture = capture
        self._settled = asyncio.Event()
        self._opened_ns = 0
        self._reason = ""
        self._links: Links | None = None

    async def run(self) -> None:
        """Read until the time is over, or the line is lost.

        Raises:
            SlipdError: The line cannot be opened.
        """
        async with asyncio.TaskGroup() as tasks, Links(tasks, [self._spec], self._handle) as self._links:
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(OPEN_S):
                    await self._settled.wait()
            until_s = time.monotonic() + self._capture.seconds
            while self._opened_ns and not self._reason and time.monotonic() < until_s:
                self._write_due()
                await asyncio.sleep(POLL_S)
            if self._session is not None and self._opened_ns:
                self._links.write(LINK, self._session.stop())
        if not self._opened_ns:
            raise SlipdError(self._reason or f"{self._spec.address}: cannot be opened")
        if self._reason:
            print(f"the line was lost: {one_line(self._reason)}")

    def _handle(self, event: Event) -> None:
        match event:
            case LinkUp():
                self._opened_ns = time.monotonic_ns()
                self._settled.set()
                print(f"reading for {self._capture.seconds:g} s: press the sensor, and let go", flush=True)
                if self._session is not None:
                    self._write(self._session.start(0), 0)
            case Bytes(_, data):
                t_ns = time.monotonic_ns() - self._opened_ns
                self._capture.pieces.append(Piece(t_ns, "in", data))
                if self._session is not None:
                    self._session.receive(data, t_ns)
            case LinkDown(_, reason):
                self._reason = reason
                self._settled.set()
            case _:  # what the host cannot change, such as the latency timer of the adapter
                print(cast("HostNotice", event).text)

    def _write_due(self) -> None:
        due_ns = self._session.next_deadline() if self._session is not None else None
        now_ns = time.monotonic_ns() - self._opened_ns
        if self._session is not None and due_ns is not None and due_ns <= now_ns:
            self._write(self._session.on_time(now_ns), now_ns)

    def _write(self, data: bytes, t_ns: int) -> None:
        self._capture.pieces.append(Piece(t_ns, "out", data))
        if data and self._links is not None:
            self._links.write(LINK, data)
