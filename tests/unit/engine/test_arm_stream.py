"""The stream of the arm's motion in the engine: it is a stream like any other, and a rig without one is as before."""

from __future__ import annotations

from arm_rig import ARM, RIG, ArmRun

from slipd_client.messages import Health


def test_D6_without_its_stream_the_weight_is_unknown_again() -> None:
    run = ArmRun()
    run.carry_for(1100)
    run.wrench(0.0)
    assert run.stream("left.wrench")["gravity"] == "compensated"
    run.wait(21)
    run.tick()
    assert run.stream()["health"] == Health.STALE
    weight = run.stream("left.wrench")
    assert weight["gravity"] == "unknown_orientation"
    assert "an arm stream ([grasp.arm]) removes it" in weight["message"]
    run.carry()
    assert run.stream("left.wrench")["gravity"] == "compensated"


def test_a_rig_without_an_arm_has_no_such_stream() -> None:
    run = ArmRun(RIG.replace(ARM, ""))
    assert "arm" not in run.engine.links
    run.wrench(0.0)
    assert run.stream("left.wrench")["gravity"] == "unknown_orientation"
