"""A fault that is latched refuses every motion until it is acknowledged; engine and real bytes."""

from __future__ import annotations

from typing import Any

import pytest
from engine_rig import MOVES

Run = Any


class TestLatchedFaults:
    def latched(self, run: Run) -> str:
        fault_now = run.published("gripper")[-1]["latched_fault"]
        status = run.ask("status")["result"]
        assert status["gripper"]["latched_fault"] == fault_now
        assert ("is latched" in status["streams"]["gripper"]["message"]) == bool(fault_now)
        return str(fault_now)

    def test_the_first_fault_blocks_every_motion_until_it_is_acknowledged(self, run: Run) -> None:
        run.bring_up()
        run.grip(5.0)
        run.gripper.fault = 8
        run.serve_gripper(50)
        run.gripper.fault = 10
        run.serve_gripper(50)
        run.gripper.fault = 0
        run.serve_gripper(50)
        assert self.latched(run) == "over_temperature"
        run.feel(5.0)
        run.writes()
        for op in sorted(set(MOVES) - {"gripper.stop", "grip.hold"}):
            assert run.refusal(op, **MOVES[op]) == ("fault_latched", "")
        run.serve_gripper(50)
        assert run.writes() == []
        assert run.refusal("grip.hold") is None
        assert run.refusal("gripper.stop") is None
        run.serve_gripper(50)
        assert len(run.writes()) == 1
        assert run.refusal("fault.ack", client=b"ben") == ("no_lease", "")
        assert run.ask("fault.ack")["result"] == {"fault": "over_temperature"}
        assert run.ask("fault.ack")["result"] == {"fault": None}
        run.serve_gripper(50)
        assert self.latched(run) == ""
        assert run.refusal("grip.adjust", delta_n=-0.5) is None

    @pytest.mark.parametrize("fault", [5, 7, *range(8, 16)])
    def test_D4_every_fault_of_the_gripper_blocks(self, run: Run, fault: int) -> None:
        run.bring_up()
        run.gripper.fault = fault
        run.serve_gripper(50)
        assert self.latched(run) == run.published("gripper")[-1]["fault"] != ""
        assert run.refusal("gripper.close", force_n=5.0) == ("fault_latched", "")

    def test_D4_reports_during_an_activation_are_no_fault(self, run: Run) -> None:
        run.bring_up()
        assert run.refusal("gripper.activate", drop=True) is None
        run.gripper.activates = True
        run.gripper.fault = 5
        run.serve_gripper(100)
        assert self.latched(run) == ""
        run.gripper.activates, run.gripper.stage, run.gripper.fault = False, 3, 0
        run.serve_gripper(50)
        assert self.latched(run) == ""
        assert run.refusal("gripper.close", force_n=5.0) is None

    def test_D4_a_lost_activation_is_latched(self, run: Run) -> None:
        run.bring_up()
        run.grip(5.0)
        run.serve_gripper(1000)
        run.gripper.stage = 0
        run.serve_gripper(50)
        assert self.latched(run) == "activation_lost"
        assert run.published("gripper")[-1]["force_command_n"] is None

    def test_D5_an_echo_that_differs_is_latched_within_three_readings(self, run: Run) -> None:
        run.bring_up()
        run.grip(5.0)
        before = len(run.published("gripper"))
        run.gripper.echo = 7
        run.serve_gripper(200)
        latched = [body["latched_fault"] for body in run.published("gripper")[before:]]
        assert latched[:3] == ["", "", "echo_mismatch"]
        run.ask("fault.ack")
        run.serve_gripper(100)
        assert self.latched(run) == "echo_mismatch", "it is still there"

    def test_A6_an_unanswered_command_is_latched_and_published_at_once(self, run: Run) -> None:
        run.bring_up()
        run.grip(5.0)
        run.gripper.silent = True
        assert run.refusal("grip.adjust", delta_n=0.5) is None
        for _ in range(200):
            run.serve_gripper(5)
            if run.published("gripper")[-1]["latched_fault"]:
                break
        assert run.published("gripper")[-1]["latched_fault"] == "command_lost"
        assert run.published("status")[-1]["gripper"]["latched_fault"] == "command_lost"
        run.gripper.silent = False
        run.serve_gripper(100)
        assert run.ask("fault.ack")["result"] == {"fault": "command_lost"}
        run.serve_gripper(50)
        assert run.refusal("grip.set", force_n=5.0) is None, (
            "a command that was lost does not stand in the way of the next"
        )

    def test_silence_of_a_holding_gripper_is_latched(self, run: Run) -> None:
        run.bring_up()
        run.grip(5.0)
        run.gripper.silent = True
        run.serve_gripper(400)
        assert self.latched(run) == "no_answer"

    def test_a_link_lost_during_a_grip_is_latched(self, run: Run) -> None:
        run.bring_up()
        run.down("gripper")
        assert self.latched(run) == "", "it holds nothing"
        run.up("gripper")
        run.lease()
        run.serve_gripper(100)
        run.grip(5.0)
        run.down("gripper")
        assert self.latched(run) == "link_lost"
        assert run.published("gripper")[-1]["active"] is None
