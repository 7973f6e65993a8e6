"""Two independent Modbus masters as hosts of the emulated Robotiq gripper."""

from __future__ import annotations

from pathlib import Path

import pyrobotiqgripper
from peers.comparison import Comparison
from peers.emulation import device_at
from pymodbus.client import ModbusSerialClient

DEVICE_ID = 9
PART_M = 0.03
STATUS_REGISTER, STATUS_REGISTERS = 0x07D0, (3, 6)
"""First status register; drivers read three registers or six."""


def compare_driver(folder: Path) -> Comparison:
    """Activate, open and close on a part by a driver that owners of the gripper wrote."""
    found = Comparison("robotiq_2f", "pyRobotiqGripper", "the driver activates and moves the emulated gripper")
    port = str(folder / "robotiq")
    with device_at("robotiq_2f", port, PART_M):
        driver = pyrobotiqgripper.RobotiqGripper(com_port=port, device_id=DEVICE_ID)
        driver.connect()
        driver.activate()
        found.check("activated", driver.isActivated(), True)
        driver.move(60)
        found.check("position 60 reached", driver.position(), 60)
        driver.close()
        status = driver.status()
        found.check("object found while closing (gOBJ)", int(status["gOBJ"]), 2)
        found.check("requested position echoed (gPR)", int(status["gPR"]), 255)
        found.check("fault (gFLT)", int(status["gFLT"]), 0)
        driver.disconnect()
    found.open.append("width and force in units: the driver has no table of them")
    return found


def compare_registers(folder: Path) -> Comparison:
    """Read the status by a plain Modbus master, as many registers as the drivers in use."""
    found = Comparison("robotiq_2f", "pymodbus", "a plain Modbus RTU master reads the emulated gripper")
    port = str(folder / "modbus")
    with device_at("robotiq_2f", port):
        client = ModbusSerialClient(port, baudrate=115_200, timeout=1.0)
        client.connect()
        for count in STATUS_REGISTERS:
            answer = client.read_holding_registers(STATUS_REGISTER, count=count, device_id=DEVICE_ID)
            found.check(f"{count} status registers", not answer.isError() and len(answer.registers), count)
        client.close()
    return found
