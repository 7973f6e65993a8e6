"""The virtual gripper without its lines: a scene and the five devices in it. The caller passes the time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from slipd.tools.sim.emulated_bota import BotaMount, BotaSensor
from slipd.tools.sim.emulated_pvdf import PvdfElectronics, PvdfPad
from slipd.tools.sim.emulated_robotiq_2f import Gripper2F
from slipd.tools.sim.scene import Scene, Truth
from slipd.tools.sim.true_contact import Pad

LINES = ("left-wrench", "left-pad", "right-wrench", "right-pad", "gripper")
"""The devices, by the names of their lines."""

LEFT_MOUNT = BotaMount()
RIGHT_MOUNT = replace(LEFT_MOUNT, bias=(-0.8, 1.3, -3.1, -0.012, 0.024, -0.018), clock_ppm=-15.0)

IMAGE_NS = 2_500_000
"""How often the pads feel the load, ns: the grip force hardly changes within."""


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

    Attributes:
        scene: The scene in its present state.
    """

    def __init__(self, scene: Scene, seed: int = 0, electronics: PvdfElectronics | None = None) -> None:
        self.scene = scene
        electronics = electronics or PvdfElectronics()
        left, right = np.random.default_rng(seed).spawn(2)
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

    def news(self) -> list[Truth]:
        """Return every event of the scene since the last call."""
        news = self.scene.truth[self._returned :]
        self._returned = len(self.scene.truth)
        return news
