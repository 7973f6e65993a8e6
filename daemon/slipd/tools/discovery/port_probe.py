"""List the serial ports by names that stay the same, and find the device on each: listen at each speed, then ask.

Nothing that is sent moves a gripper or writes a setting that outlives the power: a gripper is asked for its status
registers only, a Robotous sensor for its name only, and the other sensors by the start-up of their own session.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import serial

from slipd.devices import DEVICES, Device, Session, pvdf, robotous
from slipd.types.samples import TactileSample

BY_ID, BY_PATH, DEV = Path("/dev/serial/by-id"), Path("/dev/serial/by-path"), Path("/dev")
NUMBERED = ("ttyUSB*", "ttyACM*")

SAME_SOCKET = "the name is that of the USB socket: keep the device in it, because it reports no serial number"
NUMBER = "the number belongs to whichever device is plugged in first; give it a name by a udev rule"

LISTEN_S = 0.6
"""Time of listening at each speed, s: a device that streams sends many readings within, after a boot of 0.2 s."""

ASK_S = 0.6
"""Time for an answer and the readings after it, s."""

LEAST_READINGS = 3
POLL_S = 0.005
READ_BYTES = 65_536
MOST_SIDE = 64

ASKED = ("robotiq_2f", "tsf85", "wts", "dsacon32", "robotous")
"""Devices that are silent until they are asked, in the order of asking."""


@dataclass(frozen=True, slots=True)
class SerialPort:
    """A serial port.

    Attributes:
        path: Its most stable name.
        warning: Why the name may belong to another device after a restart; "" if it will not.
    """

    path: Path
    warning: str = ""


def list_ports(by_id: Path = BY_ID, by_path: Path = BY_PATH, dev: Path = DEV) -> list[SerialPort]:
    """Return every serial port once, by id if it has one, else by path, else by its number.

    Other files of the folders, such as those beside the ports of an emulated rig, are left out.

    Args:
        by_id: Folder of links named after vendor, product and serial number.
        by_path: Folder of links named after the socket.
        dev: Folder of the numbered ports.
    """
    numbered = [path for pattern in NUMBERED for path in sorted(dev.glob(pattern))] if dev.is_dir() else []
    ports: dict[Path, SerialPort] = {}
    for folder, warning in ((by_id, ""), (by_path, SAME_SOCKET)):
        for path in sorted(folder.iterdir()) if folder.is_dir() else []:
            if path.is_char_device():
                ports.setdefault(path.resolve(), SerialPort(path, warning))
    for path in numbered:
        ports.setdefault(path.resolve(), SerialPort(path, NUMBER))
    return list(ports.values())


@dataclass(frozen=True, slots=True)
class Found:
    """A device on a port.

    Attributes:
        device: Its name in a config.
        rate_hz: Readings or images per second that it sent, rounded; None if it was only asked.
        identity: What it reports about itself; "" if nothing.
        taxels: Number of taxels of each pad; 0 for other devices.
        rows: Rows, if its frames carry them.
        sensors: Names of the sensors on the port, if there are several.
    """

    device: str
    rate_hz: float | None = None
    identity: str = ""
    taxels: int = 0
    rows: int = 0
    sensors: tuple[str, ...] = ()


async def identify_port(path: str) -> Found | None:
    """Return the device on a port; None if nothing that slipd knows answers.

    Raises:
        OSError: The port cannot be opened or read, for example because another program holds it.
    """
    speeds = {device.baud for device in DEVICES.values() if "serial" in device.transports and device.kind != "gripper"}
    for baud in sorted(speed for speed in speeds if speed):
        with await _opened(path, baud) as port:
            pieces = [piece async for piece in _pieces(port, LISTEN_S) if piece[1]]
        if (found := recognise(pieces)) is not None:
            return found
    for name in ASKED:
        with await _opened(path, DEVICES[name].baud or 115_200) as port:
            if (found := await _ask(port, name)) is not None:
                return found
    return None


def recognise(pieces: Sequence[tuple[int, bytes]]) -> Found | None:
    """Return the device that sends these bytes.

    Args:
        pieces: What was read, with the times of reading, ns.
    """
    if not pieces:
        return None
    found = [
        heard
        for device in DEVICES.values()
        if "serial" in device.transports and device.kind != "gripper" and not device.needs_size
        if (heard := _heard(device, pieces)) is not None
    ]
    if not found and (pad := _pvdf(pieces)) is not None:
        found.append(pad)
    return max(found, key=lambda heard: heard[0])[1] if found else None


def _heard(device: Device, pieces: Sequence[tuple[int, bytes]]) -> tuple[int, Found] | None:
    try:
        return _decode(device.name, device.decoder(**question_options(device)), pieces)
    except Exception:
        if device.interface is None:
            raise
        return None  # a device of another package hides none of the others


def _decode(name: str, decoder: Any, pieces: Sequence[tuple[int, bytes]]) -> tuple[int, Found] | None:
    """Return how many bytes a decoder understood, and the device."""
    samples = [(t_ns, sample) for t_ns, data in pieces for sample in decoder.receive(data, t_ns)]
    total = sum(len(data) for _, data in pieces)
    understood = total - decoder.health.bad_bytes
    if len(samples) < LEAST_READINGS or understood < total / 2:
        return None
    return understood, _described(name, samples)


def _described(name: str, samples: Sequence[tuple[int, Any]], identity: str = "") -> Found:
    sources = tuple(sorted({sample.source for _, sample in samples} - {""}))
    images = [sample for _, sample in samples if isinstance(sample, TactileSample)]
    span_s = (samples[-1][0] - samples[0][0]) * 1e-9 if samples else 0.0
    per_sensor = len(samples) / max(len(sources), 1)
    rate_hz = float(f"{(per_sensor - 1) / span_s:.1g}") if span_s > 0.0 else None
    taxels = len(images[0].values) if images else 0
    return Found(name, rate_hz, identity, taxels, sensors=sources)


def _pvdf(pieces: Sequence[tuple[int, bytes]]) -> tuple[int, Found] | None:
    """Return a PVDF pad, whose frames do not state the size of the pad: the checksum finds the columns."""
    data = b"".join(piece for _, piece in pieces)
    for cols in range(1, MOST_SIDE + 1):
        heard = pvdf.Decoder(1, cols)
        heard.receive(data[:4096], 0)
        if heard.health.good + heard.health.bad < LEAST_READINGS:  # a row beyond the first counts as bad here
            continue
        for rows in range(MOST_SIDE, 0, -1):
            found = _decode("pvdf", pvdf.Decoder(rows, cols), pieces)
            if found is not None:
                return found[0], replace(found[1], rows=rows)
    return None


async def _pieces(port: serial.Serial, seconds: float) -> AsyncIterator[tuple[int, bytes]]:
    """Yield the time, ns, and what has arrived, which may be nothing, again and again."""
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s:
        yield time.monotonic_ns(), port.read(READ_BYTES)
        await asyncio.sleep(POLL_S)


async def _ask(port: serial.Serial, name: str) -> Found | None:
    """Ask for one device; return it if it answers."""
    if name == "robotous":
        port.write(robotous.encode_command(robotous.PRODUCT_NAME))
        decoder = robotous.Decoder()
        decoder.receive(b"".join([piece async for _, piece in _pieces(port, ASK_S)]), 0)
        content = dict(decoder.replies).get(robotous.PRODUCT_NAME)
        return None if content is None else Found(name, identity=robotous.parse_name(content))
    session = cast("Callable[..., Session]", DEVICES[name].session)(**question_options(DEVICES[name]))
    samples: list[tuple[int, Any]] = []
    port.write(session.start(time.monotonic_ns()))
    try:
        async for now_ns, data in _pieces(port, ASK_S):
            samples += [(now_ns, sample) for sample in session.receive(data, now_ns)]
            due_ns = session.next_deadline()
            if due_ns is not None and due_ns <= now_ns:
                port.write(session.on_time(now_ns))
    finally:
        port.write(session.stop())
    if not session.identity and len(samples) < LEAST_READINGS:
        return None
    found = _described(name, samples, session.identity)
    return replace(found, rate_hz=None) if DEVICES[name].kind == "gripper" else found


def question_options(device: Device, transport: str = "serial") -> dict[str, Any]:
    """Return options of a session whose readings are not used as forces: the tables are placeholders."""
    if device.needs_tables:
        return {"force_table": [(0.0, 1.0), (255.0, 2.0)], "width_table": [(0.0, 0.1), (1.0, 0.0)], "speed_table": None}
    return {"wiring": transport} if device.needs_wiring else {}


async def _opened(path: str, baud: int) -> serial.Serial:
    try:
        return await asyncio.to_thread(serial.Serial, path, baud, timeout=0, write_timeout=1, exclusive=True)
    except ValueError as error:
        raise OSError(str(error)) from None
