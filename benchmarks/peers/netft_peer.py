"""Two independent clients of an ATI Net F/T as hosts of the emulated sensor."""

from __future__ import annotations

import itertools
from pathlib import Path

import NetFT
import pynetft
from peers.comparison import Comparison
from peers.emulation import FORCE_N, TORQUE_NM, device_at

COUNTS_PER_N, COUNTS_PER_NM = 100_000, 2_000_000
NOISE_N, NOISE_NM = 0.1, 0.0025
"""Five times the noise of the emulated sensor."""
SAMPLES = 200


def compare_counts(folder: Path) -> Comparison:
    """Read counts by NetFT, which has one fixed UDP port: an address of its own on the loopback network."""
    found = Comparison("netft", "NetFT", "the client reads the emulated sensor")
    with device_at("netft", "udp://127.0.0.7:49152"):
        sensor = NetFT.Sensor("127.0.0.7")
        sensor.sock.settimeout(1.0)
        sensor.getMeasurements(3)
        readings = [sensor.receive() for _ in range(3)]
        found.check("a request for 3 samples sends 3", _is_silent(sensor), True)
    newest = readings[-1]
    found.check_near("force, counts", newest[:3], [COUNTS_PER_N * force for force in FORCE_N], COUNTS_PER_N * NOISE_N)
    wanted = [COUNTS_PER_NM * torque for torque in TORQUE_NM]
    found.check_near("torque, counts", newest[3:], wanted, COUNTS_PER_NM * NOISE_NM)
    return found


def _is_silent(sensor: NetFT.Sensor) -> bool:
    try:
        sensor.receive()
    except TimeoutError:
        return True
    return False


def compare_units(folder: Path) -> Comparison:
    """Read units, sequences and health by pynetft."""
    found = Comparison("netft", "pynetft", "the client reads the emulated sensor")
    calibration = pynetft.Calibration(
        COUNTS_PER_N, COUNTS_PER_NM, pynetft.ForceUnit.NEWTON, pynetft.TorqueUnit.NEWTON_METER
    )
    config = pynetft.Config(sensor_host="127.0.0.8", calibration_override=calibration)
    with device_at("netft", "udp://127.0.0.8:49152"), pynetft.Client(config, queue_size=SAMPLES) as client:
        samples = list(itertools.islice(client.samples(timeout=5.0), SAMPLES))
        health = client.health()
    newest = samples[-1]
    found.check_near("force, N", newest.force, FORCE_N, NOISE_N)
    found.check_near("torque, N·m", newest.torque, TORQUE_NM, NOISE_NM)
    found.check("status", newest.status, 0)
    found.check("malformed records", health.malformed_count, 0)
    found.check("device clock stalled or backward", health.ft_stall_count + health.ft_backward_count, 0)
    found.open.append("calibration over HTTP (needs port 80)")
    return found
