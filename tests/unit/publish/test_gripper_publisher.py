"""The gripper message: what is not known of the gripper is nil."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, cast

import pytest
from nanoseconds import MS, T0

from slipd.config import Config, device_options
from slipd.devices import DEVICES, GripperSession
from slipd.gripper.gripper_control import GripperControl
from slipd.publish.grasp_messages import gripper_body
from slipd.types.samples import GripperSample


@pytest.fixture
def control(left: str, gripper: str, parse: Callable[[str], Config]) -> GripperControl:
    config = parse(left + gripper).gripper
    assert config is not None
    make_session = DEVICES[config.device].session
    assert make_session is not None
    return GripperControl(config, cast("GripperSession", make_session(**device_options(config))), {})


REPORTED: dict[str, Any] = {"moving": False, "object": "none", "fault": "", "echo_ok": True}
AT_REST = {
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
    "lease": {"held": True, "expires_in_s": pytest.approx(0.15)},
    "reflex": None,
    "age_s": pytest.approx(0.05),
}


@pytest.mark.parametrize(
    ("measured", "published"),
    [
        ({}, {}),
        *(({"width_m": None, "current_a": 0.1, "force_n": 7.5},) * 2,),
        (
            {"width_m": math.nan, "current_a": math.inf, "force_n": math.nan},
            {"width_m": None, "current_a": None, "force_n": None},
        ),
    ],
)
def test_a_gripper_is_published_with_everything_that_it_reports_and_its_lease(
    control: GripperControl, measured: dict[str, float | None], published: dict[str, float | None]
) -> None:
    assert control.policy.lease.acquire(b"ann", 200, T0) is None
    control.update(GripperSample(T0, None, True, **({"width_m": 0.085} | measured), **REPORTED))
    assert gripper_body(control, T0 + 50 * MS) == AT_REST | published
    control.lose()
    known = {name for name, value in gripper_body(control, T0).items() if value is not None}
    assert known == {"force_limit_n", "latched_fault", "lease"}
