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
from run_courses import Step, ask, follow, newest, tick
from scipy.spatial.transform import Rotation

from slipd import config
from slipd.devices import bota
from slipd.events import Bytes
from slipd.grasp import held_object, object_estimate
from slipd.grasp.grasp_fingers import place_fingers, weighed_fingers
from slipd.grasp.object_estimate import NamedObject
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
        self.sends = 1  # copies of each reading of the arm
        self.lies = 1.0  # what the arm reports over what it feels
        self.swing_nm = 0.0  # spin about the line through both pads
        self.step: Callable[[float], None] = self.serve_gripper if "gripper" in self.engine.links else self.let_pass

    def hold(self, gravity: Sequence[float] = DOWN, grip_n: float = GRIP_N, mass_kg: float = MASS_KG) -> None:
        """Let a step pass in which the gripper feels this and holds an object, or nothing."""
        self.step(STEP_MS)
        for _ in range(self.sends * self.carries):
            self.carry([self.lies * each for each in gravity], STILL, t_ns=self.t_ns - 1)
        force = mass_kg * np.array(gravity) / 2.0
        torque = mass_kg * np.cross(COM_M, gravity) + (0.0, self.swing_nm, 0.0)
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


def hold(times: int, **more: Any) -> Step:
    return lambda run: [run.hold(**more) for _ in range(times)]


def move(seconds: float) -> Step:
    return lambda run: run.move(seconds)


def has(**changed: Any) -> Step:
    return lambda run: vars(run).update(changed)


def held(**expected: Any) -> Step:
    """Check ``object`` of the newest message."""
    return newest("grasp", object=expected)


def unknown(why: str) -> Step:
    return held(unknown=why)


def arm(**expected: Any) -> Step:
    return newest("status", streams={"arm": expected})


def turned(run: HeldRun) -> None:
    """A client states gravity while the gripper turns."""
    run.lease()
    for k in range(40):
        gravity = DOWN if k < 15 else (DOWN[2], 0.0, 0.0)
        in_pad = run.pads[0].inv().apply(gravity).tolist()
        ask("gravity.set", finger="left", gravity_mps2=in_pad)(run)
        run.hold(gravity)


def not_tared(run: HeldRun) -> None:
    run.engine._fingers["left"].zero_known = False


def named(name: str) -> Step:
    def name_it(run: HeldRun) -> None:
        run.lease()
        ask("object.set", name=name)(run)

    return name_it


def swings(hz: float) -> Step:
    def swing(run: HeldRun) -> None:
        for t_s in np.arange(0.0, 2.0, STEP_MS * 1e-3):
            run.swing_nm = 0.01 * np.sin(2.0 * np.pi * hz * t_s)
            run.hold()

    return swing


def swings_at(hz: float) -> Step:
    def check(run: HeldRun) -> None:
        assert run.engine._status._rig.grasp.held.swing.rate_radps == pytest.approx(2.0 * np.pi * hz, rel=0.05)

    return check


def knows_gravity(run: HeldRun) -> None:
    assert run.engine._arm.gravity.gravity() is not None


def swings_nowhere(run: HeldRun) -> None:
    assert run.engine._status._rig.grasp.held.swing is None


REST: Step = HeldRun.rest
RELEASED = hold(8, grip_n=0.0, mass_kg=0.0)
WEIGHED = held(mass_kg=pytest.approx(MASS_KG, rel=0.02))
RIG_OF_GRIPPER = RIG + GRIPPER
COURSES: dict[str, tuple[str, list[Step]]] = {
    "an object is weighed in the grasp and forgotten with it": (
        RIG_OF_GRIPPER,
        [
            *(REST, unknown("nothing is held"), hold(20), unknown(object_estimate.NOT_MOVED), move(1.0), WEIGHED),
            held(unknown="", com_m=pytest.approx(COM_M, abs=0.002)),
            RELEASED,
            held(mass_kg=None, mass_std_kg=None, com_m=None, com_std_m=None, unknown="nothing is held"),
        ],
    ),
    "a named object is known again once the grip carries its whole weight": (
        RIG_OF_GRIPPER,
        [
            *(REST, named("glass"), move(1.0), held(unknown=""), RELEASED),
            *(hold(30, mass_kg=1.2 * MASS_KG), unknown(object_estimate.NOT_MOVED), RELEASED),
            *(hold(30, mass_kg=0.9 * MASS_KG), unknown(object_estimate.NOT_MOVED)),
            *(hold(5), unknown(object_estimate.NOT_MOVED)),
            *(hold(12), WEIGHED, held(unknown="", com_m=pytest.approx(COM_M, abs=0.002))),
            *(hold(5, mass_kg=0.5 * MASS_KG), hold(10), held(mass_kg=None), hold(20), WEIGHED, RELEASED),
            *(named("bottle"), hold(30), unknown(object_estimate.NOT_MOVED)),
        ],
    ),
    "an object that swings on the pads shows how fast until it is released": (
        RIG_OF_GRIPPER,
        [
            *(REST, move(1.0), swings_nowhere, swings(5.0), swings_at(5.0), hold(8), swings_at(5.0)),
            *(RELEASED, swings_nowhere),
        ],
    ),
    "D6 a stream of the wrong sign is named at once, not used, and used again when mended": (
        RIG_OF_GRIPPER,
        [
            *(REST, has(lies=-1.0), move(1.2), arm(health=Health.ERROR), unknown(held_object.NO_MOTION.unknown)),
            lambda run: says_of_arm(run, "its sign is wrong"),
            *(has(lies=1.0), move(2.0), lambda run: says_of_arm(run, ""), WEIGHED),
        ],
    ),
    "D6 a fault of the stream is named although the fingers are touched all the time": (
        RIG_OF_GRIPPER,
        [
            *(REST, has(lies=-1.0), lambda run: [run.move(0.2, grip_n=grip_n) for grip_n in 3 * (GRIP_N, 0.0)]),
            lambda run: says_of_arm(run, "its sign is wrong"),
        ],
    ),
    "D6 what was learned before a fault of the stream is not believed after it": (
        RIG_OF_GRIPPER,
        [
            *(REST, move(1.0), WEIGHED, has(lies=-1.0), move(1.2), arm(health=Health.ERROR)),
            *(has(lies=1.0), move(0.82), lambda run: says_of_arm(run, ""), unknown(object_estimate.NOT_MOVED)),
        ],
    ),
    "D6 readings of the arm that repeat, and some that no arm gives, spoil nothing": (
        RIG_OF_GRIPPER.replace('sensor = "arm"\nrate_hz = 50.0', 'sensor = "arm"\nrate_hz = 100.0'),
        [
            *(has(sends=2), REST, move(0.5), lambda run: run.carry(DOWN, (1e200, 0.0, 0.0))),
            *(lambda run: run.carry((np.nan,) * 3), lambda run: says_of_arm(run, "invalid"), move(1.0), WEIGHED),
            knows_gravity,
        ],
    ),
    "gravity of requests is the slow form": (
        RIG_OF_GRIPPER.replace(ARM.replace("250.0", "50.0"), ""),
        [hold(2), unknown(held_object.NO_MOTION.unknown), turned, WEIGHED],
    ),
    "without a width only the mass is known": (
        RIG, [REST, move(1.0), WEIGHED, held(com_m=None, unknown=object_estimate.NO_WIDTH)],
    ),
    "loads do not wait for a stream that fell silent": (
        RIG_OF_GRIPPER, [REST, move(1.0), has(carries=False), hold(20), unknown(held_object.NO_MOTION.unknown)],
    ),
    "an object is unknown while a finger is not tared": (
        RIG_OF_GRIPPER, [not_tared, move(0.1), unknown(held_object.NOT_TARED.unknown)],
    ),
}  # fmt: skip


def says_of_arm(run: HeldRun, words: str) -> None:
    found = run.stream()["message"]
    assert words in found if words else found == ""


@pytest.mark.parametrize("name", COURSES)
def test_D6_a_course_of_an_object(name: str) -> None:
    text, steps = COURSES[name]
    follow(HeldRun(text), steps)


def test_load_is_read_every_20_ms_where_two_force_sensors_see_a_grasp() -> None:
    run, blind = HeldRun(), ArmRun(ONE_SENSOR)
    grasp, fingers, t_ns = config.parse(RIG, "test").grasp, run.engine._fingers, run.t_ns + 1_000_000_000
    weighed, known = weighed_fingers(place_fingers(grasp, fingers)), held_object.KnownObjects(NamedObject(), 0.0)
    assert held_object.HeldObject(weighed, None, known).update(t_ns, None) == t_ns + held_object.PERIOD_NS
    follow(blind, [tick, unknown(held_object.NO_SENSOR.unknown)])
