"""The motion of the arm: through the engine, from the bytes of its sender to the force without the finger's weight."""

from __future__ import annotations

import numpy as np
import pytest
from engine_rig import GRIPPER, LEFT, MS, RIGHT, Run
from grasp_table import grasp_table
from scipy.spatial.transform import Rotation

from slipd import config
from slipd.devices import bota
from slipd.devices.external import encode_reading
from slipd.events import Bytes
from slipd_client.messages import Health

MASS_KG, COM_M = 0.1, np.array((0.004, -0.002, -0.03))
HEAVY = LEFT.replace("stuck_after = 0", f"stuck_after = 0\nmass_kg = {MASS_KG}\ncom_m = {COM_M.tolist()}")
ARM = """
[grasp.arm]
device = "external"
port = "ipc:///tmp/arm"
sensor = "arm"
rate_hz = 250.0
"""
RIG = HEAVY + RIGHT + grasp_table() + ARM
G = np.array((0.0, 0.0, -9.80665))
DOWN = (0.0, 0.0, 9.80665)
"""Gravity in the gripper frame whose Z axis, towards the fingertips, points down."""
PADS = config.parse(RIG, "rig.toml").grasp.pads
REST = (0.0, 0.0, 0.0)


def send(run: Run, gravity: object, velocity: object = REST, **more: object) -> None:
    """Push one reading of the arm now."""
    link = next(name for name in run.engine.links if name == "arm")
    data = encode_reading("arm", run.t_ns, gravity_mps2=gravity, angular_velocity_radps=velocity, **more)
    run.feed(Bytes(link, data))


def rest(run: Run, gravity: object = DOWN, ms: int = 1100) -> None:
    """Let the arm rest for a while; its sender sends at 250 Hz."""
    for _ in range(ms // 4):
        run.wait(4)
        send(run, gravity)
        run.tick()


def stream(run: Run, name: str = "arm") -> dict[str, object]:
    return run.ask("status")["result"]["streams"][name]


@pytest.fixture
def run() -> Run:
    made = Run(RIG)
    made.up()
    return made


def test_weight_of_a_finger_is_subtracted_while_the_arm_turns_and_accelerates(run: Run) -> None:
    """The readings come from the path of the finger's centre of mass in the world, differentiated twice."""
    rest(run)
    pad = Rotation.from_quat(PADS["left"].quat_xyzw)
    com_m = np.mean(np.array(PADS["left"].positions)[:, 1:], axis=0) + pad.apply(COM_M)

    def pose(t_s: float) -> tuple[Rotation, np.ndarray]:
        turned = Rotation.from_rotvec(np.array((0.9, -0.5, 1.4)) * np.sin(3.0 * t_s))
        return turned, np.array((0.2 * np.sin(8.0 * t_s), 0.05 * np.cos(7.0 * t_s), 0.03 * t_s))

    def path(t_s: float, at_m: np.ndarray) -> np.ndarray:
        turned, place = pose(t_s)
        return place + turned.apply(at_m)

    def second(t_s: float, at_m: np.ndarray, h: float = 1e-4) -> np.ndarray:
        return (path(t_s + h, at_m) - 2.0 * path(t_s, at_m) + path(t_s - h, at_m)) / h**2

    def velocity(t_s: float, h: float = 1e-5) -> np.ndarray:
        return (pose(t_s - h)[0].inv() * pose(t_s + h)[0]).as_rotvec() / (2.0 * h)

    largest = 0.0
    for t_s in np.arange(0.1, 1.0, 0.1):
        turned, _ = pose(t_s)
        gravity = turned.inv().apply(G - second(t_s, np.zeros(3)))
        turning = (velocity(t_s + 1e-4) - velocity(t_s - 1e-4)) / 2e-4
        run.wait(4)
        send(run, gravity, velocity(t_s), angular_acceleration_radps2=turning)
        weight = MASS_KG * pad.inv().apply(turned.inv().apply(G - second(t_s, com_m)))
        load = np.array((1.0, -0.5, -5.0))
        run.wait(6)
        force, torque = load + weight, np.cross(COM_M, weight)
        run.feed(Bytes("left.wrench", bota.encode_frame(force, torque, run.t_ns // 1000)))
        body = run.published("wrench.left")[-1]
        assert body["force_n"] == pytest.approx(load, abs=2e-4)
        assert body["torque_nm"] == pytest.approx((0.0, 0.0, 0.0), abs=2e-5)
        largest = max(largest, np.linalg.norm(weight) / MASS_KG)
    assert largest > 14.0, "gravity alone would not do"
    assert stream(run, "left.wrench")["gravity"] == "compensated"


def test_D6_without_its_stream_the_weight_is_unknown_again_and_the_slow_form_counts(run: Run) -> None:
    rest(run)
    run.wrench(0.0)
    status = stream(run)
    assert (status["health"], status["message"], status["clock"]) == (Health.OK, "", "host")
    down = {"finger": "left", "gravity_mps2": [9.80665, 0.0, 0.0]}
    run.lease()
    assert run.refusal("gravity.set", **down) == ("not_ready", "gravity_mps2"), "nor may who holds the lease"
    run.wait(21)
    run.tick()
    assert stream(run)["health"] == Health.STALE
    assert stream(run, "left.wrench")["gravity"] == "unknown_orientation"
    assert "an arm stream ([grasp.arm]) removes it" in str(stream(run, "left.wrench")["message"])
    assert run.refusal("gravity.set", **down) is None
    assert stream(run, "left.wrench")["gravity"] == "compensated"
    send(run, DOWN)
    assert run.refusal("gravity.set", **down) == ("not_ready", "gravity_mps2"), "the stream counts at once"


@pytest.mark.parametrize(
    ("gravity", "more", "message"),
    [
        ((0.0, 0.0, 1.0), {}, "the mean length of gravity_mps2 is 1 m/s²; it must be near 9.81"),
        (REST, {}, "the mean length of gravity_mps2 is 0 m/s²"),
        (DOWN, {"status": ["invalid"]}, "the sender reports: invalid"),
        (DOWN, {"velocity": (0.0, 57.3, 0.0)}, "its angular velocity is 57.3 rad/s, more than any arm's"),
        (
            DOWN,
            {"angular_acceleration_radps2": (2e3, 0.0, 0.0)},
            "its motion exceeds 49 m/s² (5 g) at a finger: check its units",
        ),
    ],
)
def test_D6_a_stream_that_cannot_be_right_is_named_and_not_believed(
    run: Run, gravity: object, more: dict[str, object], message: str
) -> None:
    for _ in range(300):
        run.wait(4)
        send(run, gravity, **more)
    status = stream(run)
    assert status["health"] == Health.ERROR
    assert message in str(status["message"])
    assert stream(run, "left.wrench")["gravity"] == "unknown_orientation"
    rest(run, ms=2100)
    assert stream(run)["health"] == Health.OK
    assert stream(run, "left.wrench")["gravity"] == "compensated"


def test_a_finger_further_out_is_pulled_out_more_by_a_turn() -> None:
    """Both at the width that the gripper reports: half of it, and the distance of the centre of mass."""
    run = Run(RIG + GRIPPER)
    run.up()
    rest(run)
    run.serve_gripper(200)
    width_m = run.published("gripper")[-1]["width_m"]
    assert width_m == pytest.approx(0.085)
    send(run, DOWN, (5.0, 0.0, 0.0))
    run.wrench(0.0, ms=6.0)
    outward_n = MASS_KG * 25.0 * (width_m / 2.0 - COM_M[2])
    assert run.published("wrench.left")[-1]["force_n"][2] == pytest.approx(outward_n, rel=1e-6), "-Z points outwards"


def test_gravity_is_checked_for_a_second_before_it_is_used(run: Run) -> None:
    rest(run, ms=900)
    assert stream(run)["message"] == "its gravity is checked for 1 s before it is used"
    assert stream(run, "left.wrench")["gravity"] == "unknown_orientation"
    rest(run, ms=200)
    assert (stream(run)["message"], stream(run, "left.wrench")["gravity"]) == ("", "compensated")


def test_a_finger_without_a_force_sensor_and_a_rig_without_an_arm_are_as_before(run: Run) -> None:
    rest(run)
    reply = run.ask("gravity.set", finger="right", gravity_mps2=[0.0, 0.0, 9.8])
    assert reply["error"]["code"] == "not_ready"
    bare = Run(RIG.replace(ARM, ""))
    bare.up()
    assert "arm" not in bare.engine.links
    assert bare.refusal("gravity.set", finger="left", gravity_mps2=[9.8, 0.0, 0.0]) is None


def test_D6_a_reading_that_is_older_than_its_stream_allows_is_not_used(run: Run) -> None:
    rest(run)
    run.wait(100)
    old_ns = run.t_ns - 50 * MS
    run.feed(Bytes("arm", encode_reading("arm", old_ns, gravity_mps2=DOWN, angular_velocity_radps=REST)))
    run.tick()
    assert stream(run, "left.wrench")["gravity"] == "unknown_orientation"
