"""The status message: clocks in seconds, the lateness of the daemon, and what is wrong at its own stream."""

from __future__ import annotations

import pytest
from arm_rig import ArmRun
from engine_rig import LEFT, RIGHT, Run
from run_courses import follow, gripper, play, serve, status, tick, wait, wrench


def test_status_has_the_clock_of_each_stream_the_lateness_and_a_latched_fault_at_the_gripper(run: Run) -> None:
    follow(run, [*[wrench(0.0, ms=5.0), tick] * 300, status(streams={"left.wrench": {"clock": "locked"}})])
    follow(run, [gripper(fault=8, stage=3), serve(50), wait(100), tick, status(late_s=pytest.approx(0.1))])
    streams = run.ask("status")["result"]["streams"]
    assert 0.0 < streams["left.wrench"]["clock_uncertainty_s"] < 0.01
    assert {name for name, each in streams.items() if "is latched" in each["message"]} == {"gripper"}


def test_status_has_the_drift_of_a_zero_and_whether_it_is_followed() -> None:
    run = play(LEFT.replace("stuck_after = 0", "stuck_after = 0\ndrift_tau_s = 1.0") + RIGHT)
    follow(run, [*[wrench(0.0, ms=5.0), tick] * 1000, status(streams={"left.wrench": {"drift_frozen": False}})])
    follow(run, [*[wrench(5.0, ms=5.0), tick] * 50, status(streams={"left.wrench": {"drift_frozen": True}})])
    assert len(run.ask("status")["result"]["streams"]["left.wrench"]["drift"]) == 6


def test_status_says_why_the_motion_of_the_arm_is_not_used() -> None:
    run = ArmRun()
    run.carry_for(200)
    said = {"health": 0, "clock": "host", "samples": 50, "message": "its gravity is checked for 1 s before it is used"}
    status(streams={"arm": said})(run)
