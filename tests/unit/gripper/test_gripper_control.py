"""Requests become gripper commands or a refusal, and the grip in force is what the gripper was sent and reports."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest
from gripper_bench import (
    Bench,
    Pad,
    Refused,
    Step,
    acknowledge,
    be,
    close,
    has,
    held,
    leased,
    lose,
    on_time,
    paused,
    press,
    seen,
    send,
    wake,
    want,
)

from slipd.gripper.intent import IntentKind
from slipd.gripper.stored_state import StoredGrip
from slipd_client.messages import Health

NOT_READY, FORCE_OUT, WIDTH_OUT = ("not_ready", ""), ("out_of_range", "force_n"), ("out_of_range", "width_m")
FORCED: tuple[IntentKind, ...] = ("activate", "open", "close", "set", "reflex")
KEPT = StoredGrip(
    force_n=5.0, requested_n=5.0, raised_n=0.0, reflexed_n=0.0, closed_to_m=0.0, width_m=0.04, object="contact_closing",
    reported_n=None,
)  # fmt: skip
Course = tuple[Bench, list[Step]]
COURSES: dict[str, Callable[[], Course]] = {
    # commands
    "a close goes all the way with the force that was asked for, and its setting is in force": lambda: (
        Bench(), [close(10.3), be(commands=[("move", 0.0, None, 10.3)], force_n=10.0, command_n=10.0)],
    ),
    "widths and speeds are handed on, and what opens holds nothing": lambda: (
        Bench(),
        [
            close(3.0, width_m=0.04, speed_mps=0.085), want("open", width_m=0.085, speed_mps=0.02),
            want("open", speed_mps=0.15), be(force_n=None, command_n=3.0),
            be(commands=[("move", 0.04, 0.085, 3.0), ("move", 0.085, 0.02, 3.0), ("move", 0.085, 0.15, 3.0)]),
        ],
    ),
    "opening takes the least force of the config": lambda: (
        Bench("min_force_n = 4.0\n"), [want("open"), be(commands=[("move", 0.085, None, 4.0)])],
    ),
    "without a limit nothing is moved": lambda: (
        Bench(max_force_n=""), [want(kind, 0, ("no_limit", ""), force_n=5.0) for kind in FORCED] + [be(commands=[])],
    ),
    "a force alone is set without motion": lambda: (
        Bench(),
        [close(11.0), want("set", force_n=12.34), be(command_n=12.0, force_n=12.0),
         be(commands=[("move", 0.0, None, 11.0), ("force", 12.34)])],
    ),
    "the reflex sets a force within the limits where the gripper takes it": lambda: (
        Bench(),
        [close(5.0), want("reflex", force_n=6.7), be(command_n=6.5, requested_n=5.0),
         want("reflex", 0, ("out_of_range", ""), force_n=26.0), has(takes=False),
         want("reflex", 0, ("not_active", ""), force_n=7.0), be(command_n=6.5)],
    ),
    "a setting below the least force is refused": lambda: (
        Bench("min_force_n = 3.2\n"), [close(3.3, 0, FORCE_OUT), close(3.5)],
    ),
    "a gripper of unknown widths opens to a given width only": lambda: (
        Bench(),
        [has(width_range_m=(0.0, math.inf)), seen(0), want("open", 0, ("not_ready", "width_m")),
         want("open", width_m=0.05), close(5.0),
         be(commands=[("move", 0.05, None, 3.0), ("move", 0.0, None, 5.0)])],
    ),
    "fingers may have moved on since they were heard": lambda: (
        Bench(),
        [close(5.0, width_m=0.03), close(5.0, 1, WIDTH_OUT, width_m=0.05), seen(20, 0.06, moving=True),
         close(5.0, 21, WIDTH_OUT, width_m=0.05), close(5.0, 21, width_m=0.02), seen(60, 0.03),
         want("open", 60, width_m=0.08), close(5.0, 61, WIDTH_OUT, width_m=0.05), seen(80, 0.08),
         close(5.0, 81, width_m=0.05)],
    ),
    "a grip is not closed to less than it was": lambda: (
        Bench(),
        [close(5.0, width_m=0.02), held(1), close(5.0, 2, WIDTH_OUT, width_m=0.04),
         close(5.0, 2, WIDTH_OUT, width_m=0.021), close(5.0, 2, width_m=0.02), want("open", 3, width_m=0.05),
         seen(4, 0.05), close(5.0, 5, width_m=0.05)],
    ),
    "what the session does not take is refused and changes nothing": lambda: (
        Bench(),
        [close(6.0), send, has(takes=False), close(5.0, 0, ("not_active", "")), want("open", 0, ("not_active", "")),
         want("set", 0, ("not_active", ""), force_n=5.0), want("stop", 0, ("not_active", "")),
         want("hold", 0, ("not_active", "")), be(command_n=6.0, force_n=6.0)],
    ),
    "what is wrong with the gripper is named": lambda: (
        Bench(),
        [seen(0, active=False), close(5.0, 0, ("fault_latched", "")), acknowledge(), close(5.0, 0, ("not_active", "")),
         seen(0, active=False, fault="over_temperature"), acknowledge(), close(5.0, 0, ("gripper_fault", "")),
         want("activate"), lose, close(5.0, 0, ("no_gripper", "")), want("activate", 0, ("no_gripper", ""))],
    ),
    # faults
    "A6 a lost command is latched once, and that it is over is news too": lambda: (
        Bench(),
        [on_time(0, False), has(command_lost=True), on_time(1, True), be(fault="command_lost"),
         be(conditions=[Health.ERROR]), on_time(2, False), be(fault="command_lost"), acknowledge(), be(fault=""),
         on_time(2, True), on_time(2, False), be(conditions=[], commands=[("acknowledge",)])],
    ),
    "D5 the third wrong echo in a row is a fault, and the grip is kept for the next run": lambda: (
        Bench(),
        [close(5.0), held(1, echo_ok=False), held(2), held(3, echo_ok=False), held(4, echo_ok=False), be(fault=""),
         held(5, echo_ok=False), be(fault="echo_mismatch", kept=KEPT)],
    ),
    "D5 fingers that ignore a motion are judged once a reading must show it": lambda: (
        Bench(rate_hz="rate_hz = 1.0"),
        [close(5.0), seen(3000, 0.085), be(fault=""), close(5.0, 3000), seen(6001, 0.085), be(fault="motion_ignored")],
    ),
    **{
        f"D5 fingers that stay where they were 1 s after a motion {what}": lambda steps=steps, fault=fault: (  # type: ignore[misc]
            Bench(), [has(speed_range_mps=(1e-4, 0.15)), *steps, be(fault=fault)],
        )
        for what, steps, fault in (
            ("have ignored it", [close(5.0, speed_mps=2e-3), seen(1001, 0.085)], "motion_ignored"),
            ("may need a little longer", [close(5.0, speed_mps=2e-3), seen(1000, 0.085)], ""),
            ("may be slow", [close(5.0, speed_mps=9e-4), seen(1001, 0.085)], ""),
            ("may be slow of their own", [close(5.0), seen(1001, 0.085)], ""),
            ("may be shown as before", [close(5.0, speed_mps=2e-3), send, paused(1000), seen(1001, 0.085)], ""),
        )
    },
    "silence is judged by the time in which the daemon was awake": lambda: (
        Bench(),
        [close(10.0), send, paused(60_000), on_time(60_000), be(fault=""),
         *(on_time(60_000 + 5 * k) for k in range(70)), be(fault=""),
         *(on_time(60_000 + 5 * k) for k in range(70, 75)), be(fault="no_answer", sample=None)],
    ),
    "a slow gripper may be silent for three of its periods": lambda: (
        Bench(rate_hz="rate_hz = 2.0"),
        [close(10.0), send, *(on_time(5 * k) for k in range(290)), be(fault=""),
         *(on_time(5 * k) for k in range(290, 330)), be(fault="no_answer")],
    ),
    "silence of a gripper that holds nothing is no fault": lambda: (
        Bench(),
        [*(on_time(5 * k) for k in range(100)), be(fault="", sample=None), close(5.0, 500, ("no_gripper", ""))],
    ),
    # the grip in force ends
    "a finger that is pressed keeps the grasp, whatever the gripper says": lambda: (
        Bench("", Pad()),
        [close(5.0), held(1), press(True, 5.0), seen(2), be(force_n=5.0), press(False), seen(3, 0.02, "moving"),
         be(force_n=5.0, command=(5.0, 0.0)), seen(4, 0.0), be(force_n=None, command=(5.0, None))],
    ),
    "a lost gripper has no lease, but goes on holding": lambda: (
        Bench(),
        [leased, close(10.0), lose, be(holder=None, fault="link_lost"), acknowledge(NOT_READY), be(fault="link_lost"),
         be(commands=[("move", 0.0, None, 10.0)]), held(5000, 0.03), be(force_n=10.0, fault="link_lost"),
         acknowledge(), be(fault="")],
    ),
    "what happened without a grip may be acknowledged at any time": lambda: (
        Bench(),
        [lambda bench: bench.control.policy.latch("echo_mismatch"), lose, be(fault="echo_mismatch"), acknowledge(),
         be(fault="")],
    ),
    "a lost activation has no force": lambda: (
        Bench(), [close(10.0), seen(0, active=False), be(command_n=None, force_n=None, fault="activation_lost")],
    ),
    "an activation ends the grasp and what is reported meanwhile is no fault": lambda: (
        Bench(),
        [close(10.0), want("activate"), be(force_n=None), seen(0, active=False, fault="activation_needed"),
         seen(1, active=False), seen(2, active=False, fault="activation_needed"), be(fault="")],
    ),
    "a reading of before the command ends no grasp, nor one before it was held": lambda: (
        Bench(),
        [want("open", -2), held(-1, 0.03), close(10.0), seen(0, 0.03), be(force_n=10.0), seen(1, 0.03),
         be(force_n=10.0), held(2, 0.03), seen(3, 0.02), be(force_n=None)],
    ),
    "a reading of the moment of a command does not end its motion": lambda: (
        Bench(), [close(10.0), held(0, 0.03), be(holds=False), held(1e-6, 0.03), be(holds=True)],
    ),
    "what was opened is let go once that is seen": lambda: (
        Bench(),
        [close(6.0), send, held(1), want("open", 2), be(force_n=None), close(12.0, 2, FORCE_OUT), held(3),
         close(12.0, 3, FORCE_OUT), want("set", 3, NOT_READY, force_n=4.0), seen(4, 0.05, "moving", moving=True),
         close(12.0, 4)],
    ),
    # commands that were never sent
    "what waited while the daemon stood still is dropped and latched": lambda: (
        Bench(),
        [close(5.0), send, want("set", force_n=6.0), be(force_n=6.0, fault="", command=(6.0, 0.0)), paused(51),
         be(fault="command_lost", force_n=5.0, requested_n=5.0, command_n=5.0, sent_n=5.0)],
    ),
    "a first grip that was dropped leaves no force": lambda: (
        Bench(), [close(5.0), paused(60), be(fault="command_lost", force_n=None, requested_n=None, command_n=None)],
    ),
    "a sleep drops what waited, ends the lease, and stops what may be closing": lambda: (
        Bench('lease_end = "stop"\n'),
        [leased, on_time(0), close(5.0), send, want("open"), wake, be(fault="command_lost", force_n=5.0, sample=None),
         on_time(1, True), be(holder=None),
         be(commands=[("move", 0.0, None, 5.0), ("move", 0.085, None, 3.0), ("halt",)])],
    ),
    **{
        f"a stop restores the force where {step} was not sent": lambda kept=kept: (  # type: ignore[misc]
            Bench(),
            [close(5.0), send, kept, want("stop"), be(force_n=5.0, requested_n=5.0, command_n=5.0), send, want("stop"),
             be(force_n=5.0), want("open"), send, want("stop"), be(force_n=None)],
        )
        for step, kept in (("a force", want("set", force_n=6.0)), ("an opening", want("open")))
    },
    "a force of before the link was lost is restored too": lambda: (
        Bench(),
        [close(5.0), lose, has(force_sent_n=None), send, held(5000, 0.03), acknowledge(),
         want("set", 5000, force_n=6.0), want("set", 5000, force_n=6.5), want("stop"), be(force_n=5.0, command_n=5.0)],
    ),
    **{
        f"a force alone is no motion that {what} would stop": lambda steps=steps: (  # type: ignore[misc]
            Bench('lease_end = "stop"\n'),
            [close(5.0), held(1, 0.03), want("set", 2, force_n=6.0), *steps,
             be(force_n=6.0, commands=[("move", 0.0, None, 5.0), ("force", 6.0)])],
        )
        for what, steps in (("a hold", [want("hold")]), ("the end of a lease", [leased, on_time(203)]))
    },
    # a grip that no command of this run began
    "a grip that is found has the force that the gripper reports, until the first command": lambda: (
        Bench("", Pad(True, 9.0), heard=False),
        [held(0, force_n=6.0), be(force_n=6.0, requested_n=6.0), held(1, force_n=6.5), be(force_n=6.5),
         close(25.0, 1, FORCE_OUT), close(6.5, 1, ("not_ready", "width_m"), width_m=0.03), close(8.0, 1),
         held(2, force_n=6.6), be(force_n=8.0)],
    ),
    **{
        f"a grip that is found has the larger force that is felt, where the gripper reports {n}": lambda n=n: (  # type: ignore[misc]
            Bench("", Pad(True, 5.0), Pad(True, 6.0), Pad(False), heard=False), [seen(0, force_n=n), be(force_n=6.0)],
        )
        for n in (None, 0.0, -1.0, math.nan)
    },
    "a grip that is found is over when nobody reports it any more": lambda: (
        Bench("", Pad(True, 6.0), heard=False), [seen(0), press(False), seen(1), be(grips=False), close(25.0, 1)],
    ),
    "a grip that is found has no command where the first one was never sent": lambda: (
        Bench("", Pad(True, 9.0), heard=False),
        [held(0, force_n=6.0), want("set", force_n=7.0), want("stop"), be(force_n=6.0, command_n=None)],
    ),
    "a grip of unknown force is still a grip": lambda: (
        Bench("", Pad(None), heard=False),
        [held(0), be(force_n=None, unknown=True), lose, be(fault="link_lost"), acknowledge(NOT_READY), held(1),
         acknowledge(), close(3.0, 1, NOT_READY), want("open", 1, drop=True), want("stop", 1), be(unknown=True),
         held(2), be(unknown=True, command_n=None, conditions=[Health.ERROR])],
    ),
    "a grip may have begun while the gripper was out of sight": lambda: (
        Bench(),
        [want("open"), send, seen(1, 0.085), lose, has(force_sent_n=None, has=None), held(2, force_n=6.0),
         be(force_n=6.0)],
    ),
    "a grip goes on where its object was lost and came back": lambda: (
        Bench(),
        [close(6.0), send, held(1), *[want("set", 0, ..., force_n=n) for n in (8.0, 6.0) * 5], seen(2, 0.03),
         be(grips=False), held(3, force_n=1.0),
         lambda bench: be(force_n=bench.session.force_sent_n)(bench)],
    ),
    "a grip is let go of before an activation, and until that is seen a close is a step": lambda: (
        Bench(heard=False),
        [held(0, force_n=6.0), want("activate"), held(1, force_n=6.0), be(force_n=None), close(25.0, 1, FORCE_OUT),
         seen(2, 0.085), close(25.0, 2)],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", COURSES)
def test_A6_a_gripper_is_sent_what_is_permitted_and_its_grip_is_followed(name: str) -> None:
    bench, steps = COURSES[name]()
    for step in steps:
        step(bench)


CLOSE_5 = {"force_n": 5.0}
LEAST, RANGE, NO_RANGE, NO_SPEED = (
    {"force_range_n": (50.0, 200.0)}, {"force_range_n": (2.0, 18.0)}, {"force_range_n": (0.0, math.inf)},
    {"speed_range_mps": None},
)  # fmt: skip


@pytest.mark.parametrize(
    ("session", "kind", "wanted", "refusal"),
    [
        *(({}, "open", {"width_m": m}, WIDTH_OUT) for m in (-0.001, 0.086, 1e300)),
        *(({}, "close", CLOSE_5 | {"width_m": m}, WIDTH_OUT) for m in (-0.001, 0.086, 1e300)),
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
    session: dict[str, Any], kind: IntentKind, wanted: dict[str, float], refusal: Refused
) -> None:
    bench = Bench()
    has(**session)(bench)
    want(kind, 0, refusal, **wanted)(bench)
    assert len(bench.session.commands) == (refusal is None)


@pytest.mark.parametrize(
    ("now", "force_n"),
    [
        ({"force_n": None}, 6.0),
        ({"force_n": 6.4}, 6.0),
        ({"force_n": 8.0}, 8.0),
        ({"force_n": 6.4, "reported_n": 9.0}, 6.4),
        ({"what": "contact_opening"}, None),
        ({"moving": True}, None),
        ({"width_m": None}, None),
        ({"width_m": 0.05}, None),
    ],
)
def test_a_grip_that_was_kept_goes_on_where_the_gripper_confirms_it(now: dict[str, Any], force_n: float | None) -> None:
    reported = {"reported_n": now.get("reported_n")}
    kept = KEPT.model_copy(update={"force_n": 6.0, "raised_n": 1.0, "reflexed_n": 2.0} | reported)
    bench, confirmed = Bench("", Pad(None), heard=False), []
    be(conditions=[])(bench)
    bench.control.grip.restore(kept, lambda: confirmed.append(True))
    assert bench.control.grip.kept() == kept
    seen(0, **{"what": "contact_closing"} | {key: now[key] for key in now.keys() - reported.keys()})(bench)
    policy = bench.control.policy
    command_n = 6.0 if force_n == 6.0 else None
    be(force_n=force_n, command_n=command_n, conditions=[Health.ERROR] * (force_n is None))(bench)
    assert (policy.raised_n, policy.reflexed_n) == ((1.0, 2.0) if force_n == 6.0 else (0.0, 0.0))
    assert confirmed == [True] * (force_n == 6.0)
