"""The maker's driver of Bota Systems as the host of the emulated sensor."""

from __future__ import annotations

from pathlib import Path

import bota_driver
from peers.comparison import Comparison
from peers.emulation import FORCE_N, TORQUE_NM, device_at

SINC_LENGTH = 512
FRAMES = 50
NOISE_N, NOISE_NM = 0.1, 0.001
"""Five times the noise of the emulated sensor."""


def compare(folder: Path) -> Comparison:
    """Configure the emulated sensor by the maker's driver and read it."""
    found = Comparison("bota", "bota-driver", "the maker's driver configures and reads the emulated sensor")
    port = folder / "bota"
    with device_at("bota", str(port)):
        driver = bota_driver.BotaDriver(_config(str(port)))
        found.check("configured (identity, filter, data format)", driver.configure(), True)
        found.check("activated", driver.activate(), True)
        frames = [driver.read_frame_blocking() for _ in range(FRAMES)]
        found.check("frame period, µs", driver.get_expected_timestep_us(), SINC_LENGTH * 1_000_000 // 51_200)
        driver.deactivate()
        driver.shutdown()
    last = frames[-1]
    found.check_near("force, N", list(last.force), FORCE_N, NOISE_N)
    found.check_near("torque, N·m", list(last.torque), TORQUE_NM, NOISE_NM)
    found.open.append("calibration matrix, stored settings")
    return found


def _config(port: str) -> bota_driver.BotaDriverConfig:
    config = bota_driver.BotaDriverConfig()
    config.product_name, config.serial_number = "MiniONE", "1"
    config.communication_interface_name = "Bota_Binary_gen0"
    config.binary_communication_interface_params = bota_driver.BotaBinaryCommunicationInterfaceConfig()
    config.binary_communication_interface_params.com_port = port
    config.gen0_sensor_operation_params = bota_driver.Gen0SensorOperationConfig()
    config.gen0_sensor_operation_params.sinc_length = SINC_LENGTH
    return config
