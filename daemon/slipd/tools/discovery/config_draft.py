"""Write a first config for the devices that were found, with a comment at every value to measure."""

from __future__ import annotations

import asyncio
import json
import os
import re
from collections.abc import Sequence
from pathlib import Path

from slipd import config
from slipd.config import Wrench
from slipd.config.check_hints import OPTIONS, default_rate_hz
from slipd.devices import DEVICES, SLIPD, find_device
from slipd.errors import SlipdError, UsageError, one_line
from slipd.tools.discovery.port_probe import BY_ID, BY_PATH, DEV, Found, SerialPort, identify_port, list_ports
from slipd.tools.outputs import NEW
from slipd.tools.outputs import draft as whole_file

FINGERS = ("left", "right")
Placed = tuple[SerialPort, Found]

SHAPES = {"tsf85": (7, 4), "papillarray": (3, 3)}
"""Rows and columns of pads whose devices do not report them."""

PITCHES_M = {"tsf85": 0.0053, "papillarray": 0.007, "pvdf": 0.0032, "wts": 0.0034, "dsacon32": 0.0034}
POLLED_HZ = 50.0
"""Usual rate of a gripper that is polled: its readings are not counted while it is asked."""
_NOISE = Wrench.model_fields

HEAD = """\
# Written by `slipd init`. "MEASURE": the value is a guess; `slipd commission {file}` finds how the sensors are mounted,
# and docs/first_day.md goes through the rest. All keys: docs/config.md.
"""

LIMIT = """\
# max_force_n = 40.0    # N on one pad, largest force that a request may ask for; without it nothing is ever moved
"""

NO_GRIPPER = """
# No gripper answered on a serial port. The table of one on a network, here a WSG:
# [gripper]
# device = "wsg"
# port = "tcp://192.168.1.20:1000"
# rate_hz = 50.0
# max_force_n = 30.0      # N on one pad, largest force that a request may ask for; without it nothing is ever moved
"""

INCIDENTS = """
[recording.incidents]   # the last minute is kept in memory, and saved when a finger warns: slipd view shows it
enabled = true
"""


_COMMENT = re.compile(r"^(\w+ = .*?) +(# (?:MEASURE|slipd sets).*)$", re.MULTILINE)
"""A key, and the comment that begins in one column for all."""


def draft(found: Sequence[Placed], unknown: Sequence[SerialPort], file: str) -> str:
    """Return a config.

    Args:
        found: Ports with their devices; the first force sensor and the first pad are taken for the left finger.
        unknown: Ports without a known device; they are listed in a comment.
        file: Name of the config, for its head.

    Raises:
        ValueError: There is neither a force sensor nor a pad that measures shear, so there is no finger.
    """
    wrenches, pads = _of_kind(found, "wrench"), _of_kind(found, "tactile")
    pads = [pad for number, pad in enumerate(pads) if number < len(wrenches) or DEVICES[pad[1].device].axes == 3]
    grippers = _of_kind(found, "gripper")
    if not wrenches and not pads:
        raise ValueError("no force sensor answered on a serial port, and no pad that measures shear by itself")
    lines = [HEAD.format(file=file)]
    lines += [f"# {port.path}: no device that slipd knows answered" for port in unknown]
    for number, name in enumerate(FINGERS[: max(len(wrenches), len(pads))]):
        lines += [
            f"\n[finger.{name}]",
            "mu = 0.4  # MEASURE (`slipctl friction measure`): low estimate of static friction",
        ]
        if number < len(wrenches):
            lines += _wrench(name, *wrenches[number])
        if number < len(pads):
            lines += _pad(name, *pads[number])
    lines += _gripper(*grippers[0][:2]) if grippers else [NO_GRIPPER]
    lines.append(INCIDENTS)
    used = {id(each[1]) for each in [*wrenches[:2], *pads[:2], *grippers[:1]]}
    lines += [f"# not used: {found.device} on {port.path}" for port, found in found if id(found) not in used]
    text = _COMMENT.sub(lambda line: f"{line[1]:<23} {line[2]}", "\n".join(lines))
    return re.sub(r"\n{3,}", "\n\n", text).rstrip("\n") + "\n"


def _of_kind(found: Sequence[Placed], kind: str) -> list[tuple[SerialPort, Found, str]]:
    """Return every sensor of a kind: its port, its device and its name on a port that carries several."""
    return [
        (port, device, sensor)
        for port, device in found
        if DEVICES[device.device].kind == kind
        for sensor in (device.sensors or ("",))
    ]


def _stream(header: str, port: SerialPort, found: Found, sensor: str) -> list[str]:
    set_hz = default_rate_hz(DEVICES[found.device])
    lines = [f"\n[{header}]", f'device = "{found.device}"']
    provider = find_device(found.device)
    if provider is not None and provider.package != SLIPD:
        lines.append(f'package = "{provider.package}"')
    if found.identity:
        lines.append(f"# it reports: {one_line(found.identity)}")
    if port.warning:
        lines.append(f"# {port.warning}")
    lines.append(f"port = {json.dumps(str(port.path))}")
    if sensor:
        lines.append(f'sensor = "{sensor}"   # MEASURE: press this finger; the other sensor is on the other one')
    if set_hz is None:
        return [*lines, f"rate_hz = {found.rate_hz or POLLED_HZ}  # MEASURE: `slipctl status` shows the rate"]
    option = DEVICES[found.device].rate_option
    assert option is not None  # noqa: S101 - it set the rate
    return [*lines, f"rate_hz = {set_hz}  # slipd sets it by options.{option.name}; change both together"]


def _needed(header: str, found: Found) -> list[str]:
    """Return what the device does not report: keys of its table, then its table of options."""
    keys: list[str] = []
    options: list[str] = []
    for need in DEVICES[found.device].needs:
        name = need.key.removeprefix(OPTIONS)
        start = f"{name} = {need.guess}" if need.guess else f"# {name} = …"
        (keys if name == need.key else options).append(f"{start}  # MEASURE: {need.how}")
    return [*keys, f"\n[{header}.options]", *options] if options else keys


def _wrench(name: str, port: SerialPort, found: Found, sensor: str) -> list[str]:
    return [
        *_stream(f"finger.{name}.wrench", port, found, sensor),
        "sign = 1  # MEASURE",
        "pad_from_sensor = { xyz_m = [0.0, 0.0, 0.0], quat_xyzw = [0.0, 0.0, 0.0, 1.0] }  # MEASURE",
        f"force_std_n = {_NOISE['force_std_n'].default}  # MEASURE: noise of each component at rest, N",
        f"torque_std_nm = {_NOISE['torque_std_nm'].default}  # MEASURE, N·m",
        *_needed(f"finger.{name}.wrench", found),
    ]


def _pad(name: str, port: SerialPort, found: Found, sensor: str) -> list[str]:
    rows, cols = SHAPES.get(found.device) or _shape(found)
    axes = max(DEVICES[found.device].axes, 1)
    pitch_m = PITCHES_M.get(found.device, 0.004)
    return [
        *_stream(f"finger.{name}.pad", port, found, sensor),
        f"rows = {rows}  # MEASURE",
        f"cols = {cols}  # MEASURE",
        f"pitch_m = {pitch_m}  # MEASURE",
        f"electrode_m = {pitch_m}  # MEASURE",
        "swap_xy = false  # MEASURE",
        "flip_x = false  # MEASURE",
        "flip_y = false  # MEASURE",
        f"axis_scale = {[1.0] * axes if axes == 1 else [1.0, 1.0, -1.0]}  # MEASURE",
        "threshold = 0.0  # MEASURE: ten times the noise of a taxel",
        *_needed(f"finger.{name}.pad", found),
    ]


def _shape(found: Found) -> tuple[int, int]:
    """Return rows and columns: as reported, or the most square shape with longer rows."""
    rows = found.rows or max(n for n in range(1, found.taxels + 1) if found.taxels % n == 0 and n * n <= found.taxels)
    return rows, found.taxels // rows


def _gripper(port: SerialPort, found: Found) -> list[str]:
    return [*_stream("gripper", port, found, ""), *_needed("gripper", found), LIMIT]


def init_command(file: Path, by_id: Path | None, *, only_list: bool) -> None:
    """Print every serial port with its device, and write a config for them.

    Args:
        file: New config; an existing one is never replaced.
        by_id: Folder of the ports; None: that of udev, then the sockets, then the numbered ports.
        only_list: Write nothing.

    Raises:
        UsageError: The file exists, or its folder or that of the ports does not.
        SlipdError: There is no port, no sensor answers, or the file cannot be written.
    """
    if not only_list and file.exists():
        raise UsageError(f"{file} exists, and is not replaced; give another name, or only list: slipd init --list")
    if not only_list and not file.parent.is_dir():
        raise UsageError(
            f"{file}: cannot be created: there is no folder {file.parent}; create it: mkdir -p {file.parent}"
        )
    if by_id is not None and not by_id.is_dir():
        raise UsageError(f"--ports must be a folder of serial ports, such as {BY_ID}; there is no folder {by_id}")
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
    with whole_file(file, NEW, overwrite=False) as out:
        out.write_text(text, encoding="utf-8")
    print(f"{file}: written. Fill in what is marked MEASURE and no touch shows (slipd docs first_day); then:")
    print(f"  slipd check {file}\n  slipd run {file}\n  slipd commission {file}     # in another terminal")


async def _identify_one(port: SerialPort) -> Found | str:
    """Return the device on a port, or why there is none."""
    try:
        return await identify_port(str(port.path)) or "no device that slipd knows answered"
    except OSError as error:
        return f"cannot be opened: {error.strerror or error}; is another program using it?"


async def _identify(ports: list[SerialPort]) -> tuple[list[Placed], list[SerialPort]]:
    """Identify the devices on all ports at once, and print what is found; return those with one, and the others."""
    results = list(zip(ports, await asyncio.gather(*map(_identify_one, ports)), strict=True))
    for port, result in results:
        what = (
            result if isinstance(result, str) else ", ".join(filter(None, (result.device, one_line(result.identity))))
        )
        print(f"{port.path}: {what}")
        if port.warning:
            print(f"  {port.warning}")
    found = [(port, result) for port, result in results if isinstance(result, Found)]
    return found, [port for port, result in results if isinstance(result, str)]
