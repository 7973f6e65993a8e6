"""What the devices of the measurement say, and the config that tells the daemon of them.

Every force reading carries its own number, so that a message tells which reading it is about: the sensor's x force is
the number times INDEX_N, exact in the float32 of the wire and a gentle pull in newtons.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from slipd.devices import bota
from slipd.tools.sim.emulated_pvdf import PvdfElectronics, PvdfPad
from slipd.tools.sim.scene_parts import Pad, Patch
from slipd.types.arrays import Array

INDEX_N = 2.0**-16
"""30 s at 1 kHz pull with 0.46 N at the end."""

WRENCH_HZ = 1000
PAD_HZ = 200
LEVER_M = (0.004, -0.002, -0.025)
QUAT_XYZW = (0.9659258, 0.2588190, 0.0, 0.0)
"""The mounting of the demo: the sensor looks the other way, turned by 30° about the pad's normal."""

MU = 0.55
NORMAL_N = 8.0
SPIN_NM = 0.015
PULL = 0.12
"""Tangential over normal force. With the spin, the demo's contact patch is then used to about half."""

FREE_S, TARE_S, CLOSE_S = 0.8, 0.1, 0.5
"""Time until the grip closes, in which each finger is tared for so long, and time of closing, s; all in the warm-up."""

FORCE_STD_N = 0.02
TORQUE_STD_NM = 0.0002
PATCH = Patch()

EVERY_READING_HZ = 1e6
"""The most that a config may ask for: every reading is published, but of those that came in one read the first."""


def rotation() -> Array:
    """Takes sensor coordinates to pad coordinates, shape (3, 3); from the quaternion by hand, as the floor needs it."""
    x, y, z, w = np.asarray(QUAT_XYZW) / np.linalg.norm(QUAT_XYZW)
    return np.array(
        (
            (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
            (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
            (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
        )
    )


def index_weights() -> list[float]:
    """What (tangential x, tangential y, normal force) of a message are to be weighted with to give the number."""
    x_of_sensor = rotation()[:, 0] / INDEX_N
    return [float(x_of_sensor[0]), float(x_of_sensor[1]), -float(x_of_sensor[2])]


def grip(count: int, rate_hz: float) -> Array:
    """The normal force at each of ``count`` readings, N: free, then gripped within the warm-up, then held."""
    t_s = np.arange(count) / rate_hz
    return NORMAL_N * np.clip((t_s - FREE_S) / CLOSE_S, 0.0, 1.0)


def wrench_frames(normal_n: Array, patch: Patch, seed: int) -> list[bytes]:
    """Bota frames of one finger: a contact of the given patch that is pulled, and twisted to and fro.

    Free readings carry no number, which a tare would take for an offset.
    """
    rng = np.random.default_rng(seed)
    count = len(normal_n)
    t_s = np.arange(count) / WRENCH_HZ
    force = np.zeros((count, 3))
    force[:, 0] = np.where(normal_n > 0.0, np.arange(count), 0) * INDEX_N
    force[:, 1] = PULL * normal_n + rng.normal(scale=FORCE_STD_N, size=count)
    force[:, 2] = normal_n + rng.normal(scale=FORCE_STD_N, size=count)
    turn = rotation()
    fx, fy, fz = (force @ turn.T).T
    spin = SPIN_NM * normal_n / NORMAL_N * (1.0 + 0.2 * np.sin(np.pi * t_s))
    cx, cy = patch.centre_m
    about_pad = np.stack((cy * fz, -cx * fz, cx * fy - cy * fx + spin), axis=1)
    about_sensor = about_pad - np.cross(np.asarray(LEVER_M), np.stack((fx, fy, fz), axis=1))
    torque = about_sensor @ turn + rng.normal(scale=TORQUE_STD_NM, size=(count, 3))
    period_us = 1_000_000 // WRENCH_HZ
    readings = zip(force.tolist(), torque.tolist(), strict=True)
    return [bota.encode_frame(f, m, index * period_us) for index, (f, m) in enumerate(readings)]


def pad_scans(normal_n: Array, patch: Patch, seed: int) -> list[bytes]:
    """Scans of one pad, with the noise, gains, offsets and leak of the emulated one."""
    pad = Pad()
    electronics = PvdfElectronics(rate_hz=float(PAD_HZ))
    shares = pad.shares(patch)
    emulated = PvdfPad(pad.rows, pad.cols, electronics, seed)
    period_ns = 1_000_000_000 // PAD_HZ
    scan_ns = electronics.dwell_ns * shares.size
    scans: list[bytes] = []
    for scan, n in enumerate(normal_n):
        emulated.press(n * shares)
        scans += emulated.advance(scan * period_ns + scan_ns)
    return scans


@dataclass(frozen=True)
class Stream:
    """What one pseudo-terminal carries.

    Attributes:
        name: As the daemon names it, e.g. ``left.wrench``.
        frames: What is written, one element a reading.
        rate_hz: How often.
        phase_s: When the first is due.
    """

    name: str
    frames: list[bytes]
    rate_hz: float
    phase_s: float = 0.0


def two_fingers(seconds: float) -> list[Stream]:
    """A grip held by two full fingers. Nothing keeps the devices in step, so their phases differ."""
    streams = []
    for seed, (name, patch, phase_s) in enumerate((("left", PATCH, 0.0), ("right", PATCH.mirrored(), 0.0004))):
        forces = grip(round(seconds * WRENCH_HZ), WRENCH_HZ)
        images = grip(round(seconds * PAD_HZ), PAD_HZ)
        streams.append(Stream(f"{name}.wrench", wrench_frames(forces, patch, seed), WRENCH_HZ, phase_s))
        streams.append(Stream(f"{name}.pad", pad_scans(images, patch, seed), PAD_HZ, phase_s + 0.00025))
    return streams


def config_text(ports: dict[str, str], rates: dict[str, Any]) -> str:
    """The config of a rig with these streams.

    Args:
        ports: Stream → path of its port.
        rates: ``[rates]``; empty: the defaults.
    """
    lines = ["[rates]", *(f"{key} = {value}" for key, value in rates.items())]
    for finger in sorted({name.partition(".")[0] for name in ports}):
        lines += [f"[finger.{finger}]", f"mu = {MU}"]
        lines += [
            f"[finger.{finger}.wrench]",
            'device = "bota"',
            f'port = "{ports[f"{finger}.wrench"]}"',
            f"rate_hz = {float(WRENCH_HZ)}",
            f"pad_from_sensor = {{ xyz_m = {list(LEVER_M)}, quat_xyzw = {list(QUAT_XYZW)} }}",
            f"force_std_n = {FORCE_STD_N}",
            f"torque_std_nm = {TORQUE_STD_NM}",
        ]
        if f"{finger}.pad" in ports:
            lines += [f"[finger.{finger}.pad]", f'port = "{ports[f"{finger}.pad"]}"', _PAD]
    return "\n".join(lines) + "\n"


_PAD = f"""device = "pvdf"
rate_hz = {float(PAD_HZ)}
rows = {Pad().rows}
cols = {Pad().cols}
pitch_m = {Pad().pitch_m}
electrode_m = {Pad().electrode_m}
axis_scale = [{1.0 / PvdfElectronics().gain_counts_per_n}]
threshold = 0.02
charge_tau_s = {PvdfElectronics().tau_s}"""
