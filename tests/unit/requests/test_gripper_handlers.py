"""Only the lease holder moves the gripper, within every limit, and never on doubtful sensors; engine and real bytes."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from engine_rig import MOVES

MS = 1_000_000
FULL = np.full((4, 4), 100)
Run = Any


class TestGripper:
    @pytest.mark.parametrize("op", MOVES)
    def test_no_motion_without_the_lease(self, run: Run, op: str) -> None:
        run.bring_up()
        run.writes()
        assert run.refusal(op, client=b"ben", **MOVES[op]) == ("no_lease", "")
        run.ask("lease.release")
        assert run.refusal(op, **MOVES[op]) == ("no_lease", "")
        run.serve_gripper(100)
        assert run.writes() == []

    @pytest.mark.parametrize("op", [*MOVES, "fault.ack"])
    def test_a_rig_without_gripper_refuses_with_no_gripper(
        self, make_run: Callable[[str], Run], left: str, op: str
    ) -> None:
        run = make_run(left)
        run.up()
        assert run.refusal(op, **MOVES.get(op, {})) == ("no_gripper", "")

    @pytest.mark.parametrize("how", ["time", "sleep"])
    def test_a_rig_without_gripper_publishes_the_end_of_a_lease_at_once(
        self, make_run: Callable[[str], Run], left: str, how: str
    ) -> None:
        run = make_run(left + "[rates]\nstatus_hz = 0.001\n")
        run.up()
        run.tick()
        assert run.refusal("lease.acquire", ttl_ms=200) is None
        before = len(run.published("status"))
        run.wait(5)
        run.tick()
        assert run.published("status")[before:] == []
        run.wait(200 if how == "time" else 5)
        run.tick(0 if how == "time" else 1_000 * MS)
        assert [body["lease"]["held"] for body in run.published("status")[before:]] == [False]
        run.wait(5)
        run.tick(0 if how == "time" else 1_000 * MS)
        assert len(run.published("status")) == before + 1

    def test_open_without_a_gripper_is_refused_before_contact_is_judged(
        self, make_run: Callable[[str], Run], left: str
    ) -> None:
        run = make_run(left)
        run.up()
        assert run.refusal("gripper.open") == ("no_gripper", "")

    @pytest.mark.parametrize("op", MOVES)
    def test_no_motion_without_a_force_limit(
        self, make_run: Callable[[str], Run], left: str, gripper: str, op: str
    ) -> None:
        run = make_run(left + gripper.replace("max_force_n", "# max_force_n"))
        run.up()
        run.serve_gripper(50)
        assert run.refusal("lease.acquire", ttl_ms=200) is None
        assert run.refusal(op, **MOVES[op]) == ("no_limit", "")
        run.serve_gripper(100)
        assert run.writes() == []

    @pytest.mark.parametrize("op", sorted(set(MOVES) - {"gripper.activate"}))
    def test_no_motion_of_an_inactive_gripper(self, run: Run, op: str) -> None:
        run.ask("lease.acquire", ttl_ms=200)
        run.serve_gripper(50)
        assert run.refusal(op, **MOVES[op]) == ("not_active", "")
        run.serve_gripper(100)
        assert run.writes() == []

    def test_a_gripper_that_never_answered_is_not_activated(self, run: Run) -> None:
        run.ask("lease.acquire", ttl_ms=200)
        assert run.refusal("gripper.activate") == ("no_gripper", "")

    def test_no_motion_of_a_gripper_with_a_fault(self, run: Run) -> None:
        run.bring_up()
        run.gripper.fault = 8
        run.serve_gripper(50)
        assert run.published("gripper")[-1]["fault"] == "over_temperature"
        assert run.refusal("gripper.close", force_n=5.0) == ("fault_latched", "")
        assert run.ask("fault.ack")["result"] == {"fault": "over_temperature"}
        assert run.refusal("gripper.close", force_n=5.0) == ("gripper_fault", "")

    def test_no_motion_of_a_silent_gripper(self, run: Run) -> None:
        run.bring_up()
        run.gripper.silent = True
        run.serve_gripper(500)
        assert run.refusal("gripper.close", force_n=5.0) == ("no_gripper", "")
        assert run.refusal("gripper.stop") == ("no_gripper", "")

    def test_a_grip_is_closed_with_the_setting_below_the_requested_force(self, run: Run) -> None:
        run.bring_up()
        assert run.ask("gripper.close", force_n=10.05)["result"] == {"applied_n": pytest.approx(10.0)}
        run.serve_gripper(50)
        assert (run.gripper.command.position, run.gripper.command.force, run.gripper.command.go) == (255, 70, True)
        assert run.published("gripper")[-1]["force_command_n"] == pytest.approx(10.0)

    @pytest.mark.parametrize("force_n", [25.1, 2.9, -5.0, 0, 10**6, 1e308])
    @pytest.mark.parametrize("op", ["grip.set", "gripper.close"])
    def test_a_force_out_of_range_is_refused_and_not_clamped(self, run: Run, op: str, force_n: float) -> None:
        run.bring_up()
        run.writes()
        assert run.refusal(op, force_n=force_n) == ("out_of_range", "force_n")
        run.serve_gripper(50)
        assert run.writes() == []

    @pytest.mark.parametrize("force_n", [math.nan, math.inf])
    def test_a_force_that_is_not_finite_is_refused(self, run: Run, force_n: float) -> None:
        run.bring_up()
        run.writes()
        assert run.refusal("grip.set", force_n=force_n) == ("not_finite", "force_n")
        run.serve_gripper(50)
        assert run.writes() == []

    def test_stop_halts_the_gripper_and_keeps_it_active(self, run: Run) -> None:
        run.bring_up()
        run.ask("gripper.close", force_n=5.0)
        run.serve_gripper(50)
        assert run.ask("gripper.stop")["result"] == {}
        run.serve_gripper(50)
        assert run.gripper.command.go is False
        assert run.gripper.command.activate is True

    def test_open_is_allowed_while_every_finger_is_known_to_be_free(self, run: Run) -> None:
        run.bring_up()
        run.ask("gripper.close", force_n=5.0)
        run.serve_gripper(50)
        run.image(np.zeros((4, 4), dtype=int))
        run.wrench(0.0)
        run.skin(0.0)
        assert run.ask("gripper.open")["result"] == {"applied_n": pytest.approx(3.0)}
        run.serve_gripper(50)
        assert (run.gripper.command.position, run.gripper.command.go) == (0, True)

    def in_contact(self, run: Run) -> None:
        run.wrench(5.0)

    def silent(self, run: Run) -> None:
        run.wait(100)
        run.tick()

    def unplugged(self, run: Run) -> None:
        run.down("right.pad")

    def overloaded(self, run: Run) -> None:
        run.wrench(0.0, status=2)

    def untared(self, run: Run) -> None:
        run.ask("tare.undo", finger="left")

    def half_blind(self, run: Run) -> None:
        run.down("left.pad")

    @pytest.mark.parametrize("state", ["in_contact", "silent", "unplugged", "overloaded", "untared", "half_blind"])
    def test_open_is_refused_unless_fingers_are_known_to_be_free_or_drop_is_set(self, run: Run, state: str) -> None:
        """Unknown is not free."""
        run.bring_up()
        run.ask("gripper.close", force_n=5.0)
        run.serve_gripper(50)
        run.serve_gripper(50)  # the last image is old, so it shows nothing
        run.wrench(0.0)
        run.skin(0.0)
        getattr(self, state)(run)
        run.writes()
        refused = run.ask("gripper.open")["error"]
        assert (refused["code"], refused["field"]) == ("in_contact", "drop")
        assert ("right" if state == "unplugged" else "left") in refused["message"]
        assert run.refusal("gripper.activate") == ("in_contact", "drop")
        assert run.refusal("gripper.open", drop=False) == ("in_contact", "drop")
        run.serve_gripper(20)
        assert run.writes() == []
        assert run.refusal("gripper.open", drop=True) is None
        run.serve_gripper(50)
        assert run.gripper.command.position == 0

    def test_open_is_refused_on_readings_from_before_a_stall(self, run: Run) -> None:
        """No tick lies between: the readings are old, and it is not known yet whether newer ones wait."""
        run.bring_up()
        run.feel(0.0)
        run.wait(60)
        assert run.refusal("gripper.open") == ("in_contact", "drop")
        assert run.level("right") == ("no_contact", []), "the sensor is not silent: its line was not read"
        run.serve_gripper(20)
        run.feel(0.0)
        assert run.refusal("gripper.open") is None

    def test_close_never_widens(self, run: Run) -> None:
        run.bring_up()
        run.gripper.position = 128
        run.serve_gripper(50)
        run.writes()
        assert run.refusal("gripper.close", force_n=5.0, width_m=0.06) == ("out_of_range", "width_m")
        run.serve_gripper(50)
        assert run.writes() == []

    def test_nothing_moves_without_a_request(self, run: Run) -> None:
        """Readings, ticks, faults, losses and refusals write nothing to the gripper."""
        run.bring_up()
        run.ask("gripper.close", force_n=5.0)
        run.serve_gripper(50)
        run.writes()
        for k in range(60):
            run.wrench(10.0, (4.9, 0.0))
            run.image(FULL)
            run.skin(10.0, (4.0, 0.0))
            run.serve_gripper(5)
            if k == 20:
                run.down("left.wrench")
            if k == 30:
                run.up("left.wrench")
            if k == 40:
                run.tick(suspended_ns=10**12)
        assert run.writes() == []

    def test_pending_commands_are_not_sent_to_a_replugged_gripper(self, run: Run) -> None:
        run.bring_up()
        run.gripper.silent = True
        run.ask("gripper.close", force_n=5.0)
        run.down("gripper")
        run.gripper.silent = False
        run.writes()
        run.up("gripper")
        run.serve_gripper(200)
        assert run.writes() == []
        assert run.refusal("grip.set", force_n=5.0) == ("no_lease", "")

    @pytest.mark.parametrize("how", ["stall", "sleep"])
    def test_a_command_that_waited_for_a_poll_is_not_sent_after_a_stall(self, run: Run, how: str) -> None:
        run.bring_up()
        run.tick()
        run.feel(0.0)
        run.gripper.silent = True
        run.serve_gripper(20)
        run.feel(0.0)
        assert run.refusal("gripper.open") is None
        run.let_lease_be()
        run.gripper.silent = False
        if how == "stall":
            run.wait(10_000)
            run.wrench(0.0)
        else:
            run.wait(5)
            run.tick(suspended_ns=3600 * 10**9)
            body = run.published("gripper")[-1]
            assert (body["active"], body["width_m"], body["age_s"]) == (None, None, None)
        run.serve_gripper(500)
        assert run.writes() == []
        assert run.published("gripper")[-1]["latched_fault"] == "command_lost"
        assert run.published("gripper")[-1]["active"] is True
