import numpy as np
import pytest

from slipd.devices import bota, pvdf
from slipd.devices.robotiq_2f import robotiq_registers
from slipd.devices.shared import modbus
from slipd.fusion import contact_from_wrench
from slipd.signals.mounting import Mounting
from slipd.tools.sim.scene import Scene
from slipd.tools.sim.scene_parts import Patch
from slipd.tools.sim.virtual_gripper import LEFT_MOUNT, LINES, RIGHT_MOUNT, VirtualRig

TICK_NS = 1_250_000


def write(rig, registers, t_ns):
    request = modbus.Request(
        robotiq_registers.UNIT, modbus.WRITE, write_address=robotiq_registers.OUTPUT_ADDRESS, registers=registers
    )
    assert rig.receive("gripper", modbus.encode_request(request), t_ns)


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


def contact(samples, mount, t_s):
    """Return the mean contact of one finger in the 50 ms before a time, as the daemon computes it."""
    chosen = [s for s in samples if t_s - 0.05 < s.t_ns * 1e-9 <= t_s]
    felt = np.mean([np.concatenate((s.force_n, s.torque_nm)) for s in chosen], axis=0) - np.array(mount.bias)
    wrench = Mounting(mount.xyz_m, mount.quat_xyzw).matrix @ felt
    return contact_from_wrench(wrench[:3], wrench[3:])


def test_both_fingers_see_the_load_in_their_own_frames(played):
    _, samples = played
    left, right = (
        contact(samples[f"{side}-wrench"], mount, 9.4) for side, mount in (("left", LEFT_MOUNT), ("right", RIGHT_MOUNT))
    )
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
    assert rig.receive("left-wrench", b"C", 400 * TICK_NS).startswith(b"r,0,C,0")
    assert rig.receive("left-pad", b"C", 400 * TICK_NS) == b""
    said = rig.advance(400 * TICK_NS)
    assert said["left-wrench"] == b""
    assert said["right-wrench"] != b""


def test_the_scene_begins_when_the_gripper_is_activated_and_each_of_its_events_is_returned_once(played):
    rig, _ = played
    assert rig.began_ns == 400 * TICK_NS
    assert rig.scene.t_s == pytest.approx(9.5 - 0.5, abs=0.01)
    assert [truth.event for truth in rig.news()] == ["contact", "lift", "pour", "forecast"]
    assert rig.news() == []
