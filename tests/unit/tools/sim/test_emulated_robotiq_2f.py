from types import SimpleNamespace

import pytest
from driving import drive

from slipd.devices.robotiq_2f import Session, robotiq_registers
from slipd.devices.robotiq_2f.robotiq_units import WIDTH_TABLE, Units
from slipd.devices.shared import modbus
from slipd.tools.sim.emulated_robotiq_2f import ACTIVATION_NS, FORCE_TABLE, Gripper2F, make
from slipd.tools.sim.scene import GripCommand

MS = 1_000_000
UNIT, OUT, IN = robotiq_registers.UNIT, robotiq_registers.OUTPUT_ADDRESS, robotiq_registers.INPUT_ADDRESS


def write(gripper, registers, t_ns, at=OUT):
    request = modbus.Request(UNIT, modbus.WRITE, write_address=at, registers=registers)
    return modbus.find_reply(b"".join(gripper.receive(modbus.encode_request(request), t_ns)), request)


def status(gripper, t_ns, function=modbus.READ_INPUT):
    request = modbus.Request(UNIT, function, IN, 3)
    reply = modbus.find_reply(b"".join(gripper.receive(modbus.encode_request(request), t_ns)), request)
    return robotiq_registers.parse_status(reply.registers, t_ns, None, Units(FORCE_TABLE, WIDTH_TABLE, None).width_m)


def active():
    gripper = Gripper2F()
    write(gripper, (0x0100, 0, 0), 0)
    return gripper


def observed(gripper, **scene):
    gripper.observe(SimpleNamespace(**{"moving": False, "in_contact": False, "normal_n": 0.0, **scene}))
    return gripper


def test_activation_takes_its_time_and_begins_with_a_rising_edge():
    gripper = Gripper2F()
    assert not status(gripper, 0).active
    write(gripper, (0x0100, 0, 0), 10 * MS)
    assert gripper.activated_ns == 10 * MS
    assert not status(gripper, ACTIVATION_NS).active
    assert status(gripper, ACTIVATION_NS).moving
    assert status(gripper, 10 * MS + ACTIVATION_NS).active
    write(gripper, (0x0900, 0, 0), 2 * ACTIVATION_NS)
    assert status(gripper, 2 * ACTIVATION_NS).active
    assert gripper.activated_ns == 10 * MS


@pytest.mark.parametrize(("byte", "force_n"), [*FORCE_TABLE, (30, 5.25), (128, 13.8666667)])
def test_a_force_byte_means_the_newtons_of_the_table(byte, force_n):
    gripper = active()
    write(gripper, (0x0900, 255, byte), ACTIVATION_NS)
    assert gripper.command(ACTIVATION_NS).force_n == pytest.approx(force_n)


def test_position_and_speed_bytes_span_the_stroke():
    gripper = active()
    write(gripper, (0x0900, 0, 0), ACTIVATION_NS)
    assert gripper.command(ACTIVATION_NS) == GripCommand(0.085, 0.020, 3.0)
    write(gripper, (0x0900, 255, 0xFFFF), ACTIVATION_NS)
    assert gripper.command(ACTIVATION_NS) == GripCommand(0.0, 0.150, 30.0)


def test_nothing_moves_before_it_is_active_and_the_fault_states_why():
    gripper = Gripper2F()
    write(gripper, (0x0800, 255, 0), 0)
    assert gripper.command(0).width_m == 0.085
    assert status(gripper, 0).fault == "activation_bit_not_set"
    write(gripper, (0x0900, 255, 0), MS)
    assert status(gripper, MS).fault == "activation_needed"
    assert gripper.command(MS).width_m == 0.085


def test_the_status_reports_the_scene():
    gripper = active()
    write(gripper, (0x0900, 255, 0), ACTIVATION_NS)
    moving = status(observed(gripper, width_m=0.07, moving=True), ACTIVATION_NS)
    assert (moving.object, moving.moving) == ("moving", True)
    assert moving.width_m == pytest.approx(0.07, abs=2e-4)
    held = status(observed(gripper, width_m=0.06, in_contact=True, normal_n=7.0), ACTIVATION_NS, modbus.READ_HOLDING)
    assert (held.object, held.moving) == ("contact_closing", False)
    assert held.current_a == pytest.approx(0.14)
    assert status(observed(gripper, width_m=0.0), ACTIVATION_NS).object == "none"


def test_a_session_with_another_address_hears_nothing_and_says_what_to_check():
    session, line = Session(unit=5), make(0)
    drive(session, line, 0.5)
    assert session.state == "no reply"
    assert session.health.note.startswith(
        "no reply at Modbus address 5: is the gripper powered? is `unit` its address?"
    )
    session.receive(b"noise", 500 * MS)
    drive(session, line, 1.0, begin_ns=500 * MS, start=False)
    assert session.health.note.startswith("no reply")
    session = Session()
    drive(session, line, 0.5)
    assert (session.health.note, session.state) == ("", "inactive")
