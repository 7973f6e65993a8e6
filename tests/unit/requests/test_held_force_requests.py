"""The force of a held object changes within step, rate and budget; engine and real bytes."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest

Run = Any


class TestForceOfAHeldObject:
    def test_the_force_of_a_held_object_is_set_and_adjusted_without_motion(self, run: Run) -> None:
        run.bring_up()
        run.grip(5.0)
        assert run.ask("grip.set", force_n=6)["result"] == {"applied_n": pytest.approx(6.0)}
        run.serve_gripper(50)
        assert (run.gripper.command.position, run.gripper.command.force) == (255, 30)
        run.feel(6.0)
        assert run.ask("grip.adjust", delta_n=0.5)["result"] == {"applied_n": pytest.approx(6.5)}
        assert run.ask("grip.adjust", delta_n=-1.0)["result"] == {"applied_n": pytest.approx(5.5)}
        run.serve_gripper(50)
        assert (run.gripper.command.position, run.gripper.command.force) == (255, 25)
        assert run.published("gripper")[-1]["force_command_n"] == pytest.approx(5.5)

    def test_no_force_is_set_without_a_grip(self, run: Run) -> None:
        run.bring_up()
        assert run.refusal("grip.set", force_n=5.0) == ("not_ready", "")
        assert run.refusal("grip.adjust", delta_n=1.0) == ("not_ready", "")
        run.serve_gripper(50)
        assert run.writes() == []

    @pytest.mark.parametrize(
        ("op", "fields", "refusal"),
        [
            ("grip.set", {"force_n": 7.5}, ("out_of_range", "force_n")),
            ("grip.adjust", {"delta_n": 2.5}, ("out_of_range", "delta_n")),
            ("grip.adjust", {"delta_n": -2.5}, ("out_of_range", "delta_n")),
            ("grip.adjust", {"delta_n": math.nan}, ("not_finite", "delta_n")),
            ("grip.adjust", {"delta_n": 1e308}, ("out_of_range", "delta_n")),
            ("gripper.close", {"force_n": 7.5}, ("out_of_range", "force_n")),
        ],
    )
    def test_A3_a_step_beyond_the_limit_is_refused(
        self, run: Run, op: str, fields: dict[str, Any], refusal: tuple[str, str]
    ) -> None:
        run.bring_up()
        run.grip(5.0)
        assert run.refusal(op, **fields) == refusal
        run.serve_gripper(50)
        assert run.writes() == []

    def test_A8_the_force_rises_no_faster_than_the_limit(self, run: Run) -> None:
        run.bring_up()
        run.grip(5.0)
        assert run.refusal("grip.adjust", delta_n=2.0) is None
        refused = run.ask("grip.adjust", delta_n=1.0)["error"]
        assert (refused["code"], refused["field"]) == ("too_fast", "delta_n")
        assert "100 ms" in refused["message"]
        run.serve_gripper(100)
        run.feel(7.0)
        assert run.refusal("grip.adjust", delta_n=1.0) is None

    def test_A6_A8_raises_that_the_gripper_has_not_acknowledged_never_act_all_at_once(self, run: Run) -> None:
        run.bring_up()
        run.grip(5.0)
        run.gripper.silent = True
        assert run.refusal("grip.adjust", delta_n=2.0) is None
        run.wait(20)
        run.feel(5.0)
        refused = run.ask("grip.adjust", delta_n=0.2)["error"]
        assert (refused["code"], refused["field"]) == ("too_fast", "delta_n")
        assert "within 2 N of the 5 N that the gripper acknowledged last" in refused["message"]
        run.gripper.silent = False
        run.serve_gripper(60)
        run.feel(7.0)
        assert run.refusal("grip.adjust", delta_n=0.2) is None

    def test_A8_the_force_falls_no_faster_than_the_limit_also_in_coarse_settings(
        self, make_run: Callable[[str], Run], rig: str
    ) -> None:
        """Settings are 0.84 N apart, so that every request changes the force by at least that."""
        run = make_run(rig.replace("[[0, 3.0], [255, 28.5]]", "[[0, 20.0], [255, 235.0]]").replace("25.0", "120.0"))
        run.up()
        run.bring_up()
        run.grip(60.0)
        run.serve_gripper(1000)
        first_n = force_n = run.published("gripper")[-1]["force_command_n"]
        began_ns = run.t_ns
        assert run.refusal("grip.adjust", delta_n=-1.9) == ("out_of_range", "delta_n"), "it would be 2.5 N"
        for _ in range(50):
            run.feel(60.0)
            assert run.refusal("grip.set", force_n=force_n) is None, "what is in force may be asked for at any time"
            reply = run.ask("grip.adjust", delta_n=-0.01)
            if reply["ok"]:
                force_n = reply["result"]["applied_n"]
            else:
                assert reply["error"]["code"] == "too_fast"
            run.serve_gripper(20)
        lowered_n = first_n - force_n
        assert 2.0 < lowered_n <= 2.0 + 2.0 * (run.t_ns - began_ns) * 1e-9
        run.serve_gripper(1000)
        run.feel(60.0)
        assert run.ask("grip.adjust", delta_n=0.1)["result"] == {"applied_n": force_n}, "no setting lies between"

    def test_A8_all_raises_of_a_grasp_share_a_budget(self, make_run: Callable[[str], Run], rig: str) -> None:
        run = make_run(rig + "budget_n = 3.0\n")
        run.up()
        run.bring_up()
        run.grip(5.0)
        assert run.refusal("grip.adjust", delta_n=2.0) is None
        run.serve_gripper(200)
        run.feel(7.0)
        assert run.refusal("grip.adjust", delta_n=2.0) == ("budget_spent", "delta_n")
        assert run.refusal("gripper.open", drop=True) is None
        run.gripper.found = 3
        run.feel(0.0)
        run.serve_gripper(50)
        run.grip(8.0)
        assert run.refusal("grip.adjust", delta_n=2.0) is None, "another grasp has a budget of its own"

    def test_a_lost_object_ends_the_grasp(self, run: Run) -> None:
        run.bring_up()
        run.grip(5.0)
        run.gripper.found = 3
        run.feel(0.0)
        run.serve_gripper(50)
        assert run.published("gripper")[-1]["object"] == "none"
        assert run.refusal("grip.adjust", delta_n=0.5) == ("not_ready", "")
        assert run.refusal("gripper.close", force_n=12.0) is None

    def test_a_pressed_finger_counts_more_than_the_report_of_the_gripper(self, run: Run) -> None:
        run.bring_up()
        run.grip(5.0)
        run.gripper.found = 3
        for _ in range(5):
            run.serve_gripper(20)
            run.feel(5.0)
        assert run.published("gripper")[-1]["object"] == "none"
        assert run.refusal("gripper.close", force_n=12.0) == ("out_of_range", "force_n")

    def stale(self, run: Run) -> None:
        run.serve_gripper(150)
        run.wrench(5.0)

    def old(self, run: Run) -> None:
        """Received 30 ms ago: fresh enough for a verdict on a slow sensor, too old for a raise."""
        run.wait(51)
        run.skin(5.0, ms=1)

    def doubtful(self, run: Run) -> None:
        run.feel(5.0)
        run.wrench(5.0, status=2)

    def unplugged(self, run: Run) -> None:
        run.down("left.wrench")

    def without_its_pad(self, run: Run) -> None:
        run.feel(5.0)
        run.down("left.pad")

    @pytest.mark.parametrize("state", ["stale", "old", "doubtful", "unplugged", "without_its_pad"])
    def test_F1_no_raise_on_a_stale_or_doubtful_sensor(self, run: Run, state: str) -> None:
        run.bring_up()
        run.grip(5.0)
        getattr(self, state)(run)
        assert run.refusal("grip.set", force_n=6.0) == ("not_ready", "force_n")
        assert run.refusal("grip.adjust", delta_n=1.0) == ("not_ready", "delta_n")
        assert run.refusal("gripper.close", force_n=6.0) == ("not_ready", "force_n")
        assert run.refusal("grip.set", force_n=4.5) is None, "lowering needs no sensor"

    def test_G3_a_force_outside_the_gripper_range_is_refused(self, make_run: Callable[[str], Run], rig: str) -> None:
        run = make_run(rig.replace("[255, 28.5]", "[255, 20.0]").replace("= 25.0", "= 20.0"))
        run.up()
        run.bring_up()
        assert run.refusal("gripper.close", force_n=2.0) == ("out_of_range", "force_n")
        assert run.refusal("gripper.close", force_n=3.0) is None


class TestHold:
    def test_hold_of_a_held_object_sends_nothing(self, run: Run) -> None:
        run.bring_up()
        run.grip(5.0)
        assert run.ask("grip.hold")["result"] == {"force_n": pytest.approx(5.0)}
        run.serve_gripper(100)
        assert run.writes() == []

    def test_hold_right_after_a_force_command_does_not_stop_the_grip(self, run: Run) -> None:
        run.bring_up()
        run.grip(5.0)
        assert run.refusal("grip.set", force_n=6.0) is None
        assert run.ask("grip.hold")["result"] == {"force_n": pytest.approx(6.0)}
        run.serve_gripper(50)
        assert (run.gripper.command.go, run.gripper.command.force) == (True, 30)

    def test_hold_stops_moving_fingers_and_does_not_open_them(self, run: Run) -> None:
        run.bring_up()
        run.ask("gripper.close", force_n=5.0)
        run.gripper.found = 0
        run.serve_gripper(50)
        assert run.ask("grip.hold")["result"] == {"force_n": pytest.approx(5.0)}
        run.serve_gripper(50)
        assert (run.gripper.command.go, run.gripper.command.activate) == (False, True)

    def test_hold_of_an_inactive_gripper_is_refused(self, run: Run) -> None:
        run.serve_gripper(50)
        run.lease()
        assert run.refusal("grip.hold") == ("not_active", "")
