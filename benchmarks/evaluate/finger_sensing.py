"""The sensors of a finger in a simulated grasp: what they feel of it, and how they are wrong."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from slipd.tools.sim.emulated_pvdf import PvdfElectronics
from slipd.tools.sim.scene_parts import Pad
from slipd.types.arrays import Array

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class ForceSensing:
    """Strain gauges behind a pad.

    Attributes:
        rate_hz: Readings per second.
        noise_n: Standard deviation of each force component.
        noise_nm: Standard deviation of each torque component.
        xyz_m: Where the config says that the sensor is, in the pad frame, with the axes of the pad.
        off_m: How far it really is from there.
        turn_rad: Rotation vector by which it is really turned.
        gain: Reading over load.
        bias: Reading without load, force (3) in N and torque (3) in N·m.
        drift_per_s: Growth of the bias per second.
    """

    rate_hz: float = 1000.0
    noise_n: float = 0.02
    noise_nm: float = 0.0002
    xyz_m: Triple = (0.0, 0.0, -0.012)
    off_m: Triple = (0.0, 0.0, 0.0)
    turn_rad: Triple = (0.0, 0.0, 0.0)
    gain: float = 1.0
    bias: tuple[float, ...] = (0.0,) * 6
    drift_per_s: tuple[float, ...] = (0.0,) * 6

    def felt(self, t_s: Array, wrenches: Array) -> Array:
        """Return what the sensor feels, in its own frame and without noise.

        Args:
            t_s: Times, shape (n,), s; the bias grows from time 0.
            wrenches: Force and torque on the finger in its pad frame about the centre of the pad, shape (n, 6).
        """
        turn = Rotation.from_rotvec(self.turn_rad).as_matrix()
        force, torque = wrenches[:, :3], wrenches[:, 3:]
        torque = torque - np.cross(np.array(self.xyz_m) + self.off_m, force)
        own = self.gain * np.hstack((force @ turn, torque @ turn))
        return np.asarray(own + np.array(self.bias) + t_s[:, None] * np.array(self.drift_per_s), dtype=np.float64)


@dataclass(frozen=True)
class PadSensing:
    """A multiplexed PVDF pad; its taxels are counted as those of `slipd.tools.sim.scene_parts.Pad`.

    Attributes:
        rows: Rows, along y.
        cols: Columns, along x.
        pitch_m: Distance between neighbouring taxels.
        electrode_m: Diameter of an electrode.
        electronics: Amplifier, converter and multiplexer, with their faults.
        off_m: How far the pad really is from where the config says, along x and y.
        turn_rad: Angle by which it is really turned about its normal.
        mirrored: Whether it is mounted with its x axis reversed.
    """

    rows: int = 8
    cols: int = 16
    pitch_m: float = 0.0032
    electrode_m: float = 0.0015
    electronics: PvdfElectronics = field(default_factory=PvdfElectronics)
    off_m: tuple[float, float] = (0.0, 0.0)
    turn_rad: float = 0.0
    mirrored: bool = False

    def positions(self) -> tuple[Array, Array]:
        """Return where the taxels really are in the pad frame, x and y in scan order, shapes (taxels,), m."""
        x, y = Pad(self.rows, self.cols, self.pitch_m, self.electrode_m).positions()
        if self.mirrored:
            x = -x
        cos, sin = np.cos(self.turn_rad), np.sin(self.turn_rad)
        return cos * x - sin * y + self.off_m[0], sin * x + cos * y + self.off_m[1]


@dataclass(frozen=True)
class FingerSensing:
    """The sensors of one finger; it may have no pad."""

    force: ForceSensing = ForceSensing()
    pad: PadSensing | None = PadSensing()


GAUGES_N_PER_COUNT, GAUGES_NM_PER_COUNT = 1e-5, 2e-7
"""Resolution of the strain gauges: 84 N and 1.7 N·m are their full scale of 24 bits."""

GAUGES_MATRIX = np.diag(np.repeat((GAUGES_N_PER_COUNT, GAUGES_NM_PER_COUNT), 3)).tolist()


def offline_config(
    fingers: dict[str, FingerSensing], mu: float | None, *, finger_lines: str = "", extra: str = ""
) -> str:
    """Return the config of a rig with these sensors, as the person who mounted them sees it: without their faults.

    Args:
        fingers: Sensors by finger.
        mu: Friction coefficient; None: not given.
        finger_lines: More lines of every ``[finger.X]``.
        extra: More tables.
    """
    lines = []
    for name, finger in fingers.items():
        lines += [f"[finger.{name}]", *([] if mu is None else [f"mu = {mu}"]), finger_lines]
        force = finger.force
        lines += [
            f"[finger.{name}.wrench]",
            'device = "gauges"',
            f'port = "offline/{name}-wrench"',
            f"rate_hz = {float(force.rate_hz)}",
            f"pad_from_sensor = {{ xyz_m = {list(force.xyz_m)} }}",
            f"force_std_n = {force.noise_n}",
            f"torque_std_nm = {force.noise_nm}",
            f"[finger.{name}.wrench.options]",
            f"matrix = {GAUGES_MATRIX}",
        ]
        if finger.pad is not None:
            pad, behind = finger.pad, finger.pad.electronics
            counts = behind.gain_counts_per_n
            lines += [
                f"[finger.{name}.pad]",
                'device = "pvdf"',
                f'port = "offline/{name}-pad"',
                f"rate_hz = {float(behind.rate_hz)}",
                f"rows = {pad.rows}",
                f"cols = {pad.cols}",
                f"pitch_m = {pad.pitch_m}",
                f"electrode_m = {pad.electrode_m}",
                f"axis_scale = [{1.0 / counts}]",
                f"threshold = {5.0 * behind.noise_counts / counts}",
                f"charge_tau_s = {behind.tau_s}",
            ]
    return "\n".join([*lines, extra, ""])
