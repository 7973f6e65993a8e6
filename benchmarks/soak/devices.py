"""The sensors of two fingers in a process of their own: ``python -m soak.devices PLAN``, a JSON `Plan`.

They are free until the process receives SIGUSR1, so that they can be tared, and pressed from then on.
"""

from __future__ import annotations

import asyncio
import json
import signal
import sys
from dataclasses import dataclass, replace

import numpy as np

from slipd.tools.sim.emulate import prepare_process, serve_until_ended
from slipd.tools.sim.emulated_pvdf import COLS, IDEAL, ROWS, PvdfPad
from slipd.tools.sim.emulated_rdt import NetftSensor
from slipd.tools.sim.emulators import Emulator
from slipd.tools.sim.scene_parts import Pad, Patch

FORCE_HZ, RECORDS_A_DATAGRAM = 4000.0, 40
IMAGE_HZ, DWELL_NS = 500.0, 10_000
NORMAL_N, PULL_N, SPIN_NM = 8.0, 1.0, 0.015
COUNTS_PER_N = 2000.0


@dataclass(frozen=True)
class Plan:
    """Where the sensors of each finger are: (force, pad) addresses."""

    fingers: list[tuple[str, str]]


def make(plan: Plan) -> list[tuple[str, Emulator, str]]:
    """The devices, free."""
    devices: list[tuple[str, Emulator, str]] = []
    for seed, (force_at, pad_at) in enumerate(plan.fingers):
        sensor = NetftSensor(seed, rate_hz=FORCE_HZ, block=RECORDS_A_DATAGRAM)
        image = PvdfPad(ROWS, COLS, replace(IDEAL, rate_hz=IMAGE_HZ, dwell_ns=DWELL_NS), seed)
        devices += [("netft", sensor, force_at), ("pvdf", image, pad_at)]
    return devices


def press(devices: list[tuple[str, Emulator, str]]) -> None:
    """Hold them in a contact that the demo's pads have."""
    patch = Patch()
    x_m, y_m = patch.centre_m
    force = np.array((0.0, PULL_N, -NORMAL_N))  # the object pushes into the pad
    torque = np.array((y_m * force[2], -x_m * force[2], x_m * force[1] + SPIN_NM))
    for _, device, _ in devices:
        if isinstance(device, NetftSensor):
            device.feel(force, torque)
        elif isinstance(device, PvdfPad):
            device.press(COUNTS_PER_N * NORMAL_N * Pad().shares(patch))


def _ready(devices: list[tuple[str, Emulator, str]]) -> None:
    asyncio.get_running_loop().add_signal_handler(signal.SIGUSR1, press, devices)
    print("\n".join(address for _, _, address in devices), flush=True)


if __name__ == "__main__":
    made = make(Plan(json.loads(sys.argv[1])))
    prepare_process()
    asyncio.run(serve_until_ended(made, ready=lambda: _ready(made)))
