"""The sensors of two fingers, pressed, in a process of their own: ``python -m soak.devices PLAN``, a JSON `Plan`."""

from __future__ import annotations

import asyncio
import json
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
    """The devices, held in a contact that the demo's pads have."""
    devices: list[tuple[str, Emulator, str]] = []
    for seed, (force_at, pad_at) in enumerate(plan.fingers):
        sensor = NetftSensor(seed, rate_hz=FORCE_HZ, block=RECORDS_A_DATAGRAM)
        patch = Patch()
        x_m, y_m = patch.centre_m
        force = np.array((0.0, PULL_N, -NORMAL_N))  # the object pushes into the pad
        torque = np.array((y_m * force[2], -x_m * force[2], x_m * force[1] + SPIN_NM))
        sensor.feel(force, torque)
        image = PvdfPad(ROWS, COLS, replace(IDEAL, rate_hz=IMAGE_HZ, dwell_ns=DWELL_NS), seed)
        image.press(COUNTS_PER_N * NORMAL_N * Pad().shares(patch))
        devices += [("netft", sensor, force_at), ("pvdf", image, pad_at)]
    return devices


if __name__ == "__main__":
    made = make(Plan(json.loads(sys.argv[1])))
    prepare_process()
    addresses = "\n".join(address for _, _, address in made)
    asyncio.run(serve_until_ended(made, ready=lambda: print(addresses, flush=True)))
