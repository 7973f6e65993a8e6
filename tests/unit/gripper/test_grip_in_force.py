"""The grip in force: how it begins, what restores it, and what ends it."""

from __future__ import annotations

import math
from typing import Any, ClassVar

import pytest
from control_bench import MS, T0, Pad, Parse, Recorded, ask, close_, make, open_, reading, refused, took

from slipd.grasp.stored_state import StoredGrip
from slipd.gripper.gripper_control import GripperControl


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
    assert control.command == (5.0, 0.0)
    control.update(reading(0.0, T0 + 4 * MS, object="none"))
    assert control.policy.force_n is None
    assert control.command == (5.0, None)


def test_a_lost_gripper_has_no_lease(control: GripperControl) -> None:
    control.policy.lease.acquire(b"ann", 200, T0)
    control.lose()
    assert control.policy.lease.holder(T0) is None


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
    ask(control, "set", T0, force_n=6.0)
    assert (control.policy.force_n, control.policy.fault) == (6.0, "")
    assert control.command == (6.0, 0.0), "the goal stays"
    control.drop_after_pause(51 * MS)
    assert control.policy.fault == "command_lost"
    assert (
        control.policy.force_n == control.policy.requested_n == control.force_command_n == session.force_sent_n == 5.0
    )


def test_a_first_grip_that_was_dropped_leaves_no_force(control: GripperControl, session: Recorded) -> None:
    close_(control, 5.0, None, None, T0)
    control.drop_after_pause(60 * MS)
    assert control.policy.fault == "command_lost"
    assert control.policy.force_n is control.policy.requested_n is control.force_command_n is None


def test_a_sleep_of_the_host_drops_what_waited_and_ends_what_was_known(
    left: str, gripper: str, parse: Parse, session: Recorded
) -> None:
    control = make(left + gripper + 'lease_end = "stop"\n', parse, session)
    control.policy.lease.acquire(b"ann", 200, T0)
    control.on_time(T0)
    close_(control, 5.0, None, None, T0)
    session.send()
    open_(control, None, None, T0)
    control.wake()
    assert (control.policy.fault, control.policy.force_n, control.sample) == ("command_lost", 5.0, None)
    assert control.on_time(T0 + MS) is True
    assert control.policy.lease.holder(T0 + MS) is None
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
        control.policy.lease.acquire(b"ann", 200, T0 + 2 * MS)
        control.on_time(T0 + 203 * MS)
    assert session.commands == [("move", 0.0, None, 5.0), ("force", 6.0)]


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
        assert refused(close_(control, 3.0, None, None, T0 + MS)) == ("not_ready", "")
        assert took(ask(control, "open", T0 + MS, drop=True))
        assert took(ask(control, "stop", T0 + MS))
        assert control.policy.unknown, "it was never sent"
        control.update(reading(0.04, T0 + 2 * MS, **self.HOLDING))
        assert control.policy.unknown
        assert control.force_command_n is None

    @pytest.mark.parametrize(
        ("now", "force_n"),
        [
            ({"force_n": None}, 6.0),
            ({"force_n": 6.4}, 6.0),
            ({"force_n": 8.0}, 8.0),
            ({"object": "contact_opening"}, None),
            ({"moving": True}, None),
            ({"width_m": None}, None),
            ({"width_m": 0.05}, None),
        ],
    )
    def test_that_was_kept_goes_on_where_the_gripper_confirms_it(
        self, left: str, gripper: str, parse: Parse, session: Recorded, now: dict[str, Any], force_n: float | None
    ) -> None:
        kept = StoredGrip(
            force_n=6.0, requested_n=5.0, raised_n=1.0, reflexed_n=2.0, closed_to_m=0.0, width_m=0.04,
            object="contact_closing", reported_n=None,
        )  # fmt: skip
        control = self.control(left, gripper, parse, session, Pad(None))
        assert control.conditions() == []
        confirmed: list[bool] = []
        control.restore(kept, lambda: confirmed.append(True))
        assert control.kept() == kept
        seen = {"width_m": 0.04, **self.HOLDING} | now
        control.update(reading(seen.pop("width_m"), T0, **seen))
        policy = control.policy
        assert policy.force_n == force_n
        assert (policy.raised_n, policy.reflexed_n) == ((1.0, 2.0) if force_n == 6.0 else (0.0, 0.0))
        assert len(control.conditions()) == (force_n is None)
        assert confirmed == [True] * (force_n == 6.0)

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


def test_a_reading_of_the_moment_of_a_command_does_not_end_its_motion(control: GripperControl) -> None:
    close_(control, 10.0, None, None, T0)
    control.update(reading(0.03, T0, object="contact_closing"))
    assert not control.holds
    control.update(reading(0.03, T0 + 1, object="contact_closing"))
    assert control.holds
