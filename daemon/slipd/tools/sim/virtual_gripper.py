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
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from slipd.devices.external import encode_reading
from slipd.tools.sim.carry import GLASS_KG, GLASS_KGM2, Arm, CarryScript
from slipd.tools.sim.emulate import prepare_process, serve_until_ended
from slipd.tools.sim.emulated_bota import BotaMount, BotaSensor
from slipd.tools.sim.emulated_pvdf import PvdfElectronics, PvdfPad
from slipd.tools.sim.emulated_robotiq_2f import Gripper2F
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

LEFT_MOUNT = BotaMount()
RIGHT_MOUNT = replace(LEFT_MOUNT, bias=(-0.8, 1.3, -3.1, -0.012, 0.024, -0.018), clock_ppm=-15.0)

IMAGE_NS = 2_500_000
"""How often the pads feel the load, ns: the grip force hardly changes within."""

ARM_NS, ARM_STD_MPS2 = 4_000_000, 0.03
"""Period of the arm's readings, and their noise."""


class _Finger:
    """The sensors of one finger, and its view of the scene."""

    def __init__(
        self, scene: Scene, mount: BotaMount, electronics: PvdfElectronics, rng: np.random.Generator, *, right: bool
    ) -> None:
        self._scene, self._right = scene, right
        patch, pad = (scene.patch.mirrored() if right else scene.patch), Pad()
        self.wrench = BotaSensor(mount, rng)
        self._shares = pad.shares(patch)
        self._next_image_ns = 0
        self.pad = PvdfPad(pad.rows, pad.cols, electronics, rng)

    def advance(self, t_ns: int) -> tuple[list[bytes], list[bytes]]:
        wrench = self._scene.wrench(right=self._right)
        self.wrench.feel(wrench[:3], wrench[3:])
        if t_ns < self._next_image_ns:
            return self.wrench.advance(t_ns), []
        self._next_image_ns = t_ns + IMAGE_NS
        self.pad.press(self._scene.normal_n * self._shares)
        return self.wrench.advance(t_ns), self.pad.advance(t_ns)


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
    """

    def __init__(
        self, scene: Scene, seed: int = 0, electronics: PvdfElectronics | None = None, arm: Arm | None = None
    ) -> None:
        self.scene, self.arm = scene, arm
        electronics = electronics or PvdfElectronics()
        left, right, self._rng = np.random.default_rng(seed).spawn(3)
        self._next_arm_ns = 0
        self._left = _Finger(scene, LEFT_MOUNT, electronics, left, right=False)
        self._right = _Finger(scene, RIGHT_MOUNT, electronics, right, right=True)
        self._gripper = Gripper2F(((0.0, scene.open_width_m), (1.0, 0.0)))  # as in the config of the demo
        devices = (self._left.wrench, self._left.pad, self._right.wrench, self._right.pad, self._gripper)
        self._devices: dict[str, EmulatedDevice] = {**dict(zip(LINES, devices, strict=True)), ARM: EmulatedDevice(0.0)}
        self._returned = 0

    @property
    def began_ns(self) -> int | None:
        """When the clock of the scene started, ns; None before."""
        return self._gripper.activated_ns

    def opened(self, line: str, t_ns: int) -> None:
        """Handle the opening of a line: a force sensor boots."""
        self._devices[line].opened(t_ns)

    def receive(self, line: str, data: bytes, t_ns: int) -> bytes:
        """Handle bytes written to a line; return the answer."""
        return b"".join(self._devices[line].receive(data, t_ns))

    def advance(self, t_ns: int) -> dict[str, bytes]:
        """Advance to ``t_ns``, ns since the start, in steps of about 1 ms; return what each line sends unasked."""
        if self.began_ns is not None:
            self.scene.step((t_ns - self.began_ns) * 1e-9, self._gripper.command(t_ns))
            self._gripper.observe(self.scene)
        said: list[list[bytes]] = [*self._left.advance(t_ns), *self._right.advance(t_ns), []]
        return {line: b"".join(pieces) for line, pieces in zip(LINES, said, strict=True)}

    def arm_reading(self, t_ns: int, epoch_ns: int = 0) -> bytes:
        """Return the arm's reading where one is due at ``t_ns``; ``epoch_ns`` is its start in CLOCK_MONOTONIC."""
        if self.arm is None or t_ns < self._next_arm_ns:
            return b""
        self._next_arm_ns = t_ns + ARM_NS
        fields = self.arm.reading(self.scene.t_s)
        fields["gravity_mps2"] = (self._rng.normal(0.0, ARM_STD_MPS2, 3) + fields["gravity_mps2"]).tolist()
        return encode_reading("arm", epoch_ns + t_ns, **fields)

    def news(self) -> list[Truth]:
        """Return every event of the scene since the last call."""
        news = self.scene.truth[self._returned :]
        self._returned = len(self.scene.truth)
        return news


TICK_NS = 1_250_000
"""Period of the force sensors with their shortest filter, ns."""


class _RigLine(EmulatedDevice):
    """What a rig says on one of its lines, as an emulator."""

    def __init__(self, rig: VirtualRig, name: str) -> None:
        super().__init__(0.0)
        self._rig, self._name = rig, name
        self.said: list[bytes] = []
        self.began_ns = 0

    def opened(self, t_ns: int) -> None:
        self._rig.opened(self._name, t_ns)

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        return [self._rig.receive(self._name, data, t_ns)]

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
        self._lines = {name: _RigLine(rig, name) for name in (*LINES, ARM)}
        self.devices: list[tuple[str, Emulator, str]] = [
            (device, self._lines[name], str(folder / name)) for name, device in LINES.items()
        ]
        if rig.arm is not None:
            self.devices.append(("external", self._lines[ARM], f"ipc://{folder}/arm"))
        self._commands = b""
        self._t_ns = 0
        self._begun = False

    def advance(self, t_ns: int) -> None:
        """Advance the rig to ``t_ns`` in its steps: a late wake-up catches up at once."""
        start_ns = self._lines["gripper"].began_ns
        while self._t_ns + TICK_NS <= t_ns:
            self._t_ns += TICK_NS
            said = self._rig.advance(self._t_ns) | {ARM: self._rig.arm_reading(self._t_ns, start_ns)}
            for name, data in said.items():
                self._lines[name].said += [data] if data else []
            self._report_news(start_ns)

    def hear(self, data: bytes) -> None:
        """Let the arm move at the scale in each line of standard input."""
        *lines, self._commands = (self._commands + data).split(b"\n")
        for line in lines:
            if self._rig.arm is not None:
                self._rig.arm.begin(self._rig.scene.t_s, float(line))

    def _report_news(self, start_ns: int) -> None:
        began_ns = self._rig.began_ns
        if began_ns is None:
            return
        if not self._begun:
            self._begun = True
            self._report({"t_s": 0.0, "t_ns": start_ns + began_ns, "event": "begin"})
        for truth in self._rig.news():
            t_ns = start_ns + began_ns + round(truth.t_s * 1e9)
            self._report({"t_s": round(truth.t_s, 4), "t_ns": t_ns, "event": truth.event, **truth.values})


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
    paths = {line: str(options.dir / line) for line in LINES}

    def ready() -> None:
        _print({"t_s": None, "t_ns": time.monotonic_ns(), "event": "ready", "ports": paths})

    prepare_process()
    try:
        ended = asyncio.run(serve_until_ended(gripper.devices, gripper.advance, gripper.hear, ready))
        dropped = dict(zip(LINES, ended.dropped, strict=False))
        _print({"t_s": rig.scene.t_s, "t_ns": time.monotonic_ns(), "event": "end", "dropped_bytes": dropped})
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # the reader is gone: end without an error
    return 0


def _print(event: dict[str, Any]) -> None:
    print(json.dumps(event), flush=True)


if __name__ == "__main__":
    sys.exit(main())
