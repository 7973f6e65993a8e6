"""A rig as slow as many are: force at 100 Hz, pads of 4 x 4 taxels at 12.5 Hz, a gripper; its devices and their loads.

The devices are the emulators of `slipd.tools.sim`, so the bytes are real. The box has no dynamics: its load follows the
robot program, and while it exceeds what friction carries, the box slides.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from simulation.edits import wrench as edited

from slipd import config
from slipd.devices import pvdf
from slipd.tools.sim.emulated_bota import BotaLine
from slipd.tools.sim.emulated_robotiq_2f import GripperLine
from slipd.tools.sim.emulators import Emulator
from slipd.tools.sim.true_contact import Pad, Patch

MS = 1_000_000
SECOND = 1_000 * MS
STEP_NS = 20 * MS
"""Period of the ticks; the service ticks every 5 ms."""

READ_STEPS = 4
"""Steps from one read of the sensors to the next, and from scan to scan: a gateway hands over what it has."""

SCAN_DWELL_US = 20.0
NOISES = 257
"""Images of noise that are drawn once and used again."""

BEFORE_WRAP_US = 200_000_000
"""The clocks of the right sensor and of the pads begin so long before they wrap, as otherwise after 72 minutes."""

FINGERS = ("left", "right")
PART_M = 0.04
FOLLOWS = -math.expm1(-STEP_NS * 1e-9 / 0.06)
"""Share of a change of the force that a step follows, of a time constant of 60 ms."""

MU_S, MU_D = 0.62, 0.45
"""True friction; the config states 0.55."""

SLIDES_S = 0.3
CENTRE_M = (0.001, -0.0005)
MIRROR = np.array((1.0, -1.0, 1.0, -1.0, 1.0, -1.0))

_PATCH = Patch(half_length_m=0.010, half_width_m=0.008, centre_m=CENTRE_M)
_PAD = Pad(rows=4, cols=4, pitch_m=0.005, electrode_m=0.004)

_FINGER = """
[finger.{name}]
mu = 0.55
mu_max = 0.9
min_normal_n = 0.8
grip_safety = 1.5

[finger.{name}.wrench]
device = "bota"
port = "/dev/{name}-wrench"
rate_hz = 100.0
stale_s = 0.3
options = {{ sinc_length = 512 }}
force_std_n = 0.02
torque_std_nm = 0.0002
drift_tau_s = 60.0

[finger.{name}.pad]
device = "pvdf"
port = "/dev/{name}-pad"
rate_hz = 12.5
rows = 4
cols = 4
pitch_m = 0.005
electrode_m = 0.004
axis_scale = [0.0005]
threshold = 0.04
"""
_RATES = """
[rates]
slip_hz = 20.0
wrench_hz = 5.0
tactile_hz = 2.0
grasp_hz = 5.0
status_hz = 1.0
"""
_RECORDING = """
[recording]
directory = "{folder}"
min_free_bytes = 0
max_files = 50

[recording.continuous]
enabled = true
file_s = {file_s:.1f}
keep_files = 4

[recording.incidents]
enabled = true
before_s = 60.0
keep_files = 10
"""


def settings(folder: Path, file_s: float) -> config.Config:
    """Return the config of the rig: gripper, grasp and reflex are those of the demo; everything is recorded.

    Args:
        folder: For the recordings.
        file_s: Longest time in one file of the continuous recording.
    """
    demo = config.shipped("demo.toml").read_text(encoding="utf-8")
    hand = demo[demo.index("[gripper]") :].replace("lower_n_per_s = 2.0 ", "lower_n_per_s = 20.0 ")
    hand = hand.replace("enabled = false", "enabled = true")
    hand = hand.replace("rate_hz = 50.0", "rate_hz = 12.5\noptions = { poll_period_s = 0.08 }")
    fingers = "".join(_FINGER.format(name=name) for name in FINGERS)
    return config.parse(
        f"{fingers}\n{hand}\n{_RATES}{_RECORDING.format(folder=folder, file_s=file_s)}", "slow_rig.toml"
    )


_later_clock = edited(clock_us=lambda time_us: (time_us - BEFORE_WRAP_US) % (1 << 32))


class ScannedPad:
    """A pad of 4 x 4 taxels, one scan at each read: the load with noise drawn before, a fresh number and time.

    Args:
        seed: Of gains, offsets and noise.
    """

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.options = {"rows": 4, "cols": 4}
        self.rate_hz = 1e9 / (READ_STEPS * STEP_NS)
        self._gain = 2000.0 * (1.0 + 0.03 * rng.normal(size=16))
        self._rest = 20.0 * rng.normal(size=16) + 2.0 * rng.normal(size=(NOISES, 16))
        self._loads_n = np.zeros(16)
        self._scan = self._opened_ns = 0

    def press(self, loads_n: np.ndarray) -> None:
        """Set the load of each taxel, N."""
        self._loads_n = loads_n

    def opened(self, t_ns: int) -> None:
        """Start with the line."""
        self._scan, self._opened_ns = 0, t_ns

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Ignore all bytes."""
        return []

    def advance(self, t_ns: int) -> list[bytes]:
        """Return the scan of this read; it began 1 ms before."""
        counts = np.rint(self._gain * self._loads_n + self._rest[self._scan % NOISES]).astype(np.int64)
        device_us = (t_ns - self._opened_ns) // 1000 - 1000 - BEFORE_WRAP_US
        self._scan += 1
        return [pvdf.encode_scan(counts.reshape(4, 4), self._scan - 2000, device_us % (1 << 32), SCAN_DWELL_US)]


class SlowRig:
    """The devices, and the load on them.

    Args:
        seed: Of the noise.

    Attributes:
        devices: The emulators by link.
        weight_n: Tangential load on each pad, N, as ordered.
        sliding: The box slides.
        slips: Number of times that it began to.
        drops_next: The next slide ends with the fall of the box.
    """

    def __init__(self, seed: int) -> None:
        self._wrenches = {name: BotaLine(seed + n) for n, name in enumerate(FINGERS)}
        self._pads = {name: ScannedPad(seed + 2 + n) for n, name in enumerate(FINGERS)}
        self._gripper = GripperLine()
        self.devices: dict[str, Emulator] = {"gripper": self._gripper}
        for name in FINGERS:
            self.devices |= {f"{name}.wrench": self._wrenches[name], f"{name}.pad": self._pads[name]}
        self._shares = {"left": _PAD.shares(_PATCH), "right": _PAD.shares(_PATCH.mirrored())}
        self.weight_n = self.sway_n = self.spin_nm = 0.0
        self.sliding = self.drops_next = False
        self.slips = 0
        self._normal_n = 0.0
        self._from_n, self._to_n, self._ramp_began_s, self._ramp_s = 0.0, 0.0, 0.0, 1.0
        self._slid_s = 0.0
        self._pressed = True
        self._step = 0

    def put_part(self, *, there: bool) -> None:
        """Put the box between the jaws, or take it away."""
        self._gripper.set_part(PART_M if there else 0.0)

    def load(self, weight_n: float, within_s: float, t_ns: int) -> None:
        """Let the tangential load on each pad grow or fall to ``weight_n``."""
        self._from_n, self._to_n, self._ramp_s = self.weight_n, weight_n, within_s
        self._ramp_began_s = t_ns * 1e-9

    def advance(self, t_ns: int) -> dict[str, list[bytes]]:
        """Advance by one step to ``t_ns`` since the start; return what each device sends."""
        self._normal_n += (self._gripper.grip_n - self._normal_n) * FOLLOWS
        pressed = self._normal_n > 1e-3
        if pressed or self._pressed:
            self._feel(t_ns * 1e-9, pressed=pressed)
        said = {"gripper": self._gripper.advance(t_ns)}
        self._step += 1
        if self._step % READ_STEPS:
            return said
        for name in FINGERS:
            said[f"{name}.wrench"] = self._wrenches[name].advance(t_ns)
            self._pads[name].press(self._normal_n * self._shares[name])
            said[f"{name}.pad"] = self._pads[name].advance(t_ns)
        said["right.wrench"] = [_later_clock(data, t_ns) for data in said["right.wrench"]]
        return said

    def _feel(self, t_s: float, *, pressed: bool) -> None:
        self._pressed = pressed
        share = min((t_s - self._ramp_began_s) / self._ramp_s, 1.0)
        self.weight_n = self._from_n + share * (self._to_n - self._from_n)
        tangential_n = self.weight_n + (self.sway_n * math.sin(7.0 * t_s) if self.weight_n else 0.0)
        tangential_n = self._held_by_friction(tangential_n, t_s)
        (x_m, y_m), normal_n = CENTRE_M, self._normal_n if pressed else 0.0
        spin_nm = self.spin_nm * min(normal_n, 1.0) - y_m * tangential_n
        wrench = np.array((tangential_n, 0.0, -normal_n, -y_m * normal_n, x_m * normal_n, spin_nm))
        self._wrenches["left"].feel(wrench[:3], wrench[3:])
        wrench *= MIRROR
        self._wrenches["right"].feel(wrench[:3], wrench[3:])

    def _held_by_friction(self, tangential_n: float, t_s: float) -> float:
        if not self.sliding and abs(tangential_n) > MU_S * self._normal_n > 0.5:
            self.sliding, self._slid_s = True, t_s
            self.slips += 1
        if not self.sliding:
            return min(max(tangential_n, -MU_S * self._normal_n), MU_S * self._normal_n)
        if t_s - self._slid_s >= SLIDES_S:
            self.sliding = False
            self._from_n = self._to_n = 0.0 if self.drops_next else MU_D * self._normal_n / 2
            if self.drops_next:
                self.put_part(there=False)
        return math.copysign(min(abs(tangential_n), MU_D * self._normal_n), tangential_n)
