"""``slipd init``: list the serial ports, find out which devices are on them, and write a first config."""

from __future__ import annotations

import asyncio
import os
from pathlib import Path

from slipd import config
from slipd.errors import SlipdError
from slipd.tools.discovery.config_draft import draft
from slipd.tools.discovery.port_probe import BY_ID, BY_PATH, DEV, Found, SerialPort, identify_port, list_ports
from slipd.tools.draft import Kind
from slipd.tools.draft import draft as whole_file
from slipd.types.device_text import one_line

CONFIG = Kind("a config", lambda _: False, replaceable=False)


def init_command(file: Path, by_id: Path | None, *, only_list: bool) -> None:
    """Print every serial port with its device, and write a config for them.

    Args:
        file: New config; an existing one is never replaced.
        by_id: Folder of the ports; None: that of udev, then the sockets, then the numbered ports.
        only_list: Write nothing.

    Raises:
        SlipdError: There is no port, no sensor answers, or the file exists or cannot be written.
    """
    if not only_list and file.exists():
        raise SlipdError(f"{file} exists, and is not replaced; give another name, or only list: slipd init --list")
    nowhere = Path(os.devnull)
    ports = list_ports() if by_id is None else list_ports(by_id.absolute(), nowhere, nowhere)
    if not ports:
        where = f"{BY_ID}, {BY_PATH} or {DEV}/ttyUSB*, ttyACM*" if by_id is None else str(by_id)
        raise SlipdError(f"there is no serial port in {where}; devices on a network are not searched (docs/devices.md)")
    found, unknown = asyncio.run(_identify(ports))
    if only_list:
        return
    try:
        text = draft(found, unknown, file.name)
    except ValueError as error:
        raise SlipdError(f"{error}; nothing is written. `slipd config list` lists configs to start from") from None
    config.parse(text, str(file))
    with whole_file(file, CONFIG, overwrite=False) as out:
        out.write_text(text, encoding="utf-8")
    print(f"{file}: written. Fill in what is marked MEASURE and no touch shows (slipd docs first_day); then:")
    print(f"  slipd check {file}\n  slipd run {file}\n  slipd commission {file}     # in another terminal")


async def _identify_one(port: SerialPort) -> Found | OSError | None:
    """Return the device on a port, or why the port cannot be opened."""
    try:
        return await identify_port(str(port.path))
    except OSError as error:
        return error


async def _identify(ports: list[SerialPort]) -> tuple[list[tuple[SerialPort, Found]], list[SerialPort]]:
    """Identify the devices on all ports at once, and print what is found."""
    results = await asyncio.gather(*(_identify_one(port) for port in ports))
    found: list[tuple[SerialPort, Found]] = []
    unknown: list[SerialPort] = []
    for port, result in zip(ports, results, strict=True):
        if isinstance(result, Found):
            found.append((port, result))
            print(f"{port.path}: {result.device}{f', {one_line(result.identity)}' if result.identity else ''}")
        elif isinstance(result, OSError):
            unknown.append(port)
            print(f"{port.path}: cannot be opened: {result.strerror or result}; is another program using it?")
        else:
            unknown.append(port)
            print(f"{port.path}: no device that slipd knows answered")
        if port.warning:
            print(f"  {port.warning}")
    return found, unknown
