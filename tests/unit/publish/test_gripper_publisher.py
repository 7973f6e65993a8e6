"""The gripper message: what is not known of the gripper is nil."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import cast

import pytest

from slipd.config import Config, device_options
from slipd.devices import DEVICES, GripperSession
from slipd.gripper.gripper_control import GripperControl
from slipd.publish.grasp_messages import gripper_body
from slipd.types.samples import GripperSample

MS = 1_000_000
T0 = 100_000_000_000


def reading(width_m: float | None = 0.085, **measured: float) -> GripperSample:
    return GripperSample(T0, None, True, width_m, False, "none", "", True, **measured)


@pytest.fixture
def control(left: str, gripper: str, parse: Callable[[str], Config]) -> GripperControl:
    config = parse(left + gripper).gripper
    assert config is not None
    make_session = DEVICES[config.device].session
    assert make_session is not None
    return GripperControl(config, cast("GripperSession", make_session(**device_options(config))), {})


def test_a_gripper_at_rest_is_published_with_everything_that_it_reports(control: GripperControl) -> None:
    control.update(reading())
    assert gripper_body(control, T0 + 5 * MS) == {
        "width_m": 0.085,
        "force_command_n": None,
        "force_limit_n": 25.0,
        "active": True,
        "object": "none",
        "moving": False,
        "fault": "",
        "latched_fault": "",
        "echo_ok": True,
        "current_a": None,
        "force_n": None,
        "lease": {"held": False, "expires_in_s": None},
        "reflex": None,
        "age_s": pytest.approx(0.005),
    }


def test_of_a_lost_gripper_only_limit_fault_and_lease_are_known(control: GripperControl) -> None:
    control.update(reading())
    control.lose()
    body = gripper_body(control, T0)
    assert {name for name, value in body.items() if value is not None} == {"force_limit_n", "latched_fault", "lease"}


@pytest.mark.parametrize(
    ("width_m", "current_a", "force_n", "published"),
    [(None, 0.1, 7.5, (None, 0.1, 7.5)), (math.nan, math.inf, math.nan, (None, None, None))],
)
def test_what_a_gripper_measures_is_published_unless_it_is_not_finite(
    control: GripperControl,
    width_m: float | None,
    current_a: float,
    force_n: float,
    published: tuple[float | None, ...],
) -> None:
    control.update(reading(width_m, current_a=current_a, force_n=force_n))
    body = gripper_body(control, T0)
    assert (body["width_m"], body["current_a"], body["force_n"]) == published


def test_the_lease_is_published_with_the_time_until_it_ends(control: GripperControl) -> None:
    assert control.policy.lease.acquire(b"ann", 200, T0) is None
    assert gripper_body(control, T0 + 50 * MS)["lease"] == {"held": True, "expires_in_s": pytest.approx(0.15)}
