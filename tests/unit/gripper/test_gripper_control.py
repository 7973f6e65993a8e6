"""Requests in newtons and metres become gripper commands within the request, or a refusal with its reason."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar

import pytest

from slipd.config import Config
from slipd.devices.shared.decoder_health import DecoderHealth
from slipd.gripper.gripper_control import GripperControl
from slipd.gripper.intent import IntentKind
from slipd.permit import Permit
from slipd.refusal import Refusal
from slipd.samples import GripperSample
from slipd_client.messages import Health

MS = 1_000_000
T0 = 100_000_000_000
Parse = Callable[[str], Config]


def reading(width_m: float | None = 0.085, t_ns: int = T0, **changes: Any) -> GripperSample:
    usual = {"active": True, "moving": False, "object": "none", "fault": "", "echo_ok": True}
    return GripperSample(t_ns, None, width_m=width_m, **(usual | changes))


class Recorded:
    """A gripper that sets half newtons and whole millimetres, takes every command (or none) and keeps it."""

    identity, state = "", "running"

    def __init__(self) -> None:
        self.health = DecoderHealth()
        self.takes = True
        self.command_lost = self.activating = False
        self.commands: list[tuple[Any, ...]] = []
        self.width_range_m = (0.0, 0.085)
        self.speed_range_mps: tuple[float, float] | None = (0.02, 0.15)
        self.force_range_n = (3.0, 28.5)
        self.force_sent_n: float | None = None
        self.has: float | None = None  # of that, what was sent

    def start(self, now_ns: int) -> bytes:
        return b""

    def receive(self, data: bytes, now_ns: int) -> list[GripperSample]:
        return []

    def next_deadline(self) -> int | None:
        return None

    def on_time(self, now_ns: int) -> bytes:
        return b""

    def stop(self) -> bytes:
        return b""

    def applied_n(self, force_n: float) -> float:
        return math.floor(2.0 * force_n) / 2.0

    def execute(self, permit: Permit, now_ns: int) -> bool:
        if permit.kind == "activate":
            self.commands.append(("activate",))
            return True
        if permit.kind == "halt":
            self.commands.append(("halt",))
            self.drop()
            return self.takes
        assert permit.force_n is not None
        if permit.width_m is None:
            self.commands.append(("force", permit.force_n))
        else:
            self.commands.append(("move", round(permit.width_m, 3), permit.speed_mps, permit.force_n))
        if self.takes:
            self.force_sent_n = self.applied_n(permit.force_n)
        return self.takes

    def send(self) -> None:
        """What waits is sent."""
        self.has = self.force_sent_n

    def drop(self) -> bool:
        dropped, self.force_sent_n = self.force_sent_n != self.has, self.has
        return dropped

    def acknowledge(self) -> None:
        self.commands.append(("acknowledge",))


@pytest.fixture
def session() -> Recorded:
    return Recorded()


@pytest.fixture
def control(left: str, gripper: str, parse: Parse, session: Recorded) -> GripperControl:
    return make(left + gripper, parse, session)


def make(text: str, parse: Parse, session: Recorded, **fingers: Any) -> GripperControl:
    config = parse(text).gripper
    assert config is not None
    control = GripperControl(config, session, fingers)
    control.update(reading())
    return control


def ask(control: GripperControl, kind: IntentKind, t_ns: int, **wanted: Any) -> Refusal | None:
    """A request of who holds the lease, or of somebody who has it just for this."""
    holder = control.policy.holder(t_ns)
    control.policy.acquire(holder or b"ann", 200, t_ns)
    found = control.carry_out(kind, t_ns, holder or b"ann", **wanted)
    if holder is None:
        control.policy.release(b"ann", t_ns)
    return found


def close_(
    control: GripperControl, force_n: float, width_m: float | None, speed_mps: float | None, t_ns: int
) -> Refusal | None:
    return ask(control, "close", t_ns, force_n=force_n, width_m=width_m, speed_mps=speed_mps)


def open_(control: GripperControl, width_m: float | None, speed_mps: float | None, t_ns: int) -> Refusal | None:
    return ask(control, "open", t_ns, width_m=width_m, speed_mps=speed_mps)


def took(found: Refusal | None) -> bool:
    return found is None


def refused(found: object) -> tuple[str, str]:
    assert isinstance(found, Refusal)
    return found.code, found.field


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


def test_a_gripper_whose_least_force_is_above_the_limit_is_not_opened(
    control: GripperControl, session: Recorded
) -> None:
    session.force_range_n = (50.0, 200.0)
    assert refused(open_(control, None, None, T0)) == ("out_of_range", "")
    assert session.commands == []
    session.force_range_n = (25.0, 200.0)
    assert took(open_(control, None, None, T0))


@pytest.mark.parametrize("width_m", [-0.001, 0.086, 1e300])
def test_G3_a_width_that_the_gripper_does_not_have_is_refused(
    control: GripperControl, session: Recorded, width_m: float
) -> None:
    assert refused(open_(control, width_m, None, T0)) == ("out_of_range", "width_m")
    assert refused(close_(control, 5.0, width_m, None, T0)) == ("out_of_range", "width_m")
    assert session.commands == []


@pytest.mark.parametrize("speed_mps", [-0.05, 0.0, 0.019, 0.151])
def test_a_speed_that_the_gripper_does_not_have_is_refused(
    control: GripperControl, session: Recorded, speed_mps: float
) -> None:
    assert refused(open_(control, None, speed_mps, T0)) == ("out_of_range", "speed_mps")
    assert refused(close_(control, 5.0, None, speed_mps, T0)) == ("out_of_range", "speed_mps")
    assert session.commands == []


def test_a_gripper_without_speeds_is_commanded_without_one(control: GripperControl, session: Recorded) -> None:
    session.speed_range_mps = None
    assert refused(close_(control, 5.0, None, 0.05, T0)) == ("out_of_range", "speed_mps")
    assert took(close_(control, 5.0, None, None, T0))
    assert control.force_command_n == 5.0


def test_G3_a_force_is_within_the_config_and_within_the_gripper(control: GripperControl, session: Recorded) -> None:
    session.force_range_n = (2.0, 18.0)
    assert refused(close_(control, 18.1, None, None, T0)) == ("out_of_range", "force_n")
    assert refused(close_(control, 1.9, None, None, T0)) == ("out_of_range", "force_n")
    assert took(close_(control, 18.0, None, None, T0))
    open_(control, None, None, T0)
    control.update(reading(t_ns=T0 + MS))
    session.force_range_n = (0.0, math.inf)
    assert refused(close_(control, 25.1, None, None, T0 + MS)) == ("out_of_range", "force_n")
    assert took(close_(control, 25.0, None, None, T0 + MS)), "what is not reported is not a limit"


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


class Pad:
    """A finger that feels what it is told to feel."""

    def __init__(self, pressed: bool | None = False, force_n: float | None = None, *, feels: bool = True) -> None:
        self._pressed, self._force_n, self._feels = pressed, force_n, feels

    def press(self, pressed: bool | None, force_n: float | None = None) -> None:
        self._pressed, self._force_n = pressed, force_n

    def is_pressed(self) -> bool | None:
        return self._pressed

    def contact_force_n(self, _: int) -> float | None:
        return self._force_n if self._pressed else None

    def is_trusted_for_raise(self, _: int) -> bool:
        return self._feels

    def is_trusted_at_rest(self, _: int) -> bool:
        return self._feels


def test_a_grasp_does_not_end_on_the_word_of_the_gripper_while_a_finger_presses(
    left: str, gripper: str, parse: Parse, session: Recorded
) -> None:
    pad = Pad()
    control = make(left + gripper, parse, session, left=pad)
    close_(control, 5.0, None, None, T0)
    control.update(reading(0.04, T0 + MS, object="contact_closing"))
    pad.press(True, 5.0)
    control.update(reading(0.04, T0 + 2 * MS, object="none"))
    assert control.policy.force_n == 5.0
    pad.press(False)
    control.update(reading(0.02, T0 + 3 * MS, object="moving"))
    assert control.policy.force_n == 5.0
    control.update(reading(0.0, T0 + 4 * MS, object="none"))
    assert control.policy.force_n is None


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


def test_a_lost_gripper_has_no_lease(control: GripperControl) -> None:
    control.policy.acquire(b"ann", 200, T0)
    control.lose()
    assert control.policy.holder(T0) is None


def test_the_force_of_a_grip_is_known_beyond_a_lost_link(control: GripperControl) -> None:
    """What the gripper holds it goes on holding: the next change is a change of that force."""
    close_(control, 10.0, None, None, T0)
    control.lose()
    assert control.policy.fault == "link_lost"
    control.update(reading(0.03, T0 + 5000 * MS, object="contact_closing"))
    assert control.policy.force_n == 10.0


def test_what_happened_to_a_grip_is_not_acknowledged_before_the_gripper_is_heard(
    control: GripperControl, session: Recorded
) -> None:
    close_(control, 10.0, None, None, T0)
    control.lose()
    assert refused(control.acknowledge()) == ("not_ready", "")
    assert (control.policy.fault, session.commands[-1][0]) == ("link_lost", "move")
    control.update(reading(0.03, T0 + 5000 * MS, object="contact_closing"))
    assert control.policy.fault == "link_lost"
    assert took(control.acknowledge())
    assert control.policy.fault == ""


def test_what_happened_without_a_grip_may_be_acknowledged_at_any_time(control: GripperControl) -> None:
    control.policy.latch("echo_mismatch")
    control.lose()
    assert control.policy.fault == "echo_mismatch"
    assert took(control.acknowledge())
    assert control.policy.fault == ""


def test_a_gripper_that_lost_its_activation_has_no_force_command(control: GripperControl) -> None:
    close_(control, 10.0, None, None, T0)
    control.update(reading(active=False))
    assert control.force_command_n is control.policy.force_n is None
    assert control.policy.fault == "activation_lost"


def test_an_activation_ends_the_grasp(control: GripperControl, session: Recorded) -> None:
    close_(control, 10.0, None, None, T0)
    assert took(ask(control, "activate", T0))
    assert control.policy.force_n is None
    control.update(reading(active=False, fault="activation_needed"))
    assert control.policy.fault == ""


def test_a_reading_from_before_the_command_does_not_end_the_grasp(control: GripperControl) -> None:
    open_(control, None, None, T0 - 2 * MS)
    control.update(reading(0.03, T0 - MS, object="contact_closing"))
    close_(control, 10.0, None, None, T0)
    control.update(reading(0.03, T0, object="none"))
    assert control.policy.force_n == 10.0
    control.update(reading(0.03, T0 + MS, object="none"))
    assert control.policy.force_n == 10.0, "it was not held yet"
    control.update(reading(0.03, T0 + 2 * MS, object="contact_closing"))
    control.update(reading(0.02, T0 + 3 * MS, object="none"))
    assert control.policy.force_n is None


def test_what_waited_while_the_daemon_stood_still_is_dropped_and_latched(
    control: GripperControl, session: Recorded
) -> None:
    close_(control, 5.0, None, None, T0)
    session.send()
    control.on_time(T0)
    ask(control, "set", T0, force_n=6.0)
    control.drop_after_stall(T0 + 50 * MS)
    assert (control.policy.force_n, control.policy.fault) == (6.0, "")
    control.drop_after_stall(T0 + 101 * MS)
    assert control.policy.fault == "command_lost"
    assert (
        control.policy.force_n == control.policy.requested_n == control.force_command_n == session.force_sent_n == 5.0
    )


def test_a_first_grip_that_was_dropped_leaves_no_force(control: GripperControl, session: Recorded) -> None:
    control.on_time(T0)
    close_(control, 5.0, None, None, T0)
    control.on_time(T0 + 60 * MS)
    assert control.policy.fault == "command_lost"
    assert control.policy.force_n is control.policy.requested_n is control.force_command_n is None


def test_a_sleep_of_the_host_drops_what_waited_and_ends_what_was_known(
    left: str, gripper: str, parse: Parse, session: Recorded
) -> None:
    control = make(left + gripper + 'lease_end = "stop"\n', parse, session)
    control.policy.acquire(b"ann", 200, T0)
    control.on_time(T0)
    close_(control, 5.0, None, None, T0)
    session.send()
    open_(control, None, None, T0)
    control.wake()
    assert (control.policy.fault, control.policy.force_n, control.sample) == ("command_lost", 5.0, None)
    assert control.on_time(T0 + MS) is True
    assert control.policy.holder(T0 + MS) is None
    assert session.commands[-1] == ("halt",), "they may still be closing"


@pytest.mark.parametrize("change", ["force", "open"])
def test_a_stop_puts_back_the_force_that_it_kept_from_the_gripper(
    control: GripperControl, session: Recorded, change: str
) -> None:
    close_(control, 5.0, None, None, T0)
    session.send()
    if change == "force":
        ask(control, "set", T0, force_n=6.0)
    else:
        open_(control, None, None, T0)
    assert took(ask(control, "stop", T0))
    assert control.policy.force_n == control.policy.requested_n == control.force_command_n == 5.0
    session.send()
    ask(control, "stop", T0)
    assert control.policy.force_n == 5.0
    open_(control, None, None, T0)
    session.send()
    ask(control, "stop", T0)
    assert control.policy.force_n is None, "that was sent"


def test_a_force_sent_before_the_link_was_lost_is_restored_too(control: GripperControl, session: Recorded) -> None:
    close_(control, 5.0, None, None, T0)
    control.lose()
    session.force_sent_n = None
    session.send()
    control.update(reading(0.03, T0 + 5000 * MS, object="contact_closing"))
    control.acknowledge()
    ask(control, "set", T0 + 5000 * MS, force_n=6.0)
    ask(control, "set", T0 + 5000 * MS, force_n=6.5)
    ask(control, "stop", T0)
    assert control.policy.force_n == control.force_command_n == 5.0


@pytest.mark.parametrize("request_behind", ["hold", "lease_end"])
def test_a_force_alone_is_no_motion_that_would_be_stopped(
    left: str, gripper: str, parse: Parse, session: Recorded, request_behind: str
) -> None:
    control = make(left + gripper + 'lease_end = "stop"\n', parse, session)
    close_(control, 5.0, None, None, T0)
    control.update(reading(0.03, T0 + MS, object="contact_closing"))
    ask(control, "set", T0 + 2 * MS, force_n=6.0)
    if request_behind == "hold":
        assert took(ask(control, "hold", T0))
        assert control.policy.force_n == 6.0
    else:
        control.policy.acquire(b"ann", 200, T0 + 2 * MS)
        control.on_time(T0 + 203 * MS)
    assert session.commands == [("move", 0.0, None, 5.0), ("force", 6.0)]


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
    control.on_time(T0)
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


class TestAGripThatNoCommandBegan:
    HOLDING: ClassVar = {"object": "contact_closing"}

    def control(self, left: str, gripper: str, parse: Parse, session: Recorded, *pads: Pad) -> GripperControl:
        config = parse(left + gripper).gripper
        assert config is not None
        return GripperControl(config, session, dict(enumerate(pads)))  # type: ignore[arg-type]

    def test_counts_with_the_force_that_the_gripper_reports(
        self, left: str, gripper: str, parse: Parse, session: Recorded
    ) -> None:
        control = self.control(left, gripper, parse, session, Pad(True, 9.0))
        control.update(reading(0.04, T0, force_n=6.0, **self.HOLDING))
        assert control.policy.force_n == control.policy.requested_n == 6.0
        control.update(reading(0.04, T0 + MS, force_n=6.5, **self.HOLDING))
        assert control.policy.force_n == 6.5, "it is followed until the first command"
        assert refused(close_(control, 25.0, None, None, T0 + MS)) == ("out_of_range", "force_n")
        assert refused(close_(control, 6.5, 0.03, None, T0 + MS)) == ("not_ready", "width_m")
        assert took(close_(control, 8.0, None, None, T0 + MS))
        control.update(reading(0.04, T0 + 2 * MS, force_n=6.6, **self.HOLDING))
        assert control.policy.force_n == 8.0

    @pytest.mark.parametrize("reported_n", [None, 0.0, -1.0, math.nan])
    def test_counts_with_the_larger_force_that_is_felt_where_the_gripper_reports_none(
        self, left: str, gripper: str, parse: Parse, session: Recorded, reported_n: float | None
    ) -> None:
        control = self.control(left, gripper, parse, session, Pad(True, 5.0), Pad(True, 6.0), Pad(False))
        control.update(reading(0.04, T0, force_n=reported_n))
        assert control.policy.force_n == 6.0, "whatever the gripper says of an object"

    def test_is_over_when_neither_gripper_nor_finger_reports_it_any_more(
        self, left: str, gripper: str, parse: Parse, session: Recorded
    ) -> None:
        pad = Pad(True, 6.0)
        control = self.control(left, gripper, parse, session, pad)
        control.update(reading(0.04, T0))
        pad.press(False)
        control.update(reading(0.04, T0 + MS))
        assert not control.policy.grips
        assert took(close_(control, 25.0, None, None, T0 + MS))

    def test_of_unknown_force_is_still_a_grip(self, left: str, gripper: str, parse: Parse, session: Recorded) -> None:
        control = self.control(left, gripper, parse, session, Pad(None))
        control.update(reading(0.04, T0, **self.HOLDING))
        assert (control.policy.force_n, control.policy.unknown) == (None, True)
        control.lose()
        assert control.policy.fault == "link_lost"
        assert refused(control.acknowledge()) == ("not_ready", "")
        control.update(reading(0.04, T0 + MS, **self.HOLDING))
        control.acknowledge()
        assert refused(close_(control, 5.0, None, None, T0 + MS)) == ("not_ready", "force_n")
        assert took(close_(control, 3.0, None, None, T0 + MS))
        assert took(ask(control, "stop", T0 + MS))
        assert control.policy.unknown, "it was never sent"
        control.update(reading(0.04, T0 + 2 * MS, **self.HOLDING))
        assert control.policy.unknown
        assert control.force_command_n is None

    def test_may_have_begun_while_the_gripper_was_out_of_sight(
        self, control: GripperControl, session: Recorded
    ) -> None:
        open_(control, None, None, T0)
        session.send()
        control.update(reading(0.085, T0 + MS))
        control.lose()
        session.force_sent_n = session.has = None
        control.update(reading(0.04, T0 + 2 * MS, force_n=6.0, **self.HOLDING))
        assert control.policy.force_n == 6.0

    def test_goes_on_where_its_object_was_lost_and_came_back(self, control: GripperControl, session: Recorded) -> None:
        close_(control, 6.0, None, None, T0)
        session.send()
        control.update(reading(0.04, T0 + MS, **self.HOLDING))
        for _ in range(5):
            ask(control, "set", T0, force_n=8.0)
            ask(control, "set", T0, force_n=6.0)
        control.update(reading(0.03, T0 + 2 * MS))
        assert not control.policy.grips
        control.update(reading(0.04, T0 + 3 * MS, force_n=1.0, **self.HOLDING))
        assert control.policy.force_n == session.force_sent_n

    def test_is_let_go_of_before_an_activation(self, left: str, gripper: str, parse: Parse, session: Recorded) -> None:
        """A driver may call its gripper active all the while: until it is seen to let go, a close is a step."""
        control = self.control(left, gripper, parse, session)
        control.update(reading(0.04, T0, force_n=6.0, **self.HOLDING))
        assert took(ask(control, "activate", T0))
        control.update(reading(0.04, T0 + MS, force_n=6.0, **self.HOLDING))
        assert control.policy.force_n is None
        assert refused(close_(control, 25.0, None, None, T0 + MS)) == ("out_of_range", "force_n")
        control.update(reading(0.085, T0 + 2 * MS))
        assert took(close_(control, 25.0, None, None, T0 + 2 * MS))


def test_what_was_opened_is_let_go_once_that_is_seen(control: GripperControl, session: Recorded) -> None:
    close_(control, 6.0, None, None, T0)
    session.send()
    control.update(reading(0.04, T0 + MS, object="contact_closing"))
    open_(control, None, None, T0 + 2 * MS)
    assert control.policy.force_n is None
    assert refused(close_(control, 12.0, None, None, T0 + 2 * MS)) == ("out_of_range", "force_n")
    control.update(reading(0.04, T0 + 3 * MS, object="contact_closing"))
    assert refused(close_(control, 12.0, None, None, T0 + 3 * MS)) == ("out_of_range", "force_n")
    assert refused(ask(control, "set", T0 + 3 * MS, force_n=4.0)) == ("not_ready", "")
    control.update(reading(0.05, T0 + 4 * MS, object="moving", moving=True))
    assert took(close_(control, 12.0, None, None, T0 + 4 * MS))
