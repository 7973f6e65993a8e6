from types import SimpleNamespace

import pytest
from driving import drive
from nanoseconds import MS

from slipd.devices.robotiq_2f import Session, robotiq_registers
from slipd.devices.robotiq_2f.robotiq_registers import WIDTH_TABLE, Units
from slipd.devices.shared import modbus
from slipd.tools.sim.emulated_robotiq_2f import ACTIVATION_NS, FORCE_TABLE, Gripper2F, GripperLine
from slipd.tools.sim.scene import GripCommand

UNIT, OUT, IN = robotiq_registers.UNIT, robotiq_registers.OUTPUT_ADDRESS, robotiq_registers.INPUT_ADDRESS


WRITE_AND_READ = {  # as of pyRobotiqGripper 3.3: go to 200 and read the status; refused for the addresses of either
    "091707D0000303E8000306090000C8803C": "091706",
    "091707D0000307E8000306090000C8803C": "099702",
    "091708D0000303E8000306090000C8803C": "099702",
}


def write(gripper, registers, t_ns, at=OUT):
    request = modbus.Request(UNIT, modbus.WRITE, at, registers=registers)
    return modbus.find_reply(b"".join(gripper.receive(modbus.encode_request(request), t_ns)), request)


def status(gripper, t_ns, function=modbus.READ_INPUT):
    request = modbus.Request(UNIT, function, IN, 3)
    reply = modbus.find_reply(b"".join(gripper.receive(modbus.encode_request(request), t_ns)), request)
    return robotiq_registers.parse_status(reply.registers, t_ns, None, Units(FORCE_TABLE, WIDTH_TABLE, None).width_m)


def active():
    gripper = Gripper2F()
    write(gripper, (0x0100, 0, 0), 0)
    return gripper


def test_activation_takes_its_time_and_begins_with_a_rising_edge():
    gripper = Gripper2F()
    assert not status(gripper, 0).active
    write(gripper, (0x0100, 0, 0), 10 * MS)
    activating, done = status(gripper, ACTIVATION_NS), status(gripper, 10 * MS + ACTIVATION_NS)
    assert (activating.active, activating.moving, done.active) == (False, True, True)
    write(gripper, (0x0900, 0, 0), 2 * ACTIVATION_NS)
    assert status(gripper, 2 * ACTIVATION_NS).active
    assert gripper.activated_ns == 10 * MS
    frames = map(modbus.with_checksum, map(bytes.fromhex, WRITE_AND_READ))
    assert [gripper.receive(frame, MS)[0][:3].hex() for frame in frames] == list(WRITE_AND_READ.values())


@pytest.mark.parametrize(
    ("registers", "command"),
    [
        ((0x0900, 0, 0), GripCommand(0.085, 0.020, 3.0)),
        ((0x0900, 255, 0xFFFF), GripCommand(0.0, 0.150, 30.0)),
        *(((0x0900, 255, byte), GripCommand(0.0, 0.020, force_n)) for byte, force_n in [*FORCE_TABLE, (30, 5.25)]),
    ],
)
def test_the_bytes_of_position_speed_and_force_mean_what_the_tables_say(registers, command):
    gripper = active()
    write(gripper, registers, ACTIVATION_NS)
    assert gripper.command(ACTIVATION_NS) == command


def test_nothing_moves_before_it_is_active_and_the_fault_states_why():
    gripper = Gripper2F()
    for t_ns, action, fault in ((0, 0x0800, "activation_bit_not_set"), (MS, 0x0900, "activation_needed")):
        write(gripper, (action, 255, 0), t_ns)
        assert (gripper.command(t_ns).width_m, status(gripper, t_ns).fault) == (0.085, fault)


@pytest.mark.parametrize(
    ("scene", "function", "shown"),
    [
        ((0.07, True, False, 0.0), modbus.READ_INPUT, ("moving", True, 0.07, 0.12)),
        ((0.06, False, True, 7.0), modbus.READ_HOLDING, ("contact_closing", False, 0.06, 0.14)),
        ((0.0, False, False, 0.0), modbus.READ_INPUT, ("none", False, 0.0, 0.0)),
    ],
)
def test_the_status_reports_the_scene(scene, function, shown):
    gripper = active()
    write(gripper, (0x0900, 255, 0), ACTIVATION_NS)
    gripper.observe(SimpleNamespace(**dict(zip(("width_m", "moving", "in_contact", "normal_n"), scene, strict=True))))
    found = status(gripper, ACTIVATION_NS, function)
    assert (found.object, found.moving) == shown[:2]
    assert (found.width_m, found.current_a) == pytest.approx(shown[2:], abs=2e-4)


def test_a_session_with_another_address_hears_nothing_and_says_what_to_check():
    session, line = Session(unit=5), GripperLine()
    drive(session, line, 0.5)
    assert session.state == "no reply"
    session.receive(b"noise", 500 * MS)
    drive(session, line, 1.0, begin_ns=500 * MS, start=False)
    assert session.health.note.startswith(
        "no reply at Modbus address 5: is the gripper powered? is `unit` its address?"
    )
    session = Session()
    drive(session, line, 0.5)
    assert (session.health.note, session.state) == ("", "inactive")
