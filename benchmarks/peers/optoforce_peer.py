"""An independent driver of OptoForce sensors as the host of the emulated six-axis DAQ."""

from __future__ import annotations

from pathlib import Path

import optoforce
from optoforce.reading import FX_SCALE, FY_SCALE, FZ_SCALE
from peers.comparison import Comparison
from peers.emulation import FORCE_N, TORQUE_NM, device_at

from slipd.tools.sim.emulated_rdt import DAQ_COUNTS_PER_N, DAQ_COUNTS_PER_NM

NOISE_COUNTS = 12
"""Five times the noise of the emulated sensor and one count of rounding."""


def compare(folder: Path) -> Comparison:
    """Configure the emulated DAQ and read it."""
    found = Comparison("optoforce", "optoforce", "the driver configures and reads the emulated six-axis DAQ")
    port = folder / "optoforce"
    driver = optoforce.OptoForce22(port=str(port), speed_hz=333, filter_hz=150)
    with device_at("optoforce", str(port), wiring="serial"), driver:
        frames = [driver.read(only_latest_data=False) for _ in range(50)]
    newest = frames[-1]
    counts = [newest.Fx / FX_SCALE, newest.Fy / FY_SCALE, newest.Fz / FZ_SCALE]
    found.check_near("force, counts", counts, _counts(FORCE_N, DAQ_COUNTS_PER_N), NOISE_COUNTS)
    torque = [newest.Tx, newest.Ty, newest.Tz]
    found.check_near("torque, counts", torque, _counts(TORQUE_NM, DAQ_COUNTS_PER_NM), NOISE_COUNTS)
    found.check("checksums", all(frame.valid_checksum for frame in frames), True)
    found.check("status", newest.status, 0)
    found.open.append("sensitivity (the driver has the counts per newton of its author's sensor)")
    return found


def _counts(load: tuple[float, ...], per_unit: list[float]) -> list[float]:
    return [value * scale for value, scale in zip(load, per_unit, strict=True)]
