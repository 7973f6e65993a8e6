"""Newtons and metres become commands that are within what was asked, or a reason why not."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from slipd.config import Config
from slipd.devices.robotiq_2f import Session
from slipd.grip.policy import Refusal
from slipd.pipeline.gripper import GripperControl
from slipd.samples import GripperSample

T0 = 100_000_000_000
Parse = Callable[[str], Config]


def reading(closure: float = 0.0, *, active: bool = True, fault: str = "", t_ns: int = T0) -> GripperSample:
    return GripperSample(t_ns, None, active, closure, False, "none", fault, True, 0.1)


class Recorded(Session):
    """A session that takes every command (or none) and keeps it."""

    def __init__(self, *, takes: bool = True) -> None:
        super().__init__()
        self.takes = takes
        self.commands: list[tuple[Any, ...]] = []

    def move(self, position: int, speed: int, force: int) -> bool:
        self.commands.append(("move", position, speed, force))
        return self.takes

    def set_force(self, force: int) -> bool:
        self.commands.append(("force", force))
        return self.takes

    def halt(self) -> bool:
        self.commands.append(("halt",))
        return self.takes


@pytest.fixture
def session() -> Recorded:
    return Recorded()


@pytest.fixture
def control(left: str, gripper: str, parse: Parse, session: Recorded) -> GripperControl:
    """0…255 is 3…28.5 N (0.1 N a step), 85…0 mm and 20…150 mm/s; at most 25 N."""
    return make(left + gripper, parse, session)


def make(text: str, parse: Parse, session: Session) -> GripperControl:
    config = parse(text).gripper
    assert config is not None
    control = GripperControl(config, session)
    control.take(reading())
    return control


def refused(found: object) -> tuple[str, str]:
    assert isinstance(found, Refusal)
    return found.code, found.field


def test_a_grip_closes_fully_with_the_force_below_what_was_asked(control: GripperControl, session: Recorded) -> None:
    assert control.close(10.0, None, None) == {"applied_n": pytest.approx(10.0)}
    assert control.close(10.09, None, None) == {"applied_n": pytest.approx(10.0)}
    assert session.commands == [("move", 255, 128, 70)] * 2
    assert control.body(T0)["force_command_n"] == pytest.approx(10.0)


def test_widths_and_speeds_are_those_of_the_tables(control: GripperControl, session: Recorded) -> None:
    control.close(3.0, 0.0425, 0.085)
    control.open(0.085, 0.02)
    control.open(None, 0.15)
    assert session.commands == [("move", 128, 128, 0), ("move", 0, 0, 0), ("move", 0, 255, 0)]


def test_tables_may_have_any_number_of_points(left: str, gripper: str, parse: Parse, session: Recorded) -> None:
    text = gripper.replace("[255, 0.15]", "[200, 0.1], [255, 0.2]").replace("[0.0, 0.085]", "[0.0, 0.085], [0.2, 0.08]")
    control = make(left + text, parse, session)
    assert isinstance(control.open(0.082, 0.15), dict)
    assert isinstance(control.close(5.0, 0.02, 0.12), dict)
    assert [command[:3] for command in session.commands] == [("move", 31, 228), ("move", 204, 211)]


@pytest.mark.parametrize("width_m", [-0.001, 0.086, 1e300])
def test_a_width_that_the_gripper_does_not_have_is_refused(
    control: GripperControl, session: Recorded, width_m: float
) -> None:
    assert refused(control.open(width_m, None)) == ("out_of_range", "width_m")
    assert refused(control.close(5.0, width_m, None)) == ("out_of_range", "width_m")
    assert session.commands == []


@pytest.mark.parametrize("speed_mps", [-0.05, 0.0, 0.019, 0.151])
def test_a_speed_that_the_gripper_does_not_have_is_refused(
    control: GripperControl, session: Recorded, speed_mps: float
) -> None:
    assert refused(control.open(None, speed_mps)) == ("out_of_range", "speed_mps")
    assert refused(control.close(5.0, None, speed_mps)) == ("out_of_range", "speed_mps")
    assert session.commands == []


def test_without_a_speed_table_no_speed_may_be_asked(left: str, gripper: str, parse: Parse, session: Recorded) -> None:
    control = make((left + gripper).replace("speed_table", "# speed_table"), parse, session)
    assert refused(control.close(5.0, None, 0.05)) == ("out_of_range", "speed_mps")
    assert control.close(5.0, None, None) == {"applied_n": pytest.approx(5.0)}


def test_closing_never_opens(control: GripperControl, session: Recorded) -> None:
    """An object held at 42.5 mm would fall at 50 mm."""
    control.take(reading(closure=0.5))
    assert refused(control.close(5.0, 0.050, None)) == ("out_of_range", "width_m")
    assert session.commands == []
    width_m = control.body(T0)["width_m"]
    assert width_m == pytest.approx(0.0425)
    assert isinstance(control.close(5.0, width_m, None), dict), "the width that is told may be asked for"
    assert isinstance(control.close(5.0, 0.040, None), dict)


def test_a_setting_force_changes_nothing_but_the_force(control: GripperControl, session: Recorded) -> None:
    assert control.set_force(12.34) == {"applied_n": pytest.approx(12.3)}
    assert session.commands == [("force", 93)]


def test_a_command_that_the_session_does_not_take_is_refused(left: str, gripper: str, parse: Parse) -> None:
    control = make(left + gripper, parse, Recorded(takes=False))
    for found in (control.close(5.0, None, None), control.open(None, None), control.set_force(5.0), control.halt()):
        assert refused(found)[0] == "not_active"
    assert control.body(T0)["force_command_n"] is None


def test_a_gripper_is_refused_for_what_is_wrong_with_it(control: GripperControl, session: Recorded) -> None:
    assert control.refuse() is None
    control.take(reading(active=False))
    assert refused(control.refuse()) == ("not_active", "")
    control.take(reading(fault="over_temperature"))
    assert refused(control.refuse()) == ("gripper_fault", "")
    control.lose()
    assert refused(control.refuse()) == ("no_gripper", "")
    assert refused(control.may_activate()) == ("no_gripper", "")


def test_a_gripper_that_no_longer_answers_is_none(control: GripperControl, session: Recorded) -> None:
    session.state = "no reply"
    assert refused(control.may_activate()) == ("no_gripper", "")
    assert refused(control.refuse()) == ("no_gripper", "")


def test_without_a_limit_nothing_is_moved(left: str, gripper: str, parse: Parse, session: Recorded) -> None:
    control = make((left + gripper).replace("max_force_n", "# max_force_n"), parse, session)
    assert refused(control.may_activate()) == ("no_limit", "")
    assert refused(control.refuse()) == ("no_limit", "")
    assert control.body(T0)["force_limit_n"] is None


def test_a_gripper_that_is_not_there_is_told_as_unknown(control: GripperControl) -> None:
    assert control.body(T0 + 5_000_000) == {
        "width_m": 0.085,
        "force_command_n": None,
        "force_limit_n": 25.0,
        "active": True,
        "object": "none",
        "moving": False,
        "fault": "",
        "echo_ok": True,
        "current_a": 0.1,
        "age_s": pytest.approx(0.005),
    }
    control.lose()
    body = control.body(T0)
    assert {name for name, value in body.items() if value is not None} == {"force_limit_n"}


def test_a_lost_gripper_has_no_lease(control: GripperControl) -> None:
    control.policy.acquire(b"ann", 1000, T0)
    control.lose()
    assert control.policy.holder(T0) is None


def test_a_gripper_that_lost_its_activation_has_no_force_command(control: GripperControl) -> None:
    control.close(10.0, None, None)
    control.take(reading(active=False))
    assert control.body(T0)["force_command_n"] is None
