"""The reflex raises the grip by what is needed, lowers only its own raises after a long calm, and never oscillates."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest
from judging import ask
from nanoseconds import MS

from slipd.config import Reflex as ReflexConfig
from slipd.gripper.grip_policy import GripLimits, GripPolicy
from slipd.gripper.reflex import Reflex, ReflexAct
from slipd.types.permit import Permit

T0 = 50_000_000_000
SETTINGS = {"ceiling_n": 20.0, "raise_n_per_s": 50.0, "slip_gain": 1.2, "calm_s": 2.0, "lower_n_per_s": 2.0}
NAN, INF = math.nan, math.inf


class Held:
    """An object held with 5 N, by a gripper that carries out each command, in steps of ``unit_n``.

    Step and rate of the gripper leave more than the reflex takes, unless they are given.
    """

    def __init__(self, **made: Any) -> None:
        step_n, rate_n_per_s = made.pop("step_n", 25.0), made.pop("rate_n_per_s", 100.0)
        limits = GripLimits(
            1.0, made.pop("max_n", 25.0), step_n, rate_n_per_s, rate_n_per_s, made.pop("budget_n", 25.0)
        )
        self.policy = GripPolicy(limits, 200)
        self.unit_n, self.t_ns = made.pop("unit_n", 0.0), T0
        self.policy.record_force(5.0, T0)
        self.reflex = Reflex(ReflexConfig(**SETTINGS | made), self.policy)

    def watch(
        self,
        level: str,
        needed_n: float | None,
        ms: int,
        *,
        internal_n: float | None = None,
        trusted: bool = True,
        every_ms: int = 5,
        carried_out: bool = True,
    ) -> list[ReflexAct]:
        """Let ``ms`` pass with such readings, and return what the reflex did."""
        acts = []
        for _ in range(0, ms, every_ms):
            self.t_ns += every_ms * MS
            act = self.reflex.decide(level, needed_n, internal_n, trusted, self.t_ns)
            if act is not None and isinstance(ask(self.policy, "reflex", act.force_n, self.t_ns), Permit):
                acts.append(act)
                self.reflex.acted(act)
                if carried_out:
                    steps = math.floor(act.force_n / self.unit_n + 1e-9) * self.unit_n if self.unit_n else act.force_n
                    self.policy.record_force(steps, self.t_ns, reflex=True)
        return acts

    @property
    def force_n(self) -> float:
        assert self.policy.force_n is not None
        return self.policy.force_n


Step = Callable[[Held], object]


def watch(level: str, needed_n: float | None, ms: int, *acts: tuple[float, float, str] | int, **how: Any) -> Step:
    """Watch readings; ``acts`` are those expected as (from, to, reason), or how many, or anything."""

    def step(held: Held) -> None:
        found = held.watch(level, needed_n, ms, **how)
        if acts and isinstance(acts[0], int):
            assert acts[0] <= len(found) <= acts[-1]
        elif acts:
            assert [(pytest.approx(act.from_n), pytest.approx(act.force_n), act.reason) for act in found] == list(acts)

    return step


def quiet(level: str, needed_n: float | None, ms: int, **how: Any) -> Step:
    """Watch readings at which the reflex does nothing."""
    return watch(level, needed_n, ms, 0, 0, **how)


def force(least_n: float, most_n: float | None = None) -> Step:
    """Check the force in force."""

    def step(held: Held) -> None:
        assert least_n - 1e-6 <= held.force_n <= (least_n if most_n is None else most_n) + 1e-6

    return step


def sent(force_n: float, *, reflex: bool = False) -> Step:
    """A client, or the reflex, sends another force."""
    return lambda held: held.policy.record_force(force_n, held.t_ns, reflex=reflex)


def later(ms: int) -> Step:
    """Let time pass unwatched; it may be negative."""
    return lambda held: setattr(held, "t_ns", held.t_ns + ms * MS)


def latched(held: Held) -> None:
    held.policy.latch("E-stop")


def acknowledged(held: Held) -> None:
    held.policy.acknowledge()


def let_go(held: Held) -> None:
    held.policy.end_grasp()


RAISED = watch("warning", 10.0, 500)
"""From 5 N to 10 N, by the reflex."""
CALM = quiet("stable", 5.0, 2000)
ALMOST = quiet("stable", 5.0, 1990)
Course = tuple[dict[str, float | None], list[Step]]
COURSES: dict[str, Course] = {
    # what a warning raises
    "at once by what one period allows": ({}, [watch("warning", 9.0, 5, (5.0, 6.0, "needed"))]),
    "at its rate to what is needed": (
        {}, [watch("warning", 7.5, 1000, (5.0, 6.0, "needed"), (6.0, 7.0, "needed"), (7.0, 7.5, "needed"))],
    ),
    **{
        f"nothing at {level}": ({}, [quiet(level, 9.0, 500)])
        for level in ("no_contact", "stable", "caution", "unknown")
    },
    "nothing where the grip is enough": ({}, [quiet("warning", 4.9, 500)]),
    **{f"N2 nothing where the need is {n}": ({}, [quiet("warning", n, 500)]) for n in (None, NAN, INF, -INF)},
    **{
        f"N2 the commanded force counts where the grip measures {n}": (
            {}, [watch("stable", 5.0, 200, internal_n=n), watch("warning", 7.0, 500, internal_n=n), force(7.0)],
        )
        for n in (None, NAN, INF, -INF)
    },
    "more where the gripper grips less than commanded": (
        {}, [watch("caution", 5.0, 200, internal_n=4.0), watch("warning", 7.0, 500, internal_n=4.0), force(8.0, 25.0)],
    ),
    "less where it grips more": (
        {}, [watch("caution", 5.0, 200, internal_n=7.0), quiet("warning", 6.9, 50, internal_n=7.0)],
    ),
    "nothing of what the grasp before taught": (
        {},
        [
            watch("caution", 5.0, 200, internal_n=3.0), let_go, watch("no_contact", None, 5), sent(5.0),
            quiet("warning", 4.9, 20),
        ],
    ),
    "A8 no further where the gripper follows late": (
        {},
        [
            watch("caution", 5.0, 200, internal_n=5.0), watch("warning", 9.0, 90, internal_n=5.0),
            watch("warning", 9.0, 500, internal_n=9.0), force(9.0),
        ],
    ),
    "nothing of what a doubtful finger feels": (
        {},
        [
            watch("caution", 5.0, 200, internal_n=1.0, trusted=False), watch("warning", 6.0, 90, internal_n=5.0),
            force(6.0),
        ],
    ),
    # what a slip raises
    **{
        f"by the gain at a slip that {n} N should hold": ({}, [watch("slipping", n, 50, (5.0, 6.0, "slipping"))])
        for n in (None, 4.0, 5.05)
    },
    "to what is needed at a slip under too little grip": (
        {},
        [watch("slipping", 8.0, 100, (5.0, 6.0, "needed"), (6.0, 7.0, "needed"), (7.0, 8.0, "needed")), force(8.0)],
    ),
    "A8 again only when the last rise could be felt": (
        {},
        [
            watch("slipping", None, 245, *[
                (a, b, "slipping") for a, b in ((5.0, 6.0), (6.0, 7.0), (7.0, 7.2), (7.2, 8.2), (8.2, 8.64))
            ])
        ],
    ),
    "A8 no faster at a slip that comes and goes": (
        {}, [*[watch("slipping", None, 5), watch("warning", 4.0, 5)] * 10, force(6.0)],
    ),
    "no more to a goal that a client went below": (
        {"slip_gain": 2.0},
        [watch("slipping", None, 5), sent(4.0), quiet("slipping", None, 95), watch("slipping", None, 500, 1, 99)],
    ),
    # what bounds it
    "to the ceiling, and a client beyond it is left alone": (
        {}, [watch("warning", 24.0, 2000), force(20.0), sent(22.0), quiet("warning", 24.0, 500)],
    ),
    "to the limit of the policy": ({"ceiling_n": 40.0}, [watch("warning", 30.0, 2000), force(25.0)]),
    "to that limit without a ceiling": ({"ceiling_n": None}, [watch("warning", 30.0, 2000), force(25.0)]),
    "A8 until its budget is spent": (
        {"budget_n": 3.5}, [watch("warning", 24.0, 500), force(8.5), quiet("warning", 24.0, 5000)],
    ),
    "nothing without a limit": ({"max_n": None}, [quiet("warning", 9.0, 50)]),
    "nothing that is not gripped": (
        {}, [let_go, quiet("slipping", 9.0, 200), sent(5.0), watch("warning", 9.0, 5, 1, 1)],
    ),
    "A6 D4 nothing while a fault is latched": (
        {},
        [
            watch("warning", 9.0, 5), latched, quiet("warning", 9.0, 500), acknowledged,
            watch("warning", 9.0, 5, (6.0, 7.0, "needed")),
        ],
    ),
    "A7 no further once a sensor is lost": (
        {},
        [
            watch("warning", 12.0, 60), quiet("warning", 12.0, 500, trusted=False),
            quiet("slipping", 12.0, 500, trusted=False), force(6.0, 11.9),
        ],
    ),
    "C4 one step after the loop stood still": (
        {}, [watch("warning", 15.0, 5), later(10_000), watch("warning", 15.0, 5, (6.0, 7.0, "needed"))],
    ),
    "C4 nothing at an earlier time": ({}, [watch("warning", 15.0, 5), later(-10_000), quiet("warning", 15.0, 500)]),
    "from where a client has lowered to": (
        {}, [watch("warning", 15.0, 5), sent(4.5), watch("warning", 15.0, 20, (4.5, 5.5, "needed"))],
    ),
    **{
        f"to coarse settings of {unit_n} N at {rate} N/s": (
            {"raise_n_per_s": rate, "unit_n": unit_n}, [watch("warning", 9.0, 6000), force(8.9 - unit_n, 9.0)],
        )
        for rate, unit_n in ((2.0, 0.1), (2.0, 0.85), (50.0, 0.85))
    },
    **{
        f"A9 a step at once and then the rate of the gripper with {unit_n} N": (
            {"unit_n": unit_n, "step_n": 2.0, "rate_n_per_s": 10.0},
            [watch("warning", 24.0, 500), force(11.6 - unit_n, 12.2)],
        )
        for unit_n in (0.0, 0.85)
    },
    **{
        f"A8 seldom where it has no effect with {unit_n} N": (
            {"unit_n": unit_n}, [sent(5.1 if unit_n else 5.0), watch("warning", 5.5, 1000, 0, most)],
        )
        for unit_n, most in ((0.0, 1), (0.85, 10))
    },
    # what calm lowers
    "slowly, once calm for long": (
        {},
        [
            RAISED, CALM, quiet("stable", 5.0, 50), watch("stable", 5.0, 5, (10.0, 9.9, "calm")),
            watch("stable", 5.0, 945), force(7.9, 8.1),
        ],
    ),
    "as fast as it may": ({"lower_n_per_s": 30.0}, [RAISED, CALM, watch("stable", 5.0, 100, 5, 5), force(6.4, 7.6)]),
    "A9 no faster than the gripper may": (
        {"lower_n_per_s": 30.0, "step_n": 2.0, "rate_n_per_s": 2.0},
        [sent(15.0, reflex=True), watch("stable", 5.0, 2000), watch("stable", 5.0, 2000), force(8.6, 9.4)],
    ),
    "to a tenth above the need": ({}, [RAISED, watch("stable", 6.0, 10_000), force(6.6, 6.7)]),
    "to what the client asked for last": (
        {}, [RAISED, watch("stable", 1.0, 10_000), force(5.0, 5.1), sent(7.0), quiet("stable", 1.0, 10_000)],
    ),
    "never at a lowering rate of zero": ({"lower_n_per_s": 0.0}, [RAISED, quiet("stable", 1.0, 60_000)]),
    **{
        f"to the need where {n} N are gripped": (
            {}, [RAISED, watch("stable", 6.0, 10_000, internal_n=n), force(6.6, 10.0)],
        )
        for n in (7.0, 13.0)
    },
    **{
        f"only after another calm behind {level}": (
            {"slip_gain": 1.0}, [RAISED, ALMOST, watch(level, 5.0, 5), CALM, watch("stable", 5.0, 500, 1, 99)],
        )
        for level in ("no_contact", "caution", "warning", "slipping", "unknown")
    },
    **{
        f"N2 only after another calm behind a need of {n}": ({}, [RAISED, ALMOST, quiet("stable", n, 5000), CALM])
        for n in (None, NAN, INF, -INF)
    },
    "only after another calm behind a doubt": (
        {}, [RAISED, ALMOST, quiet("stable", 5.0, 5000, trusted=False), CALM],
    ),
    "C4 only after another calm behind a gap": (
        {},
        [RAISED, watch("stable", 5.0, 2500), later(251), CALM, watch("stable", 5.0, 10_000, 1, 99, every_ms=250)],
    ),
    **{
        f"no faster in settings of {unit_n} N": (
            {"unit_n": unit_n}, [RAISED, watch("stable", 5.0, 3000), force(7.9 - 2.0 * unit_n, 8.2 + unit_n)],
        )
        for unit_n in (0.1, 0.85)
    },
    "A8 one step after it was not permitted": (
        {}, [RAISED, latched, quiet("stable", 5.0, 10_000), acknowledged, watch("stable", 5.0, 5, (10.0, 9.9, "calm"))],
    ),
    "A8 seldom where lowering has no effect": (
        {}, [RAISED, CALM, watch("stable", 5.0, 2000, 21, 21, carried_out=False), force(10.0)],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", COURSES)
def test_A6_A7_A8_A9_C4_D4_N2_the_reflex_moves(name: str) -> None:
    made, steps = COURSES[name]
    held = Held(**made)
    for step in steps:
        step(held)


def test_C4_an_act_that_was_not_carried_out_is_not_built_upon() -> None:
    held = Held(calm_s=0.01)
    assert held.reflex.decide("warning", 15.0, None, True, held.t_ns) is not None
    later(95)(held)
    watch("warning", 15.0, 5, (5.0, 6.0, "needed"))(held)
    acts = [held.reflex.decide("stable", 1.0, None, True, held.t_ns + ms * MS) for ms in (5, 15, 70)]
    assert acts == [None, None, ReflexAct(5.9, 6.0, "calm")]
    assert held.reflex.decide("warning", 12.0, None, True, held.t_ns + 90 * MS) == ReflexAct(7.0, 6.0, "needed")


def test_A8_an_hour_of_a_need_that_swings_is_bounded_by_the_budget_and_by_the_calm() -> None:
    held, acts = Held(calm_s=0.1, budget_n=12.0), []
    for k in range(720):
        acts += held.watch("warning", 8.0 + k % 2, 100, every_ms=20)
        acts += held.watch("stable", 5.0 + k % 2, 4900, every_ms=100)
    rises = [act.force_n - act.from_n for act in acts if act.force_n > act.from_n]
    assert 11.5 <= sum(rises) <= 12.0 + 1e-6
    assert held.force_n >= 5.0
