"""The virtual gripper: a scene with the five devices in it, and the process that serves them.

The process has five pseudo-terminals with the bytes of real devices, and prints the true state. The scene advances 800
times per second.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from slipd.devices.external import encode_reading
from slipd.signals.mounting import mounting_matrix
from slipd.tools.sim.carry import GLASS_KG, GLASS_KGM2, Arm, CarryScript
from slipd.tools.sim.emulate import prepare_process, serve_until_ended
from slipd.tools.sim.emulated_pvdf import PvdfElectronics, PvdfPad
from slipd.tools.sim.emulated_robotiq_2f import Gripper2F
from slipd.tools.sim.emulated_wrenches import BotaSensor
from slipd.tools.sim.emulators import EmulatedDevice, Emulator
from slipd.tools.sim.scene import Scene, Truth
from slipd.tools.sim.scene_parts import Pad

LINES = {
    "left-wrench": "bota",
    "left-pad": "pvdf",
    "right-wrench": "bota",
    "right-pad": "pvdf",
    "gripper": "robotiq_2f",
}
"""The devices, by the names of their lines."""
ARM = "arm"

SENSOR_XYZ_M, SENSOR_QUAT_XYZW = (0.004, -0.002, -0.025), (0.9659258, 0.2588190, 0.0, 0.0)
"""Pose of a force sensor behind its pad, as ``pad_from_sensor`` in the config of the demo."""

BIAS = {
    "left": np.array((1.7, -0.9, -2.4, 0.030, -0.020, 0.011)),
    "right": np.array((-0.8, 1.3, -3.1, -0.012, 0.024, -0.018)),
}
"""Reading of each force sensor without load, N and N·m, with the weight of the finger, which does not move."""
CLOCK_PPM = {"left": 40.0, "right": -15.0}

IMAGE_NS = 2_500_000
"""How often the pads feel the load, ns: the grip force hardly changes within."""

ARM_NS, ARM_STD_MPS2 = 4_000_000, 0.03
"""Period of the arm's readings, and their noise."""


class VirtualRig:
    """Two fingers and a gripper in a scene. The clock of the scene starts when the gripper is first activated.

    Args:
        scene: The scene, at its start.
        seed: Seed of the noise.
        electronics: Electronics of both pads; None: the defaults.
        arm: Carries the gripper; None: nothing reports its motion.

    Attributes:
        scene: The scene in its present state.
        arm: The arm.
        devices: The emulated device of each line.
    """

    def __init__(
        self, scene: Scene, seed: int = 0, electronics: PvdfElectronics | None = None, arm: Arm | None = None
    ) -> None:
        self.scene, self.arm = scene, arm
        *sources, self._rng = np.random.default_rng(seed).spawn(3)
        pad, patch = Pad(), scene.patch
        self._shares = {"left": pad.shares(patch), "right": pad.shares(patch.mirrored())}
        self._to_sensor = np.linalg.inv(mounting_matrix(SENSOR_XYZ_M, SENSOR_QUAT_XYZW))
        self.devices: dict[str, Any] = {}
        for side, rng in zip(self._shares, sources, strict=True):
            self.devices[f"{side}-wrench"] = BotaSensor(rng, CLOCK_PPM[side])
            self.devices[f"{side}-pad"] = PvdfPad(pad.rows, pad.cols, electronics or PvdfElectronics(), rng)
        self._gripper = Gripper2F(((0.0, scene.open_width_m), (1.0, 0.0)))  # as in the config of the demo
        self.devices["gripper"] = self._gripper
        self._next_image_ns = self._next_arm_ns = 0

    @property
    def began_ns(self) -> int | None:
        """When the clock of the scene started, ns; None before."""
        return self._gripper.activated_ns

    def advance(self, t_ns: int) -> dict[str, bytes]:
        """Advance to ``t_ns``, ns since the start, in steps of about 1 ms; return what each line sends unasked."""
        if self.began_ns is not None:
            self.scene.step((t_ns - self.began_ns) * 1e-9, self._gripper.command(t_ns))
            self._gripper.observe(self.scene)
        said = dict.fromkeys(LINES, b"")
        pressed = t_ns >= self._next_image_ns
        self._next_image_ns = t_ns + IMAGE_NS if pressed else self._next_image_ns
        for side, shares in self._shares.items():
            wrench, pad = self.devices[f"{side}-wrench"], self.devices[f"{side}-pad"]
            felt = self._to_sensor @ self.scene.wrench(right=side == "right") + BIAS[side]
            wrench.feel(felt[:3], felt[3:])
            said[f"{side}-wrench"] = b"".join(wrench.advance(t_ns))
            if pressed:
                pad.press(self.scene.normal_n * shares)
                said[f"{side}-pad"] = b"".join(pad.advance(t_ns))
        return said

    def arm_reading(self, t_ns: int, epoch_ns: int = 0) -> bytes:
        """Return the arm's reading where one is due at ``t_ns``; ``epoch_ns`` is its start in CLOCK_MONOTONIC."""
        if self.arm is None or t_ns < self._next_arm_ns:
            return b""
        self._next_arm_ns = t_ns + ARM_NS
        fields = self.arm.reading(self.scene.t_s)
        fields["gravity_mps2"] = (self._rng.normal(0.0, ARM_STD_MPS2, 3) + fields["gravity_mps2"]).tolist()
        return encode_reading("arm", epoch_ns + t_ns, **fields)


TICK_NS = 1_250_000
"""Period of the force sensors with their shortest filter, ns."""


class _Line:
    """A device of a rig on its line: what it sends waits until the line is served."""

    def __init__(self, device: EmulatedDevice) -> None:
        self._device, self.began_ns = device, 0
        self.said: list[bytes] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._device, name)

    def advance(self, t_ns: int) -> list[bytes]:
        said, self.said = self.said, []
        return said


class VirtualGripper:
    """A virtual rig as the devices of an emulation, which calls `advance` before it serves them.

    Args:
        rig: The scene and its devices.
        folder: For the pseudo-terminals.
        report: Called with each event: a map with ``t_s`` (scene), ``t_ns`` (CLOCK_MONOTONIC) and ``event``.

    Attributes:
        devices: For `slipd.tools.sim.emulate.emulated`.
    """

    def __init__(self, rig: VirtualRig, folder: Path, report: Callable[[dict[str, Any]], None]) -> None:
        self._rig, self._report = rig, report
        self._lines = {name: _Line(device) for name, device in rig.devices.items()}
        self._lines[ARM] = _Line(EmulatedDevice(0.0))
        self.devices: list[tuple[str, Emulator, str]] = [
            (device, self._lines[name], str(folder / name)) for name, device in LINES.items()
        ]
        if rig.arm is not None:
            self.devices.append(("external", self._lines[ARM], f"ipc://{folder}/arm"))
        self._t_ns = self._told = 0

    def advance(self, t_ns: int) -> None:
        """Advance the rig to ``t_ns`` in its steps: a late wake-up catches up at once."""
        start_ns = self._lines["gripper"].began_ns
        while self._t_ns + TICK_NS <= t_ns:
            self._t_ns += TICK_NS
            said = self._rig.advance(self._t_ns) | {ARM: self._rig.arm_reading(self._t_ns, start_ns)}
            for name, data in said.items():
                self._lines[name].said += [data] if data else []
        begun_ns = start_ns + (self._rig.began_ns or 0)
        events = [] if self._rig.began_ns is None else [Truth(0.0, "begin", {}), *self._rig.scene.truth]
        for truth in events[self._told :]:
            t_ns = begun_ns + round(truth.t_s * 1e9)
            self._report({"t_s": round(truth.t_s, 4), "t_ns": t_ns, "event": truth.event, **truth.values})
        self._told = len(events)

    def hear(self, line: str) -> None:
        """Let the arm move at the scale in a line of standard input."""
        if self._rig.arm is not None:
            self._rig.arm.begin(self._rig.scene.t_s, float(line))


def carried_rig(seed: int = 0, electronics: PvdfElectronics | None = None, **scene: Any) -> VirtualRig:
    """Return a rig whose arm carries a glass; ``scene`` are arguments of `Scene` other than its script."""
    arm = Arm()
    glass = {"mass_kg": GLASS_KG, "inertia_kgm2": GLASS_KGM2} | scene
    return VirtualRig(Scene(CarryScript(arm=arm), **glass), seed, electronics, arm)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the virtual gripper until SIGTERM, SIGINT, or the end of standard input."""
    parser = argparse.ArgumentParser(prog="python -m slipd.tools.sim.virtual_gripper", description=main.__doc__)
    parser.add_argument(
        "--dir", type=Path, required=True, help="directory of the pseudo-terminals: " + ", ".join(LINES)
    )
    parser.add_argument("--seed", type=int, default=0, help="seed of the noise (default 0)")
    parser.add_argument("--carry", action="store_true", help="the arm carries a glass; each line of input is a move")
    options = parser.parse_args(argv)
    options.dir.mkdir(parents=True, exist_ok=True)
    rig = carried_rig(options.seed) if options.carry else VirtualRig(Scene(), options.seed)
    gripper = VirtualGripper(rig, options.dir, _print)

    def ready() -> None:
        _print(
            {
                "t_s": None,
                "t_ns": time.monotonic_ns(),
                "event": "ready",
                "ports": {line: str(options.dir / line) for line in LINES},
            }
        )

    prepare_process()
    try:
        served = asyncio.run(serve_until_ended(gripper.devices, gripper.advance, gripper.hear, ready))
        dropped = {name: line.dropped for name, (_, line) in zip(LINES, served, strict=False)}
        _print({"t_s": rig.scene.t_s, "t_ns": time.monotonic_ns(), "event": "end", "dropped_bytes": dropped})
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # the reader is gone: end without an error
    return 0


def _print(event: dict[str, Any]) -> None:
    print(json.dumps(event), flush=True)


if __name__ == "__main__":
    sys.exit(main())
