"""What is held, from the bytes of both fingers and of the arm to ``object`` in the ``grasp`` message."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from arm_rig import ARM, DOWN, STILL, ArmRun
from arm_rig import RIG as ONE_SENSOR
from engine_rig import GRIPPER, LEFT
from grasp_table import grasp_table
from scipy.spatial.transform import Rotation

from slipd.devices import bota
from slipd.events import Bytes
from slipd.grasp import held_object, object_estimate
from slipd_client.messages import Health

STEP_MS = 20
FINGER = LEFT[: LEFT.index("[finger.left.pad]")].replace("1000.0", "50.0")
RIG = FINGER + FINGER.replace("left", "right") + grasp_table() + ARM.replace("250.0", "50.0")
MASS_KG, COM_M = 0.4, np.array((0.02, -0.005, 0.01))
GRIP_N = 6.0


class HeldRun(ArmRun):
    """Two force sensors at 50 Hz, an object between them, and an arm."""

    def __init__(self, text: str = RIG + GRIPPER) -> None:
        super().__init__(text)
        self.pads = [Rotation.from_quat(q) for q in ((0.5, -0.5, 0.5, 0.5), (-0.5, -0.5, -0.5, 0.5))]
        self.carries = "arm" in self.engine.links
        self.lies = 1.0  # what the arm reports over what it feels
        self.step: Callable[[float], None] = self.serve_gripper if "gripper" in self.engine.links else self.let_pass

    def hold(self, gravity: Sequence[float] = DOWN, grip_n: float = GRIP_N, mass_kg: float = MASS_KG) -> None:
        """Let a step pass in which the gripper feels this and holds an object, or nothing."""
        self.step(STEP_MS)
        if self.carries:
            self.carry([self.lies * each for each in gravity], STILL, t_ns=self.t_ns - 1)
        force = mass_kg * np.array(gravity) / 2.0
        torque = mass_kg * np.cross(COM_M, gravity)
        for name, pad, y_m in zip(("left", "right"), self.pads, (0.0425, -0.0425), strict=True):
            whole = force + pad.apply((0.0, 0.0, -grip_n))
            own = torque / 2.0 - np.cross((0.0, y_m, 0.0), force)
            noise = 1e-4 * np.sin(self.t_ns % 1_000_003 * np.arange(1, 7))
            frame = bota.encode_frame(
                pad.inv().apply(whole) + noise[:3], pad.inv().apply(own) + 0.01 * noise[3:], self.t_ns // 1000
            )
            self.feed(Bytes(f"{name}.wrench", frame))

    def let_pass(self, ms: float) -> None:
        """Let a step pass without a gripper."""
        self.wait(ms)
        self.tick()

    def rest(self) -> None:
        """Rest with free fingers until the stream is used."""
        for _ in range(1100 // STEP_MS):
            self.hold(grip_n=0.0, mass_kg=0.0)

    def move(self, seconds: float = 1.0, **more: float) -> None:
        """Swing the gripper about x while it holds an object."""
        for t_s in np.arange(0.0, seconds, STEP_MS * 1e-3):
            self.hold(Rotation.from_rotvec((0.8 * np.sin(4.0 * t_s), 0.3 * np.sin(7.0 * t_s), 0.0)).apply(DOWN), **more)

    def held(self) -> dict[str, Any]:
        """Return ``object`` of the newest message."""
        found: dict[str, Any] = self.published("grasp")[-1]["object"]
        return found


@pytest.fixture
def run() -> HeldRun:
    return HeldRun()


def test_object_is_weighed_in_the_grasp_and_forgotten_with_it(run: HeldRun) -> None:
    run.rest()
    assert run.held()["unknown"] == "nothing is held"
    for _ in range(20):
        run.hold()
    assert run.held()["unknown"] == object_estimate.NOT_MOVED
    run.move()
    found = run.held()
    assert found["unknown"] == ""
    assert found["mass_kg"] == pytest.approx(MASS_KG, rel=0.02)
    assert found["com_m"] == pytest.approx(COM_M, abs=0.002)
    for _ in range(8):
        run.hold(grip_n=0.0, mass_kg=0.0)
    assert run.held() == dict.fromkeys(("mass_kg", "mass_std_kg", "com_m", "com_std_m")) | {
        "unknown": "nothing is held"
    }


def test_D6_stream_of_the_wrong_sign_is_named_at_once_not_used_and_used_again_when_mended(run: HeldRun) -> None:
    run.rest()
    run.lies = -1.0
    run.move(1.2)
    status = run.published("status")[-1]["streams"]["arm"]
    assert status["health"] == Health.ERROR
    assert "its sign is wrong" in status["message"]
    assert run.held()["unknown"] == held_object.NO_MOTION
    run.lies = 1.0
    run.move(2.0)
    assert run.stream()["message"] == ""
    assert run.held()["mass_kg"] == pytest.approx(MASS_KG, rel=0.02)


def test_gravity_of_requests_is_the_slow_form() -> None:
    run = HeldRun((RIG + GRIPPER).replace(ARM.replace("250.0", "50.0"), ""))
    run.lease()
    run.hold()
    run.hold()
    assert run.held()["unknown"] == held_object.NO_MOTION
    for k in range(40):
        gravity = DOWN if k < 15 else (DOWN[2], 0.0, 0.0)
        in_pad = run.pads[0].inv().apply(gravity).tolist()
        assert run.refusal("gravity.set", finger="left", gravity_mps2=in_pad) is None
        run.hold(gravity)
    assert run.held()["mass_kg"] == pytest.approx(MASS_KG, rel=0.02)


def test_without_a_width_only_the_mass_is_known() -> None:
    run = HeldRun(RIG)
    run.rest()
    run.move()
    assert (run.held()["com_m"], run.held()["unknown"]) == (None, object_estimate.NO_WIDTH)


def test_loads_do_not_wait_for_a_stream_that_fell_silent(run: HeldRun) -> None:
    run.rest()
    run.move()
    run.carries = False
    for _ in range(20):
        run.hold()
    assert run.held()["unknown"] == held_object.NO_MOTION


def test_object_is_unknown_while_a_finger_is_not_tared(run: HeldRun) -> None:
    run.engine._fingers["left"].zero_known = False
    run.move(0.1)
    assert run.held()["unknown"] == held_object.NOT_TARED


def test_load_is_read_every_20_ms_where_two_force_sensors_see_a_grasp(run: HeldRun) -> None:
    held, t_ns = run.engine._held, run.t_ns + 1_000_000_000
    assert held.update(t_ns, None) == held.update(t_ns + 1, None) == t_ns + held_object.PERIOD_NS
    assert held_object.make_held_object(None, None, {}, None) is None
    blind = ArmRun(ONE_SENSOR)
    blind.tick()
    assert blind.published("grasp")[-1]["object"]["unknown"] == held_object.NO_SENSOR
