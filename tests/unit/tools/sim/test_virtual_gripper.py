"""The real process on real pseudo-terminals, read by the real decoders and an independent Modbus client."""

import json
import select
import signal
import subprocess
import sys
import time
import warnings
from itertools import pairwise

import pytest
import serial

from slipd.devices import bota, pvdf
from slipd.tools.sim.virtual_gripper import LINES

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    from pymodbus.client import ModbusSerialClient

pytestmark = pytest.mark.process
UNIT = 9
PATIENCE_S = 60.0


class Process:
    def __init__(self, directory):
        command = [sys.executable, "-m", "slipd.tools.sim.virtual_gripper", "--dir", str(directory)]
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


def unbroken(times_ns, most_ns):
    """Return the longest run of times of which none is more than ``most_ns`` after the one before."""
    runs = [[times_ns[0]]]
    for before_ns, time_ns in pairwise(times_ns):
        if time_ns - before_ns > most_ns:
            runs.append([])
        runs[-1].append(time_ns)
    return max(runs, key=len)


def test_it_prints_its_ports_sends_whole_frames_at_their_rates_and_removes_the_ports(process):
    assert sorted(process.ports) == sorted(path.name for path in process.directory.iterdir()) == sorted(LINES)
    rates_hz = {f"{side}-{kind}": hz for side in ("left", "right") for kind, hz in (("wrench", 800), ("pad", 200))}
    ports = {line: serial.Serial(str(process.directory / line), timeout=0, exclusive=True) for line in rates_hz}
    decoders = {line: bota.Decoder() if "wrench" in line else pvdf.Decoder() for line in rates_hz}
    times_ns = {line: [] for line in rates_hz}
    end_s = time.monotonic() + PATIENCE_S
    while not all(times and len(unbroken(times, 1.5e9 / rates_hz[line])) > 40 for line, times in times_ns.items()):
        assert time.monotonic() < end_s
        select.select(list(ports.values()), [], [], 0.05)
        for line, port in ports.items():
            samples = decoders[line].receive(port.read(65_536), 0)
            times_ns[line] += [sample.device_time_ns for sample in samples]
    for line, port in ports.items():
        port.close()
        assert decoders[line].health.bad == 0
        # By the device's own clock, and without the frames that it left out while nobody read.
        run_ns = unbroken(times_ns[line], 1.5e9 / rates_hz[line])
        assert (len(run_ns) - 1) / (run_ns[-1] - run_ns[0]) * 1e9 == pytest.approx(rates_hz[line], rel=0.002)
    process.popen.send_signal(signal.SIGTERM)
    process.check_it_ends()


def test_an_independent_modbus_client_grips_the_box(process):
    client = ModbusSerialClient(str(process.directory / "gripper"), baudrate=115_200, timeout=5.0)
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
    both = client.readwrite_registers(
        read_address=2000, read_count=3, write_address=1000, values=[0x0900, 0, 0xFF00], device_id=UNIT
    )
    assert len(both.registers) == 3
    assert process.hear_until("contact_ends")
    assert client.read_input_registers(3000, count=1, device_id=UNIT).exception_code == 2
    client.close()
    process.popen.stdin.close()
    process.check_it_ends()
