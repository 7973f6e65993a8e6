"""The grasp is published as it changes; the reflex raises the grip before the warning is published."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from grasp_table import grasp_table

from slipd.events import Output, Publish, Write

MS = 1_000_000
GRASP = grasp_table()
REFLEX = """
[reflex]
enabled = true
raise_n_per_s = 100.0
ceiling_n = 9.0
"""
FAST = "step_n = 20.0\nraise_n_per_s = 1000.0\n"
NEAR = (2.25, 0.0)
"""Of a grip of 5 N and μ = 0.5: λ is 0.9."""

Make = Callable[[str], Any]


@pytest.fixture
def hold(rig: str, make_run: Make) -> Callable[..., Any]:
    """An engine whose gripper holds something with 5 N; ``more`` is config text."""

    def make(more: str, *, tare: bool = True) -> Any:
        run = make_run(rig + more)
        run.up()
        run.bring_up(tare=tare)
        run.image()
        run.grip(5.0)
        feel(run)
        return run

    return make


def feel(run: Any, *tangential: float, ms: float = 1.0) -> list[Output]:
    """Both fingers feel the grip; the left one feels a pull beside it."""
    run.image(np.full((4, 4), 100 + run.t_ns // MS % 7))
    run.skin(5.0, ms=ms)
    run.tick()
    out: list[Output] = run.wrench(5.0, tangential or (0.0, 0.0))
    return out


def acts(run: Any) -> list[dict[str, Any]]:
    return [body["reflex"] for body in run.published("gripper") if body["reflex"] is not None]


def test_a_warning_raises_the_grip_before_it_is_published(hold: Callable[..., Any]) -> None:
    run = hold(GRASP + REFLEX)
    out = feel(run, *NEAR)
    kinds = [output.link if isinstance(output, Write) else getattr(output, "topic", "") for output in out]
    assert kinds.index("gripper") < kinds.index("warning")
    assert isinstance(out[0], Write)
    assert run.published("warning")[-1]["level"] == "warning"
    (act,) = acts(run)
    assert (act["from_n"], act["reason"]) == (pytest.approx(5.0), "needed")
    assert act["force_n"] == pytest.approx(5.85), "4.5 N would hold it; the config wants 1.3 times as much"


def test_it_goes_on_to_what_is_needed_and_no_further_than_its_ceiling(hold: Callable[..., Any]) -> None:
    run = hold(FAST + GRASP + REFLEX)
    for _ in range(40):
        feel(run, 4.0, 0.0)
        run.serve_gripper(10)
    told = [act["force_n"] for act in acts(run)]
    assert told[:2] == pytest.approx([7.0, 9.0]), "100 N/s, a period of 20 ms each"
    assert max(told) <= 9.0
    assert run.published("gripper")[-1]["force_command_n"] <= 9.0


@pytest.mark.parametrize("more", ["", GRASP, GRASP + REFLEX.replace("true", "false")])
def test_without_the_switch_nothing_is_ever_moved(hold: Callable[..., Any], more: str) -> None:
    run = hold(more)
    for _ in range(10):
        out = feel(run, *NEAR)
        assert not [output for output in out if isinstance(output, Write) and output.link == "gripper"]
    assert acts(run) == []


def test_a_gripper_that_cannot_take_it_hears_nothing(hold: Callable[..., Any]) -> None:
    run = hold(GRASP + REFLEX)
    run.gripper.fault = 14
    run.serve_gripper(30)
    before = run.published("gripper")[-1]["latched_fault"]
    feel(run, *NEAR)
    assert before
    assert acts(run) == []


def test_a_session_that_takes_no_command_is_no_act(hold: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    run = hold(GRASP + REFLEX)
    session = run.engine._links["gripper"].session
    monkeypatch.setattr(session, "execute", lambda *_: False)
    feel(run, *NEAR)
    assert acts(run) == []


def test_A7_an_old_reading_of_the_other_finger_raises_nothing(hold: Callable[..., Any]) -> None:
    run = hold(GRASP + REFLEX)
    run.wait(60)  # the loop was held up: nothing told yet that the other finger fell silent
    run.image()
    run.wrench(5.0, NEAR)
    assert run.level("right")[0] == "stable"
    assert acts(run) == []


def test_a_command_behind_a_poll_is_delayed_and_not_lost(hold: Callable[..., Any]) -> None:
    run = hold(GRASP + REFLEX)
    out = feel(run, *NEAR)
    while not [output for output in out if isinstance(output, Write) and output.link == "gripper"]:
        run.serve_gripper(5)
        out = feel(run, *NEAR)
    assert acts(run)


def test_an_untrusted_finger_raises_nothing(hold: Callable[..., Any]) -> None:
    run = hold(GRASP + REFLEX)
    run.wait(60)
    run.tick()
    run.wrench(5.0, NEAR)
    assert acts(run) == [], "the other finger is stale"


def test_the_grasp_is_published_at_its_rate_and_at_each_change_of_level(hold: Callable[..., Any]) -> None:
    run = hold("[rates]\ngrasp_hz = 10.0\n" + GRASP)
    told = len(run.published("grasp"))
    for _ in range(20):
        feel(run, ms=4.0)
    assert 1 <= len(run.published("grasp")) - told <= 2, "100 ms at 10 Hz"
    feel(run, *NEAR)
    body = run.published("grasp")[-1]
    assert (body["level"], body["reasons"], body["frame"]) == ("warning", ["translation"], "gripper")
    assert body["width_m"] == pytest.approx(run.published("gripper")[-1]["width_m"])
    assert [one["seq"] for one in run.published("grasp")] == list(range(len(run.published("grasp"))))


def test_a_grasp_without_a_gripper_knows_no_width(rig: str, make_run: Make) -> None:
    run = make_run(rig.partition("[gripper]")[0] + GRASP)
    run.up()
    run.image()
    run.skin(5.0)
    run.wrench(5.0)
    body = run.published("grasp")[-1]
    assert body["width_m"] is None
    assert body["external_torque_nm"] is None


def test_a_tick_publishes_that_the_fingers_fell_silent(hold: Callable[..., Any]) -> None:
    run = hold(GRASP)
    run.wait(100)
    out = run.tick()
    (body,) = [output.body for output in out if isinstance(output, Publish) and output.topic == "grasp"]
    assert (body["level"], body["reasons"]) == ("unknown", ["stale"])
