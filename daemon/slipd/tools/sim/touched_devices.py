"""The emulated devices of a config: what each sensor reads of the load on its pad, and the config with their addresses.

The config is taken as the truth about how the sensors are mounted. Its copy has other ports, no identities of devices,
the default endpoints, and the calibration of a Net F/T over TCP, not from its web page, where its output rate is not
set either; everything else is as it was.
"""

from __future__ import annotations

import json
import math
import os
import re
import socket
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from slipd import config
from slipd.config.config_file import key_lines, lines_of
from slipd.devices import DEVICES
from slipd.errors import ConfigError, ConfigFault
from slipd.grasp.grasp_fingers import Place
from slipd.signals.gravity import FingerWeight
from slipd.signals.mounting import mounting_matrix
from slipd.signals.pad import PadGeometry
from slipd.tools.sim.emulated_pads import REST_COUNTS
from slipd.tools.sim.emulated_pvdf import PvdfElectronics, PvdfPad
from slipd.tools.sim.emulators import Emulator, accepted, make_emulator
from slipd.tools.sim.hand import Hand, PadLoad
from slipd.tools.sim.hand_commands import Fingers
from slipd.tools.sim.unkind import Unkind
from slipd.types.arrays import Array

BIAS = np.array((0.6, -0.4, 0.9, 0.004, -0.003, 0.002))
"""Reading of every force sensor without load, N and N·m: a real one has no zero either."""

COUNTS_PER_N = {"xela": 1000.0, "tsf85": 2000.0, "wts": 400.0, "dsacon32": 400.0}
"""Counts of a taxel per newton, for pads whose config leaves the unit open."""

PATCH_M = 0.006
"""Radius of the contact, m; it is at least 1.6 times the pitch."""

SCAN_SHARE = 0.5
"""A multiplexed pad scans for this share of its period."""

_PAGE = re.compile(r"""(\bcalibration\s*=\s*)["']xml["']""")
"""Calibration of a Net F/T on its web page: only a privileged process may serve port 80, so the copy asks over TCP."""
_PAGE_RATE = re.compile(r"(\boutput_hz\s*=\s*)\d+")
"""Output rate that is set there; the emulated sensor has the rate of the config."""
BUS_KEYS = ("publish", "requests", "secret_key", "readers", "requesters", "allow_local_tcp")


class TouchedDevices:
    """The devices of a config, each with a new address, under the loads of a hand.

    Args:
        rig: The config.
        folder: For pseudo-terminals and local sockets.
        seed: Seed of the noise.
        unkind: Whether the sensors are as unkind as real ones, see `slipd.tools.sim.unkind`.

    Attributes:
        devices: Name, emulator and address of each, for `slipd.tools.sim.emulate.emulated`.
        fingers: How far the pad of each finger reaches, for `slipd.tools.sim.hand_commands.parse_command`.
        addresses: New address of each port of the config.
        hand: What acts on the pads.

    Raises:
        OSError: No port of this machine is free.
    """

    def __init__(self, rig: config.Config, folder: Path, seed: int = 0, *, unkind: bool = False) -> None:
        self._rig = rig
        self.fingers = pad_reaches(rig)
        self._by_port: dict[str, Any] = {}
        self.addresses: dict[str, str] = {}
        self.devices: list[tuple[str, Emulator, str]] = []
        for number, (port, streams) in enumerate(_ports(rig)):
            name, first = next(iter(streams.items()))
            emulator = _emulator(streams, seed + number)
            if unkind and not isinstance(first, config.Gripper):
                emulator = Unkind(emulator, seed + number, first.cols if isinstance(first, config.Pad) else 1)
            self._by_port[port] = emulator
            self.addresses[port] = _address(folder, port, name.replace(".", "-"), number)
            self.devices.append((first.device, emulator, self.addresses[port]))
        weights = {
            name: FingerWeight() if finger.wrench is None else FingerWeight(finger.wrench.mass_kg, finger.wrench.com_m)
            for name, finger in rig.finger.items()
        }
        places = {} if rig.grasp is None else {name: Place(pad) for name, pad in rig.grasp.pads.items()}
        self.hand = Hand(weights, frozenset([*rig.finger][1:]), places)
        self._pads = {name: _TouchedPad(finger.pad) for name, finger in rig.finger.items() if finger.pad is not None}
        self._mountings = {
            name: np.linalg.inv(mounting_matrix(pose.xyz_m, pose.quat_xyzw, finger.wrench.sign))
            for name, finger in rig.finger.items()
            if finger.wrench is not None and (pose := finger.wrench.pad_from_sensor)
        }
        self._set: dict[str, tuple[PadLoad, bytes]] = {}
        self._grips = None if rig.gripper is None else self._by_port[rig.gripper.port]

    def advance(self, t_ns: int) -> None:
        """Let the hand act on the devices until ``t_ns``; a load that did not change is not set again."""
        if self._grips is not None:
            self._grips.part_m = self.hand.part_m
        if (arm := self._rig.streams().get("arm")) is not None:
            self._by_port[arm.port].carry(*self.hand.arm(t_ns * 1e-9), **_sensor(arm))
        for name, load in self.loads(t_ns).items():
            finger, weight = self._rig.finger[name], self.hand.weight(name, t_ns * 1e-9)
            if self._set.get(name) == (load, weight.tobytes()):
                continue
            self._set[name] = load, weight.tobytes()
            if finger.wrench is not None:
                felt = self._mountings[name] @ (load.wrench() + weight) + BIAS
                self._by_port[finger.wrench.port].feel(felt[:3], felt[3:], **_sensor(finger.wrench))
            if finger.pad is not None:
                self._by_port[finger.pad.port].press(self._pads[name].readings(load), **_sensor(finger.pad))

    def loads(self, t_ns: int) -> dict[str, PadLoad]:
        """Return the load on each pad."""
        grip_n = 0.0 if self._grips is None else self._grips.grip_n
        return {name: self.hand.load(name, t_ns * 1e-9, grip_n) for name in self._rig.finger}

    def config_text(self) -> str:
        """Return the config with the addresses of the emulated devices.

        Raises:
            ConfigError: The text of the config hides a port from the substitution, such as in an inline table.
        """
        lines, streams = lines_of(self._rig.text), self._rig.streams()
        for path, number in key_lines(self._rig.text).items():
            line = lines[number - 1]
            if path[-1] == "port":
                lines[number - 1] = with_other_port(line, self.addresses)
            elif path[-1] == "hardware_id" or (path[0] == "bus" and path[-1] in BUS_KEYS):
                lines[number - 1] = f"# {line}  # emulated devices have another"
            elif (stream := streams.get(".".join(path[1:3]))) is not None and stream.device == "netft":
                lines[number - 1] = _PAGE_RATE.sub(r"\g<1>0", _PAGE.sub(r'\1"tcp"', line))
        text = "\n".join(lines) + "\n"
        ports = {stream.port for stream in config.parse(text, "emulated config").streams().values()}
        if ports != set(self.addresses.values()):
            fault = 'every port must be on a line of its own: port = "…"'
            raise ConfigError("config", [ConfigFault("port", None, fault)])
        return text


def pad_reaches(rig: config.Config) -> Fingers:
    """Return how far the pad of each finger reaches from its centre along X and Y, m."""
    reaches: dict[str, tuple[float, float]] = {}
    for name, finger in rig.finger.items():
        reaches[name] = math.inf, math.inf
        if (pad := finger.pad) is not None:
            along, across = (pad.rows, pad.cols) if pad.swap_xy else (pad.cols, pad.rows)
            reaches[name] = 0.5 * along * pad.pitch_m, 0.5 * across * pad.pitch_m
    return reaches


class _TouchedPad:
    """What the taxels of a pad read of a load."""

    def __init__(self, pad: config.Pad) -> None:
        geometry = PadGeometry(pad.rows, pad.cols, pad.pitch_m, pad.electrode_m, pad.swap_xy, pad.flip_x, pad.flip_y)
        self._x, self._y = geometry.positions()
        self._radius_m = max(PATCH_M, 1.6 * pad.pitch_m)
        self._axes, self._swap = config.axes_of(pad), pad.swap_xy
        scale = np.array(pad.axis_scale if self._axes == 3 else pad.axis_scale[:1])
        open_unit = np.all(np.abs(scale) == 1.0) and not config.in_newtons(pad)
        self._per_n = scale * (COUNTS_PER_N.get(pad.device, 1.0) if open_unit else 1.0 / scale**2)
        base = REST_COUNTS if pad.device == "xela" else 0.0
        self._rest = np.reshape(pad.tare, _shape(pad)) - base if pad.tare else np.zeros(_shape(pad))
        if pad.device == "pvdf":  # its emulator has the gain
            self._per_n = np.sign(scale)

    def readings(self, load: PadLoad) -> Array:
        """Return the load on each taxel in the unit of its device."""
        away2 = (self._x - load.place_m[0]) ** 2 + (self._y - load.place_m[1]) ** 2
        shares = np.sqrt(np.clip(1.0 - away2 / self._radius_m**2, 0.0, None))
        if not shares.any():  # beyond the pad, or between taxels
            shares[away2.argmin()] = 1.0
        shares /= shares.sum()
        if self._axes != 3:
            return np.asarray(load.normal_n * shares * self._per_n + self._rest)
        forces = shares[:, None] * np.array((*load.tangential_n, -load.normal_n))
        lever = float(shares @ away2)
        if lever > 0.0:
            field = load.spin_nm / lever * shares
            forces[:, 0] -= field * (self._y - load.place_m[1])
            forces[:, 1] += field * (self._x - load.place_m[0])
        counts = forces * self._per_n
        if self._swap:
            counts = counts[:, [1, 0, 2]]
        return np.asarray(counts + self._rest)


def _ports(rig: config.Config) -> Iterator[tuple[str, dict[str, config.Stream]]]:
    """Yield every port once, with its streams by name."""
    streams = rig.streams()
    for port in dict.fromkeys(stream.port for stream in streams.values()):
        yield port, {name: stream for name, stream in streams.items() if stream.port == port}


def _sensor(stream: config.Stream) -> dict[str, str]:
    """Return the argument that names one of several sensors on a port."""
    return {"sensor": stream.sensor} if DEVICES[stream.device].shared else {}


def _emulator(streams: dict[str, config.Stream], seed: int) -> Emulator:
    """Return the emulator of the device on one port, with the sizes, gains and noise that the config states."""
    first = next(iter(streams.values()))
    device = first.device
    if isinstance(first, config.Pad) and device == "pvdf":
        dwell_ns = round(min(PvdfElectronics.dwell_ns, SCAN_SHARE * 1e9 / first.rate_hz / (first.rows * first.cols)))
        electronics = PvdfElectronics(
            tau_s=first.charge_tau_s or 1e6, gain_counts_per_n=1.0 / abs(first.axis_scale[0]), rate_hz=first.rate_hz,
            dwell_ns=dwell_ns,
        )  # fmt: skip
        return PvdfPad(first.rows, first.cols, electronics, seed)
    sensors = {stream.sensor: stream for stream in streams.values()}
    pads = {name: stream for name, stream in sensors.items() if isinstance(stream, config.Pad)}
    offered = {
        "rate_hz": first.rate_hz,
        "baud": first.baud or DEVICES[device].baud,
        "matrices": [(pad.cols, pad.rows) for _, pad in sorted(pads.items())],
        "pads": {name: _shape(pad) for name, pad in pads.items()},
        "wrenches": {
            name: (stream.force_std_n, stream.torque_std_nm)
            for name, stream in sensors.items()
            if isinstance(stream, config.Wrench)
        },
        "arms": [name for name, stream in sensors.items() if isinstance(stream, config.Arm)],
        "rates_hz": {name: stream.rate_hz for name, stream in sensors.items()},
    }
    if isinstance(first, config.Wrench):
        offered |= {"noise_n": first.force_std_n, "noise_nm": first.torque_std_nm}
    if isinstance(first, config.Pad):
        offered |= {"rows": first.rows, "cols": first.cols, "taxels": first.rows * first.cols}
    return make_emulator(device, seed, **accepted(device, offered | config.device_options(first)))


def _shape(pad: config.Pad) -> tuple[int, ...]:
    """Return the shape of an image."""
    taxels = pad.rows * pad.cols
    return (taxels, 3) if config.axes_of(pad) == 3 else (taxels,)


def _address(folder: Path, port: str, name: str, number: int) -> str:
    """Return a new address of the kind of a port."""
    kind = config.transport_of(port)
    if kind == "serial":
        return str(folder / name)
    if kind == "external":
        return f"ipc://{folder}/{name}.socket"
    if kind == "local":
        return f"unix://{folder}/{name}.socket"
    # A Net F/T answers its inquiry at a fixed port: an address that another process hardly uses.
    host = f"127.0.{64 + number}.{1 + os.getpid() % 250}"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM if kind == "udp" else socket.SOCK_STREAM) as free:
        free.bind((host, 0))
        return f"{'ws' if kind == 'websocket' else kind}://{host}:{free.getsockname()[1]}"


def with_other_port(line: str, others: Mapping[str, str]) -> str:
    """Return a line of a config with another port in place of its own, if ``others`` names one for it."""
    for port, other in others.items():
        for quoted in (json.dumps(port), f"'{port}'"):
            if quoted in line:
                return line.replace(quoted, json.dumps(other))
    return line
