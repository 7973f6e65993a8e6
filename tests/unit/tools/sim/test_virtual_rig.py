import numpy as np
import pytest

from slipd.devices import bota, pvdf
from slipd.devices.robotiq_2f import robotiq_registers
from slipd.devices.shared import modbus
from slipd.fusion import contact_from_wrench
from slipd.signals.mounting import mounting_matrix
from slipd.tools.sim.emulated_wrenches import encode_ack
from slipd.tools.sim.scene import Scene
from slipd.tools.sim.scene_parts import Patch
from slipd.tools.sim.virtual_gripper import BIAS, LINES, SENSOR_QUAT_XYZW, SENSOR_XYZ_M, VirtualRig

TICK_NS = 1_250_000


def write(rig, registers, t_ns):
    request = modbus.Request(
        robotiq_registers.UNIT, modbus.WRITE, robotiq_registers.OUTPUT_ADDRESS, registers=registers
    )
    assert rig.devices["gripper"].receive(modbus.encode_request(request), t_ns)


@pytest.fixture(scope="module")
def played():
    """Return every sample of each line in the first nine seconds with a grip of 7.5 N, and the rig."""
    rig = VirtualRig(Scene(), seed=5)
    decoders = {line: bota.Decoder() if "wrench" in line else pvdf.Decoder() for line in [*LINES][:4]}
    samples = {line: [] for line in decoders}
    for tick in range(1, round(9.5e9 / TICK_NS)):
        t_ns = tick * TICK_NS
        if tick == 400:
            write(rig, (0x0100, 0, 0), t_ns)
        if tick == 1600:
            write(rig, (0x0900, 255, 0x803C), t_ns)
        said = rig.advance(t_ns)
        for line, decoder in decoders.items():
            samples[line] += decoder.receive(said[line], t_ns)
    for line, decoder in decoders.items():
        assert decoder.health.bad == decoder.health.lost == decoder.health.bad_bytes == 0
        assert len(samples[line]) == pytest.approx(9.3 * 800 if "wrench" in line else 9.5 * 200, abs=5)
    return rig, samples


def contact(samples, side, t_s):
    """Return the mean contact of one finger in the 50 ms before a time, as the daemon computes it."""
    chosen = [s for s in samples[f"{side}-wrench"] if t_s - 0.05 < s.t_ns * 1e-9 <= t_s]
    felt = np.mean([np.concatenate((s.force_n, s.torque_nm)) for s in chosen], axis=0) - BIAS[side]
    wrench = mounting_matrix(SENSOR_XYZ_M, SENSOR_QUAT_XYZW) @ felt
    return contact_from_wrench(wrench[:3], wrench[3:])


def test_both_fingers_see_the_load_in_their_own_frames(played):
    _, samples = played
    left, right = (contact(samples, side, 9.4) for side in BIAS)
    x, y = Patch().centre_m
    for seen, side in ((left, 1), (right, -1)):
        assert seen.normal_n == pytest.approx(7.5, abs=0.02)
        assert seen.centroid_m == pytest.approx((x, side * y), abs=2e-4)
    assert left.tangential_n[0] == pytest.approx(right.tangential_n[0], abs=0.02)
    assert left.tangential_n[0] > 1.2
    assert left.spin_nm == pytest.approx(-right.spin_nm, abs=5e-4)
    assert left.spin_nm > 0.02


def test_commands_reach_the_sensor_they_are_written_to():
    rig = VirtualRig(Scene())
    for tick in range(1, 400):
        rig.advance(tick * TICK_NS)
    assert rig.devices["left-wrench"].receive(b"C", 400 * TICK_NS) == [encode_ack("C")]
    assert rig.devices["left-pad"].receive(b"C", 400 * TICK_NS) == []
    said = rig.advance(400 * TICK_NS)
    assert said["left-wrench"] == b""
    assert said["right-wrench"] != b""


def test_the_scene_begins_when_the_gripper_is_activated_and_keeps_its_events(played):
    rig, _ = played
    assert (rig.began_ns, rig.scene.t_s) == (400 * TICK_NS, pytest.approx(9.5 - 0.5, abs=0.01))
    assert [truth.event for truth in rig.scene.truth] == ["contact", "lift", "pour", "forecast"]
