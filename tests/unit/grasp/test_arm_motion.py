"""The motion of the arm: from the bytes of its sender to the force without the finger's weight."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from arm_rig import ARM, COM_M, DOWN, MASS_KG, RIG, STILL, ArmRun
from engine_rig import GRIPPER, LEFT, RIGHT
from grasp_table import grasp_table
from load_course import line
from nanoseconds import MS
from run_courses import Step, follow, status, tick, wait, wrench
from scipy.spatial.transform import Rotation

from slipd import config
from slipd.devices import bota
from slipd.events import Bytes
from slipd_client.messages import Health

G = np.array((0.0, 0.0, -9.80665))
PADS = config.parse(RIG, "rig.toml").grasp.pads


@pytest.fixture
def run() -> ArmRun:
    return ArmRun()


def test_weight_of_a_finger_is_subtracted_while_the_arm_turns_and_accelerates(run: ArmRun) -> None:
    """The readings come from the path of the finger's centre of mass in the world, differentiated twice."""
    run.carry_for(1100)
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
        run.carry(gravity, velocity(t_s), angular_acceleration_radps2=turning)
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
    assert run.stream("left.wrench")["gravity"] == "compensated"


@pytest.mark.parametrize(
    ("gravity", "more", "message"),
    [
        ((0.0, 0.0, 1.0), {}, "the mean length of gravity_mps2 is 1 m/s²; it must be near 9.81"),
        (STILL, {}, "the mean length of gravity_mps2 is 0 m/s²"),
        ((0.0, 0.0, 10.79), {}, "the length of gravity_mps2 at rest is 10.8 m/s²; it must be 9.81: its scale is wrong"),
        (DOWN, {"flips": True}, "gravity_mps2 jumps to and fro by more than 1.5 g: its readings are not used"),
        (DOWN, {"status": ["invalid"]}, "the sender reports: invalid"),
        (DOWN, {"velocity": (0.0, 57.3, 0.0)}, "its angular velocity is 57.3 rad/s, more than any arm's"),
        (DOWN, {"angular_acceleration_radps2": (0.0, 1e30, 0.0)}, "its angular acceleration is 1e+30 rad/s²"),
        (
            DOWN,
            {"angular_acceleration_radps2": (2e3, 0.0, 0.0)},
            "its motion exceeds 49 m/s² (5 g) at a finger: check its units",
        ),
    ],
)
def test_D6_a_stream_that_cannot_be_right_is_named_and_not_believed(
    run: ArmRun, gravity: object, more: dict[str, object], message: str
) -> None:
    run.carry_for(1200, gravity, **more)
    status = run.stream()
    assert status["health"] == Health.ERROR
    assert message in str(status["message"])
    assert run.stream("left.wrench")["gravity"] == "unknown_orientation"
    run.carry_for(2100)
    assert run.stream()["health"] == Health.OK
    assert run.stream("left.wrench")["gravity"] == "compensated"
    assert run.refusal("gravity.set", finger="left", gravity_mps2=[9.8, 0.0, 0.0]) == ("not_ready", "gravity_mps2")


def test_a_finger_further_out_is_pulled_out_more_by_a_turn() -> None:
    """Both at the width that the gripper reports: half of it, and the distance of the centre of mass."""
    run = ArmRun(RIG + GRIPPER)
    run.carry_for(1100)
    run.serve_gripper(200)
    width_m = run.published("gripper")[-1]["width_m"]
    assert width_m == pytest.approx(0.085)
    run.carry(DOWN, (5.0, 0.0, 0.0))
    run.wrench(0.0, ms=6.0)
    outward_n = MASS_KG * 25.0 * (width_m / 2.0 - COM_M[2])
    assert run.published("wrench.left")[-1]["force_n"][2] == pytest.approx(outward_n, rel=1e-6), "-Z points outwards"


UNKNOWN, CHECKED = "unknown_orientation", "its gravity is checked for 1 s before it is used"
LOADED = wrench(5.0, (1.0, 0.0))


def carry(ms: float) -> Step:
    return lambda run: run.carry_for(ms)


def weight(state: str, **arm: str) -> Step:
    """Check how the weight of the finger is taken off, and what is said of the stream."""
    return status(streams={"left.wrench": {"gravity": state}, "arm": arm})


@pytest.mark.parametrize(
    "steps",
    [
        [carry(900), weight(UNKNOWN, message=CHECKED), carry(200), weight("compensated", message="")],
        # A reading that is older than its stream allows is not used.
        [carry(1100), wait(100), lambda run: run.carry(t_ns=run.t_ns - 50 * MS), tick, weight(UNKNOWN)],
        # In a stall, readings of a sensor are judged before those of the arm arrive: that does not make the weight
        # unknown, unless the stream was silent before. It counts no longer than gravity.set.
        *(
            [
                carry(1100), *[wait(4), tick] * ticks, wait(150), LOADED, weight(state), wait(100), LOADED,
                weight(UNKNOWN),
            ]
            for ticks, state in ((1, "compensated"), (10, UNKNOWN))
        ),
    ],
)  # fmt: skip
def test_D6_the_weight_is_taken_off_while_the_stream_is_fresh(run: ArmRun, steps: list[Step]) -> None:
    follow(run, steps)


STRONG = 14.0
"""Apparent gravity while the arm lifts, m/s²."""


@pytest.mark.parametrize(
    ("stream", "slips"),
    [
        (lambda apparent_mps2, lifted: apparent_mps2, False),
        (lambda apparent_mps2, lifted: -apparent_mps2, False),
        (lambda apparent_mps2, lifted: apparent_mps2 if apparent_mps2 < STRONG and not lifted else STRONG, True),
        (lambda apparent_mps2, lifted: apparent_mps2 / 9.80665, True),
        (lambda apparent_mps2, lifted: 1.1 * apparent_mps2, True),
        (lambda apparent_mps2, lifted: None if lifted else apparent_mps2, True),
        (lambda apparent_mps2, lifted: None, True),
    ],
    ids=["braking", "wrong sign", "object slides", "in g", "10 % more", "lost", "no stream"],
)
def test_a_load_that_falls_because_the_arm_brakes_is_no_slip(
    stream: Callable[[float, bool], float | None], slips: bool
) -> None:
    """A lift begins within 0.1 s and ends within 15 ms; the object weighs 0.35 kg on this pad."""
    run, rng = ArmRun(LEFT + RIGHT + grasp_table() + ARM), np.random.default_rng(1)
    pad = Rotation.from_quat(PADS["left"].quat_xyzw)
    course = line((9.80665, 9.80665, 1100), (9.80665, STRONG, 100), (STRONG, 10.5, 15), (10.5, 10.5, 100))
    for k, apparent_mps2 in enumerate(course):
        if k % 4 == 0 and (sent := stream(apparent_mps2, k >= 1200)) is not None:
            run.carry(pad.apply((sent, 0.0, 0.0)))
        run.wrench(10.0 + rng.normal(0.0, 0.01), (0.35 * apparent_mps2 + rng.normal(0.0, 0.01), 0.0))
        run.tick()
    assert ("slipping" in {body["level"] for body in run.published("slip.left")}) is slips
