"""Rigs with every device on every kind of line it has, and the configs that read them all.

What a config must say of a device (names of its sensors, taxels) is asked of its emulator in a rehearsal.
"""

from __future__ import annotations

import json
import socket
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from driving import drive
from own_address import free_port, own_host

from slipd.devices import DEVICES, Device
from slipd.tools.sim.emulate import emulator_for
from slipd.tools.sim.emulated_netft import NetftSensor
from slipd.tools.sim.emulators import Emulator
from slipd.types.samples import Sample, TactileSample

REHEARSAL_S = 3.0
MS = 1_000_000

_LINES = [(name, transport) for name, device in DEVICES.items() for transport in device.transports]
_GRIPPERS = [line for line in _LINES if DEVICES[line[0]].kind == "gripper"]
RIGS = [
    [*(line for line in _LINES if line not in _GRIPPERS), _GRIPPERS[0]],
    *([("bota", "serial"), gripper] for gripper in _GRIPPERS[1:]),
]
"""Every device on every kind of line; a rig has one gripper."""

COMMON = """
[rates]
slip_hz = 10.0
wrench_hz = 10.0
tactile_hz = 1.0
"""

GRIPPER_TABLES = """
force_table = [[0, 3.0], [255, 30.0]]
width_table = [[0.0, 0.085], [1.0, 0.0]]
"""


@dataclass(frozen=True)
class Place:
    """A device in the rig.

    Attributes:
        device: Its name.
        transport: Kind of its line.
        address: Of its line.
        stream: Name of its stream in the config.
        table: Its table in the config.
    """

    device: str
    transport: str
    address: str
    stream: str
    table: str


def make_rig(folder: Path, lines: list[tuple[str, str]]) -> list[Place]:
    """Places every device: force sensors on fingers of their own, each pad in front of one of them.

    Args:
        folder: For pseudo-terminals and local sockets.
        lines: Device and kind of line of each.
    """
    places: list[Place] = []
    fingers = {"wrench": 0, "pad": 0}
    for name, transport in lines:
        address = _address(folder, name, transport)
        emulator = make_device(name, address)
        sample = _rehearse(DEVICES[name], emulator, transport)
        kind = {"gripper": "gripper", "wrench": "wrench", "tactile": "pad"}[_kind(DEVICES[name], sample)]
        stream = kind if kind == "gripper" else f"f{fingers[kind]:02d}x.{kind}"
        if kind != "gripper":
            fingers[kind] += 1
        places.append(Place(name, transport, address, stream, _table(stream, name, address, emulator, sample)))
    return places


def make_device(name: str, address: str) -> Emulator:
    """The emulator of a device; none sends more than 1000 readings a second, for this machine runs them all."""
    return NetftSensor(1, rate_hz=1000.0) if name == "netft" else emulator_for(name, address, 1)


def config_text(places: list[Place]) -> str:
    """The config of the rig."""
    return COMMON + "\n".join(place.table for place in places)


def plan_text(places: list[Place]) -> str:
    """What the process that emulates the devices is told, see `bed.devices`."""
    return json.dumps([(place.device, place.address) for place in places])


def _address(folder: Path, device: str, transport: str) -> str:
    if transport == "serial":
        return str(folder / device)
    if transport == "external":
        return f"ipc://{folder}/{device}.socket"
    if transport == "local":
        return f"unix://{folder}/{device}.socket"
    kind = socket.SOCK_DGRAM if transport == "udp" else socket.SOCK_STREAM
    return f"{'ws' if transport == 'websocket' else transport}://{own_host()}:{free_port(kind)}"


def _rehearse(device: Device, emulator: Emulator, transport: str) -> Sample:
    """The first reading that the device's own session or decoder makes of its emulator."""
    options = emulator.options | ({"wiring": transport} if device.needs_wiring else {})
    emulator.opened(0)
    if device.session is None:
        decoder = device.decoder(**options)
        for t_ns in range(0, round(REHEARSAL_S * 1e9), MS):
            for data in emulator.advance(t_ns):
                if samples := decoder.receive(data, t_ns):
                    return samples[0]
        raise AssertionError(f"the emulated {device.name} says nothing that its decoder understands")
    session = device.session(**options)
    asks = device.inquiry(**options) if device.inquiry is not None else None
    if asks is not None:
        session.start(0)
        session.receive(emulator.inquire(asks.request), 0)  # type: ignore[attr-defined]
    found = drive(session, emulator, REHEARSAL_S, start=asks is None)
    assert found, f"the emulated {device.name} says nothing that its session understands: {session.state}"
    return found[0]  # type: ignore[no-any-return]


def _kind(device: Device, sample: Sample) -> str:
    if device.kind != "any":
        return device.kind
    return "tactile" if isinstance(sample, TactileSample) else "wrench"


def _table(stream: str, name: str, address: str, emulator: Emulator, sample: Sample) -> str:
    keys: dict[str, Any] = {"device": name, "port": address, "rate_hz": float(emulator.rate_hz)}
    options = dict(emulator.options)
    options.pop("wiring", None)
    if source := getattr(sample, "source", ""):
        keys["sensor"] = source
    header = f"[{stream}]" if stream == "gripper" else f"[finger.{stream}]"
    if isinstance(sample, TactileSample):
        taxels, axes = sample.values.shape[0], sample.values.shape[1] if sample.values.ndim == 2 else 1
        rows = options.pop("rows", next(n for n in range(1, 65) if taxels % n == 0 and taxels // n <= 64))
        options.pop("cols", None)
        keys |= {"rows": rows, "cols": taxels // rows, "pitch_m": 0.003, "electrode_m": 0.0015}
        keys["axis_scale"] = [1e-4] * axes
    if options:
        keys["options"] = options
    lines = [f"{key} = {_toml(value)}" for key, value in keys.items()]
    return "\n".join([header, *lines]) + (GRIPPER_TABLES if DEVICES[name].needs_tables else "\n")


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_toml(inner)}" for key, inner in value.items()) + " }"
    return json.dumps(value)
