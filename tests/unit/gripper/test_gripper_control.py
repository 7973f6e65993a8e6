"""Requests in newtons and metres become gripper commands within the request, or a refusal with its reason."""

from __future__ import annotations

import math
from typing import Any

import pytest
from control_bench import MS, T0, Parse, Recorded, ask, close_, make, open_, reading, refused, took

from slipd.gripper.gripper_control import GripperControl
from slipd.gripper.intent import IntentKind
from slipd_client.messages import Health


def test_a_grip_closes_fully_and_returns_the_commanded_force(control: GripperControl, session: Recorded) -> None:
    assert took(close_(control, 10.3, None, None, T0))
    assert session.commands == [("move", 0.0, None, 10.3)]
    assert control.force_command_n == control.policy.force_n == 10.0


def test_widths_and_speeds_are_handed_on(control: GripperControl, session: Recorded) -> None:
    close_(control, 3.0, 0.04, 0.085, T0)
    open_(control, 0.085, 0.02, T0)
    open_(control, None, 0.15, T0)
    assert session.commands == [
        ("move", 0.04, 0.085, 3.0),
        ("move", 0.085, 0.02, 3.0),
        ("move", 0.085, 0.15, 3.0),
    ]
    assert control.policy.force_n is None, "what opens holds nothing"
    assert control.force_command_n == 3.0


def test_opening_takes_the_least_force_that_may_be_asked_for(
    left: str, gripper: str, parse: Parse, session: Recorded
) -> None:
    control = make(left + gripper + "min_force_n = 4.0\n", parse, session)
    open_(control, None, None, T0)
    assert session.commands == [("move", 0.085, None, 4.0)]


CLOSE_5 = {"force_n": 5.0}
FORCE_OUT = "out_of_range", "force_n"
LEAST, RANGE, NO_RANGE, NO_SPEED = (
    {"force_range_n": (50.0, 200.0)}, {"force_range_n": (2.0, 18.0)}, {"force_range_n": (0.0, math.inf)},
    {"speed_range_mps": None},
)  # fmt: skip


@pytest.mark.parametrize(
    ("has", "kind", "wanted", "refusal"),
    [
        *(({}, "open", {"width_m": m}, ("out_of_range", "width_m")) for m in (-0.001, 0.086, 1e300)),
        *(({}, "close", CLOSE_5 | {"width_m": m}, ("out_of_range", "width_m")) for m in (-0.001, 0.086, 1e300)),
        *(({}, "open", {"speed_mps": v}, ("out_of_range", "speed_mps")) for v in (-0.05, 0.0, 0.019, 0.151)),
        *(({}, "close", CLOSE_5 | {"speed_mps": v}, ("out_of_range", "speed_mps")) for v in (0.019, 0.151)),
        *(({}, "close", CLOSE_5 | {"speed_mps": v}, None) for v in (0.02, 0.15)),
        (NO_SPEED, "close", CLOSE_5 | {"speed_mps": 0.05}, ("out_of_range", "speed_mps")),
        (NO_SPEED, "close", CLOSE_5, None),
        (RANGE, "close", {"force_n": 18.1}, FORCE_OUT),
        (RANGE, "close", {"force_n": 1.9}, FORCE_OUT),
        (RANGE, "close", {"force_n": 18.0}, None),
        (NO_RANGE, "close", {"force_n": 25.1}, FORCE_OUT),
        (NO_RANGE, "close", {"force_n": 25.0}, None),  # what is not reported is not a limit
        (LEAST, "open", {}, ("out_of_range", "")),
        ({"force_range_n": (25.0, 200.0)}, "open", {}, None),
    ],
)
def test_G3_what_the_gripper_does_not_have_is_refused(
    control: GripperControl,
    session: Recorded,
    has: dict[str, Any],
    kind: IntentKind,
    wanted: dict[str, float],
    refusal: tuple[str, str] | None,
) -> None:
    for name, value in has.items():
        setattr(session, name, value)
    found = ask(control, kind, T0, **wanted)
    assert (None if took(found) else refused(found)) == refusal
    assert len(session.commands) == (refusal is None)


def test_a_force_whose_setting_would_fall_below_the_least_is_refused(
    left: str, gripper: str, parse: Parse, session: Recorded
) -> None:
    limited = make(left + gripper + "min_force_n = 3.2\n", parse, session)
    assert refused(close_(limited, 3.3, None, None, T0)) == ("out_of_range", "force_n"), "its setting would be 3 N"
    assert took(close_(limited, 3.5, None, None, T0))


def test_the_reflex_sets_a_force_where_the_gripper_takes_it(control: GripperControl, session: Recorded) -> None:
    assert took(close_(control, 5.0, None, None, T0))
    assert took(control.carry_out("reflex", T0, force_n=6.7))
    assert (control.force_command_n, control.policy.requested_n) == (6.5, 5.0)
    assert not took(control.carry_out("reflex", T0, force_n=26.0)), "beyond the limit"
    session.takes = False
    assert not took(control.carry_out("reflex", T0, force_n=7.0))
    assert control.force_command_n == 6.5


def test_a_gripper_of_unknown_width_range_opens_only_to_a_given_width(
    control: GripperControl, session: Recorded
) -> None:
    session.width_range_m = (0.0, math.inf)
    control.update(reading(0.04))
    assert refused(open_(control, None, None, T0)) == ("not_ready", "width_m")
    assert took(open_(control, 0.05, None, T0))
    assert took(close_(control, 5.0, None, None, T0))
    assert session.commands == [("move", 0.05, None, 3.0), ("move", 0.0, None, 5.0)]


def test_closing_never_opens(control: GripperControl, session: Recorded) -> None:
    """An object held at 42.5 mm would fall at 50 mm."""
    control.update(reading(0.0425))
    assert refused(close_(control, 5.0, 0.050, None, T0)) == ("out_of_range", "width_m")
    assert session.commands == []
    assert took(close_(control, 5.0, control.width_m, None, T0)), "the width that is told"
    assert took(close_(control, 5.0, 0.040, None, T0))


def test_closing_never_opens_fingers_that_have_moved_on_since_they_were_heard(
    control: GripperControl, session: Recorded
) -> None:
    """At 150 mm/s they are 3 mm further on after a poll."""
    assert took(close_(control, 5.0, 0.03, None, T0))
    assert refused(close_(control, 5.0, 0.05, None, T0 + MS)) == ("out_of_range", "width_m")
    control.update(reading(0.06, T0 + 20 * MS, moving=True))
    assert refused(close_(control, 5.0, 0.05, None, T0 + 21 * MS)) == ("out_of_range", "width_m")
    assert took(close_(control, 5.0, 0.02, None, T0 + 21 * MS))
    control.update(reading(0.03, T0 + 60 * MS))
    assert took(open_(control, 0.08, None, T0 + 60 * MS))
    assert refused(close_(control, 5.0, 0.05, None, T0 + 61 * MS)) == ("out_of_range", "width_m")
    control.update(reading(0.08, T0 + 80 * MS))
    assert took(close_(control, 5.0, 0.05, None, T0 + 81 * MS))


def test_a_grip_in_force_is_not_closed_to_less_than_it_was(control: GripperControl, session: Recorded) -> None:
    """At the present width nothing would press any more, and the gripper would say that it holds nothing."""
    close_(control, 5.0, 0.02, None, T0)
    control.update(reading(0.04, T0 + MS, object="contact_closing"))
    session.commands.clear()
    assert refused(close_(control, 5.0, 0.04, None, T0 + 2 * MS)) == ("out_of_range", "width_m")
    assert refused(close_(control, 5.0, 0.021, None, T0 + 2 * MS)) == ("out_of_range", "width_m")
    assert session.commands == []
    assert took(close_(control, 5.0, 0.02, None, T0 + 2 * MS))
    open_(control, 0.05, None, T0 + 3 * MS)
    control.update(reading(0.05, T0 + 4 * MS))
    assert took(close_(control, 5.0, 0.05, None, T0 + 5 * MS)), "that is another grasp"


def test_a_width_is_not_asked_for_where_the_present_one_is_not_known(control: GripperControl) -> None:
    control.update(reading(None))
    assert refused(close_(control, 5.0, 0.01, None, T0)) == ("not_ready", "width_m")
    assert took(close_(control, 5.0, None, None, T0))


def test_a_setting_force_changes_nothing_but_the_force(control: GripperControl, session: Recorded) -> None:
    close_(control, 11.0, None, None, T0)
    assert took(ask(control, "set", T0, force_n=12.34))
    assert control.force_command_n == 12.0
    assert session.commands[1:] == [("force", 12.34)]
    assert control.policy.force_n == 12.0


def test_a_command_that_the_session_does_not_take_is_refused(control: GripperControl, session: Recorded) -> None:
    close_(control, 6.0, None, None, T0)
    session.send()
    session.takes = False
    for found in (
        close_(control, 5.0, None, None, T0),
        open_(control, None, None, T0),
        ask(control, "set", T0, force_n=5.0),
        ask(control, "stop", T0),
        ask(control, "hold", T0),
    ):
        assert refused(found)[0] == "not_active"
    assert control.force_command_n == control.policy.force_n == 6.0


def test_a_gripper_is_refused_for_what_is_wrong_with_it(control: GripperControl) -> None:
    def why() -> tuple[str, str]:
        return refused(close_(control, 5.0, None, None, T0))

    control.update(reading(active=False))
    assert why() == ("fault_latched", ""), "it was active before"
    control.acknowledge()
    assert why() == ("not_active", "")
    control.update(reading(active=False, fault="over_temperature"))
    control.acknowledge()
    assert why() == ("gripper_fault", "")
    assert took(ask(control, "activate", T0)), "an activation may be what clears it"
    control.lose()
    assert why() == ("no_gripper", "")
    assert refused(ask(control, "activate", T0)) == ("no_gripper", "")


def test_without_a_limit_nothing_is_moved(left: str, gripper: str, parse: Parse, session: Recorded) -> None:
    control = make((left + gripper).replace("max_force_n", "# max_force_n"), parse, session)
    for found in (
        ask(control, "activate", T0),
        open_(control, None, None, T0),
        close_(control, 5.0, None, None, T0),
        ask(control, "set", T0, force_n=5.0),
        control.carry_out("reflex", T0, force_n=5.0),
    ):
        assert refused(found) == ("no_limit", "")
    assert control.policy.limits.max_n is None
    assert session.commands == []


def test_A6_a_lost_command_is_latched_once(control: GripperControl, session: Recorded) -> None:
    assert control.on_time(T0) is False
    session.command_lost = True
    assert control.on_time(T0 + MS) is True
    assert control.policy.fault == "command_lost"
    assert control.conditions()[0][0] is Health.ERROR
    assert control.on_time(T0 + 2 * MS) is False
    assert control.policy.fault == "command_lost"
    assert took(control.acknowledge())
    assert control.policy.fault == ""
    assert control.on_time(T0 + 2 * MS) is True, "that it is over is news too"
    assert control.on_time(T0 + 2 * MS) is False
    assert control.conditions() == []
    assert session.commands == [("acknowledge",)]


def test_silence_is_judged_by_the_daemons_own_time_awake(control: GripperControl, session: Recorded) -> None:
    close_(control, 10.0, None, None, T0)
    session.send()
    control.drop_after_pause(60_000 * MS)
    control.on_time(T0 + 60_000 * MS)
    assert control.policy.fault == "", "the daemon stood still, and what was said meanwhile waits to be read"
    for k in range(100):
        control.on_time(T0 + (60_000 + 5 * k) * MS)
    assert control.policy.fault == "no_answer"
    assert control.sample is None


def test_a_slow_gripper_may_be_silent_for_three_of_its_periods(
    left: str, gripper: str, parse: Parse, session: Recorded
) -> None:
    control = make(left + gripper.replace("rate_hz = 50.0", "rate_hz = 2.0"), parse, session)
    close_(control, 10.0, None, None, T0)
    session.send()
    for k in range(290):
        control.on_time(T0 + 5 * k * MS)
    assert control.policy.fault == ""
    for k in range(290, 330):
        control.on_time(T0 + 5 * k * MS)
    assert control.policy.fault == "no_answer"


def test_silence_of_a_gripper_that_holds_nothing_is_no_fault(control: GripperControl) -> None:
    for k in range(100):
        control.on_time(T0 + 5 * k * MS)
    assert (control.policy.fault, control.sample) == ("", None)
    assert refused(close_(control, 5.0, None, None, T0 + 500 * MS)) == ("no_gripper", "")
