"""The real process on real pseudo-terminals, with an independent Modbus client.

The scene is that of a glass which stays on the table until the arm is told to move, however long that takes.
"""

import json
import select
import subprocess
import sys
import time
import warnings

import pytest

from slipd.tools.sim.virtual_gripper import LINES

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    from pymodbus.client import ModbusSerialClient

pytestmark = pytest.mark.process
UNIT = 9
PATIENCE_S = 60.0


class Process:
    def __init__(self, directory):
        command = [sys.executable, "-m", "slipd.tools.sim.virtual_gripper", "--carry", "--dir", str(directory)]
        self.popen = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.directory = directory

    def hear_until(self, event):
        while True:
            readable, _, _ = select.select([self.popen.stdout], [], [], PATIENCE_S)
            assert readable, "the virtual gripper prints nothing"
            heard = json.loads(self.popen.stdout.readline())
            if heard["event"] == event:
                return heard

    def check_it_ends(self):
        self.hear_until("end")
        assert self.popen.wait(PATIENCE_S) == 0
        assert list(self.directory.iterdir()) == []


@pytest.fixture
def process(tmp_path):
    made = Process(tmp_path / "ports")
    with made.popen:
        made.ports = made.hear_until("ready")["ports"]
        yield made
        made.popen.kill()  # only a process that failed to end still runs here


def test_an_independent_modbus_client_grips_the_box(process):
    assert sorted(process.ports) == sorted(path.name for path in process.directory.iterdir()) == sorted(LINES)
    client = ModbusSerialClient(str(process.directory / "gripper"), baudrate=115_200, timeout=PATIENCE_S)
    assert client.connect()

    def status(function):
        reply = function(2000, count=3, device_id=UNIT)
        assert not reply.isError()
        flags = reply.registers[0] >> 8
        return flags >> 4 & 3, flags >> 6, reply.registers[1] & 0xFF, reply.registers[2] >> 8

    assert status(client.read_input_registers) == (0, 3, 0, 0)
    assert not client.write_registers(1000, [0x0100, 0, 0], device_id=UNIT).isError()
    begun = process.hear_until("begin")
    while status(client.read_holding_registers)[0] != 3:
        time.sleep(0.05)
    assert not client.write_registers(1000, [0x0900, 255, 0xFF3C], device_id=UNIT).isError()
    contact = process.hear_until("contact")
    assert contact["t_ns"] - begun["t_ns"] == pytest.approx(contact["t_s"] * 1e9, abs=1e5)
    assert status(client.read_input_registers) == (3, 2, 255, 75)
    assert not client.write_registers(1000, [0x0900, 0, 0xFF00], device_id=UNIT).isError()
    assert process.hear_until("contact_ends")
    assert client.read_input_registers(3000, count=1, device_id=UNIT).exception_code == 2
    client.close()
    process.popen.stdin.close()
    process.check_it_ends()
