"""Clearly negative normal force: unknown, never "no contact". Through the engine with real bytes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from slipd_client.messages import Health

NOT_READY = ("not_ready", "finger")

DROP = ("in_contact", "drop")

Run = Any

Make = Callable[..., Run]


def health(run: Run, stream: str = "left.wrench") -> tuple[int, str]:
    reported = run.ask("status")["result"]["streams"][stream]
    return reported["health"], reported["message"]


@pytest.mark.parametrize("normal_n", [-25.0, -71_768.0])
def test_pulled_pad_is_unknown_and_neither_tared_nor_opened_and_status_says_what_to_check(
    run: Run, normal_n: float
) -> None:
    run.bring_up()
    run.feel(0.0)
    assert run.refusal("gripper.open") is None
    run.serve_gripper(50)
    for _ in range(3):
        run.feel(0.0)
    run.wrench(normal_n)
    assert run.level() == ("unknown", ["pulled"])
    assert run.published("slip.left")[-1]["normal_n"] == pytest.approx(normal_n, rel=1e-6)
    assert run.published("warning")[-1]["previous"] == "no_contact"
    level, message = health(run)
    assert level == Health.ERROR
    for word in ("sign", "pad_from_sensor", "quat_xyzw", "x, y, z, w", "the sensor's own configuration"):
        assert word in message
    refused = [run.refusal("tare", finger="left"), run.refusal("gripper.open"), run.refusal("gripper.activate")]
    assert refused == [NOT_READY, DROP, DROP]
    assert run.refusal("gripper.open", drop=True) is None
    run.wrench(0.0)
    assert run.level() == ("no_contact", [])
    assert "pulls" not in health(run)[1]


def test_no_grip_is_raised_on_a_pulled_pad(run: Run) -> None:
    run.bring_up()
    run.grip(5.0)
    run.feel(5.0)
    run.wrench(-5.0)
    assert run.refusal("grip.adjust", delta_n=1.0) == ("not_ready", "delta_n")
    run.feel(5.0)
    assert run.refusal("grip.adjust", delta_n=1.0) is None


def test_pull_ends_a_tare_in_progress_and_the_pad_that_shows_a_contact_forbids_one(run: Run) -> None:
    run.bring_up()
    assert run.refusal("tare", finger="left", seconds=0.1) is None
    run.wrench(-25.0)
    reported = run.ask("tare.get", finger="left")["result"]
    assert (reported["tare_id"], reported["busy"], reported["given_up_reason"]) == (1, False, "pulled")
    assert reported["given_up"] == "the normal force became negative, as if the pad were pulled"
    run.image()
    run.wrench(-25.0)
    assert run.refusal("tare", finger="left", unloaded=True) == ("in_contact", "finger")
    assert "the pad image shows a contact, so the force sensor is wrong" in health(run)[1]


def test_unloaded_true_tares_a_negative_bias(make_run: Make, rig: str) -> None:
    run = make_run(rig, zeros=False)
    run.up()
    run.wrench(-25.0)
    run.tick()
    assert run.level() == ("unknown", ["pulled"])
    assert "tare it with unloaded = true" in health(run)[1]
    assert run.refusal("tare", finger="left", seconds=0.01) == NOT_READY
    assert run.refusal("tare", finger="left", seconds=0.01, unloaded="yes") == ("bad_type", "unloaded")
    assert run.ask("tare", finger="left", seconds=0.01, unloaded=True)["result"]["verified"] is False
    for _ in range(20):
        run.wrench(-25.0)
    assert run.ask("tare.get", finger="left")["result"]["tare_id"] == 1
    assert run.level() == ("no_contact", [])


@pytest.mark.parametrize(
    ("more", "least_n"),
    [
        ("", 0.5 + 1.0),
        ("drift_limit_n = 0.2", 0.5 + 0.2),
        ("force_std_n = 0.1", 0.5 + 1.0 + 4 * 0.1),
        ("mass_kg = 0.1", 0.5 + 1.0 + 0.1 * 2 * 9.80665),
    ],
)
def test_limit_follows_from_noise_weight_drift_bias_and_min_normal_n(
    make_run: Make, left: str, more: str, least_n: float
) -> None:
    text = left.replace("force_std_n = 0.0\n", "") if "force_std_n" in more else left
    run = make_run(text.replace("stuck_after = 0", f"stuck_after = 0\n{more}"), zeros=False)
    run.up()
    run.wrench(-9.0)
    assert run.level()[1] != ["pulled"], "before its tare a sensor reads its own bias"
    run.ask("tare", finger="left", seconds=0.01)
    for _ in range(20):
        run.wrench(0.0)
    assert run.ask("tare.get", finger="left")["result"]["tare_id"] == 1
    for normal_n, pulled in ((0.01 - least_n, False), (-0.01 - least_n, True)):
        run.wrench(normal_n, ms=5.0)
        assert (run.level()[1] == ["pulled"]) is pulled


def test_taxels_pressed_during_a_pull_are_not_masked_as_hot(run: Run) -> None:
    """The force sensor has the wrong sign: its pull presses the pad, first lightly and then hard."""
    run.bring_up()
    rng = np.random.default_rng(2)
    for k in range(400):
        normal_n = min(0.005 * k, 8.0) if k < 100 else 8.0 + np.sin(0.1 * k)
        run.wait(7)
        run.tick()
        run.wrench(-normal_n, ms=2.0)
        run.image(np.rint(10.0 * normal_n + rng.normal(size=(4, 4))).astype(int))
    reported = run.ask("status")["result"]["streams"]["left.pad"]
    assert reported["masked"] == []
    assert run.level() == ("unknown", ["pulled"])
    assert run.refusal("tare", finger="left") == ("in_contact", "finger"), "the pad shows the contact"


def test_three_axis_pad_with_wrong_sign_is_pulled(make_run: Make, right: str) -> None:
    """Its axis_scale has the wrong sign."""
    run = make_run(right.replace("-0.001", "0.001"))
    run.up()
    for _ in range(3):
        run.skin(5.0)
    assert run.level("right") == ("unknown", ["pulled"])
    assert run.refusal("tare", finger="right") == NOT_READY
    level, message = health(run, "right.pad")
    assert (level, "axis_scale" in message) == (Health.ERROR, True)


def test_raw_counts_below_zero_may_be_tared(make_run: Make, right: str) -> None:
    run = make_run(right.replace("-0.001", "0.001").partition("tare = ")[0], zeros=False)
    run.up()
    for _ in range(3):
        run.skin(1.0)
    assert run.level("right") == ("unknown", ["not_tared"])
    assert run.refusal("tare", finger="right", seconds=0.05) is None
    for _ in range(10):
        run.skin(1.0)
    assert run.level("right") == ("no_contact", [])
