"""The virtual gripper: a scene with the five devices in it, and the process that serves them.

The process has five pseudo-terminals with the bytes of real devices, and prints the true state. One loop without
threads advances the scene 800 times per second and writes the bytes of the devices. A late wake-up catches up at once,
so that the rates never drift.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import select
import signal
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from slipd.devices.external import encode_reading
from slipd.tools.sim.carry import GLASS_KG, GLASS_KGM2, Arm, CarryScript
from slipd.tools.sim.device_line import PushLine
from slipd.tools.sim.emulated_bota import BotaMount, BotaSensor
from slipd.tools.sim.emulated_pvdf import PvdfElectronics, PvdfPad
from slipd.tools.sim.emulated_robotiq_2f import Gripper2F
from slipd.tools.sim.pseudo_terminal import PseudoTerminal
from slipd.tools.sim.scene import Scene, Truth
from slipd.tools.sim.scene_parts import Pad

LINES = ("left-wrench", "left-pad", "right-wrench", "right-pad", "gripper")
"""The devices, by the names of their lines."""

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

    def advance(self, t_ns: int) -> tuple[bytes, bytes]:
        wrench = self._scene.wrench(right=self._right)
        self.wrench.feel(wrench[:3], wrench[3:])
        if t_ns < self._next_image_ns:
            return self.wrench.advance(t_ns), b""
        self._next_image_ns = t_ns + IMAGE_NS
        return self.wrench.advance(t_ns), self.pad.advance(t_ns, self._scene.normal_n * self._shares)


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
        self._returned = 0

    @property
    def began_ns(self) -> int | None:
        """When the clock of the scene started, ns; None before."""
        return self._gripper.activated_ns

    def opened(self, line: str, t_ns: int) -> None:
        """Handle the opening of a line: a force sensor boots."""
        if line == "left-wrench":
            self._left.wrench.restart(t_ns)
        elif line == "right-wrench":
            self._right.wrench.restart(t_ns)

    def receive(self, line: str, data: bytes, t_ns: int) -> bytes:
        """Handle bytes written to a line; return the answer."""
        if line == "gripper":
            return self._gripper.receive(data, t_ns)
        if line == "left-wrench":
            return self._left.wrench.receive(data, t_ns)
        if line == "right-wrench":
            return self._right.wrench.receive(data, t_ns)
        return b""

    def advance(self, t_ns: int) -> dict[str, bytes]:
        """Advance to ``t_ns``, ns since the start, in steps of about 1 ms; return what each line sends unasked."""
        if self.began_ns is not None:
            self.scene.step((t_ns - self.began_ns) * 1e-9, self._gripper.command(t_ns))
            self._gripper.observe(self.scene)
        left_wrench, left_pad = self._left.advance(t_ns)
        right_wrench, right_pad = self._right.advance(t_ns)
        return dict(zip(LINES, (left_wrench, left_pad, right_wrench, right_pad, b""), strict=True))

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

LONGEST_LAG_NS = 500_000_000
"""After a longer pause, ns, what devices sent meanwhile is lost, as on a line that overflows. The scene went on."""

SUSPENDED_NS = 10_000_000_000
"""After a longer pause, ns, such as a suspended machine, the scene continues where it was."""

STDIN = 0

HARDWARE_NICENESS = -10
"""Niceness of this process if permitted, because hardware is not late on a busy machine."""


class VirtualGripper:
    """Run a virtual rig on its lines.

    Args:
        rig: The scene and its devices.
        ports: Pseudo-terminal of each line.
        report: Called with each event: a map with ``t_s`` (scene), ``t_ns`` (CLOCK_MONOTONIC) and ``event``.
        arm_line: Takes the readings of the arm; None: nobody does.
    """

    def __init__(
        self,
        rig: VirtualRig,
        ports: dict[str, PseudoTerminal],
        report: Callable[[dict[str, Any]], None],
        arm_line: PushLine | None = None,
    ) -> None:
        self._rig, self._ports, self._report, self._arm_line = rig, ports, report, arm_line
        self._commands = b""
        self._poll = select.poll()
        self._poll.register(STDIN, select.POLLIN)
        self._by_fd = {port.fd: (line, port) for line, port in ports.items()}
        for fd in self._by_fd:
            self._poll.register(fd, select.POLLIN)
        self._stopped = False
        self._begun = False

    def stop(self) -> None:
        """Stop at the next tick; safe in a signal handler."""
        self._stopped = True

    def run(self, seconds: float | None = None) -> None:
        """Run until stopped, until standard input closes, or for ``seconds``."""
        start_ns, ticks = time.monotonic_ns(), 0
        while not self._stopped and (seconds is None or ticks * TICK_NS < seconds * 1e9):
            next_ns = start_ns + (ticks + 1) * TICK_NS
            time.sleep(max(next_ns - time.monotonic_ns(), 0) * 1e-9)
            lag_ns = time.monotonic_ns() - next_ns
            if lag_ns > SUSPENDED_NS:
                start_ns, lag_ns = start_ns + lag_ns, 0
            lost = lag_ns > LONGEST_LAG_NS
            output = self._listen(ticks * TICK_NS)
            for _ in range(1 + lag_ns // TICK_NS):
                ticks += 1
                sent = self._rig.advance(ticks * TICK_NS)
                reading = self._rig.arm_reading(ticks * TICK_NS, start_ns)
                self._report_news(start_ns)
                if lost:
                    continue
                for line, data in sent.items():
                    output[line] += data
                if reading and self._arm_line is not None:
                    self._arm_line.send([reading])
            for line, data in output.items():
                self._ports[line].write(data)

    def _listen(self, t_ns: int) -> dict[str, bytes]:
        """Read every line; return the answers."""
        output = dict.fromkeys(LINES, b"")
        received = dict(self._poll.poll(0))
        if STDIN in received:
            self._carry_out(os.read(STDIN, 4096))
        for fd, (line, port) in self._by_fd.items():
            events = received.get(fd, 0)
            if port.update(events):
                self._rig.opened(line, t_ns)
            if events & select.POLLIN and (data := port.read()):
                output[line] = self._rig.receive(line, data, t_ns)
        return output

    def _carry_out(self, data: bytes) -> None:
        """Let the arm move at the scale in each line of standard input; its end stops the process."""
        self._stopped |= not data
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
    parser.add_argument("--seconds", type=float, help="end after this time, s (default: never)")
    parser.add_argument("--carry", action="store_true", help="the arm carries a glass; each line of input is a move")
    options = parser.parse_args(argv)
    options.dir.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:
        ports: dict[str, PseudoTerminal] = {}
        for line in LINES:
            ports[line] = PseudoTerminal(options.dir / line)
            stack.callback(ports[line].close)
        rig = carried_rig(options.seed) if options.carry else VirtualRig(Scene(), options.seed)
        arm_line = PushLine(f"ipc://{options.dir}/arm") if options.carry else None
        if arm_line is not None:
            stack.callback(arm_line.close)
        gripper = VirtualGripper(rig, ports, _print, arm_line)
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda *_: gripper.stop())
        with suppress(PermissionError):
            os.setpriority(os.PRIO_PROCESS, 0, HARDWARE_NICENESS)
        gc.collect()
        gc.freeze()
        paths = {line: str(port.path) for line, port in ports.items()}
        try:
            _print({"t_s": None, "t_ns": time.monotonic_ns(), "event": "ready", "ports": paths})
            gripper.run(options.seconds)
            dropped = {line: port.dropped for line, port in ports.items()}
            _print({"t_s": rig.scene.t_s, "t_ns": time.monotonic_ns(), "event": "end", "dropped_bytes": dropped})
        except BrokenPipeError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # the reader is gone: end without an error
    return 0


def _print(event: dict[str, Any]) -> None:
    print(json.dumps(event), flush=True)


if __name__ == "__main__":
    sys.exit(main())
