"""The status message: clocks in seconds, the lateness of the daemon, and what is wrong at its own stream."""

from __future__ import annotations

import pytest
from arm_rig import ArmRun
from engine_rig import Run


def test_status_has_the_clock_of_each_stream_the_lateness_and_a_latched_fault_at_the_gripper(run: Run) -> None:
    for _ in range(300):
        run.wrench(0.0, ms=5.0)
        run.tick()
    stream = run.ask("status")["result"]["streams"]["left.wrench"]
    assert stream["clock"] == "locked"
    assert 0.0 < stream["clock_uncertainty_s"] < 0.01
    run.gripper.fault, run.gripper.stage = 8, 3
    run.serve_gripper(50)
    run.wait(100)
    run.tick()
    status = run.ask("status")["result"]
    assert status["late_s"] == pytest.approx(0.1)
    latched = {name for name, each in status["streams"].items() if "is latched" in each["message"]}
    assert latched == {"gripper"}


def test_status_says_why_the_motion_of_the_arm_is_not_used() -> None:
    run = ArmRun()
    run.carry_for(200)
    arm = run.stream()
    assert (arm["health"], arm["clock"], arm["samples"]) == (0, "host", 50)
    assert arm["message"] == "its gravity is checked for 1 s before it is used"
