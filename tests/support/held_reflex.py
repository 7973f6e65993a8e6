"""A reflex with the grip that it acts on, and what it asked for."""

from __future__ import annotations

import math

import pytest
from judging import ask

from slipd.config import Reflex as ReflexConfig
from slipd.gripper.grip_policy import GripLimits, GripPolicy
from slipd.gripper.reflex import Reflex, ReflexAct
from slipd.types.permit import Permit

MS = 1_000_000
T0 = 50_000_000_000
SETTINGS = ReflexConfig(ceiling_n=20.0, raise_n_per_s=50.0, slip_gain=1.2, calm_s=2.0, lower_n_per_s=2.0)
NOT_KNOWN = pytest.mark.parametrize("unknown", [None, math.nan, math.inf, -math.inf])


class Held:
    """An object held with 5 N, by a gripper that carries out each command, in steps of ``unit_n``.

    Step and rate of the gripper leave more than the reflex takes, unless they are given.
    """

    def __init__(
        self,
        settings: ReflexConfig = SETTINGS,
        budget_n: float = 25.0,
        unit_n: float = 0.0,
        step_n: float = 25.0,
        rate_n_per_s: float = 100.0,
    ) -> None:
        self.policy = GripPolicy(GripLimits(1.0, 25.0, step_n, rate_n_per_s, rate_n_per_s, budget_n), 200)
        self.policy.record_force(5.0, T0)
        self.reflex = Reflex(settings, self.policy)
        self.unit_n = unit_n
        self.t_ns = T0

    def watch(
        self,
        level: str,
        needed_n: float | None,
        ms: int,
        internal_n: float | None = None,
        trusted: bool = True,
        every_ms: int = 5,
    ) -> list[ReflexAct]:
        """Lets ``ms`` pass with such readings; what the reflex did."""
        acts = []
        for _ in range(0, ms, every_ms):
            self.t_ns += every_ms * MS
            act = self.reflex.decide(level, needed_n, internal_n, trusted, self.t_ns)
            if act is not None and isinstance(ask(self.policy, "reflex", act.force_n, self.t_ns), Permit):
                acts.append(act)
                self.reflex.acted(act)
                steps = math.floor(act.force_n / self.unit_n + 1e-9) * self.unit_n if self.unit_n else act.force_n
                self.policy.record_force(steps, self.t_ns, reflex=True)
        return acts

    @property
    def force_n(self) -> float:
        assert self.policy.force_n is not None
        return self.policy.force_n
