"""Grip policy, idempotency and reflex against random clients, clocks, faults and readings, judged by an oracle."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule
from judging import ask

from slipd.gripper.grip_policy import GripLimits, GripPolicy
from slipd.gripper.reflex import Reflex, ReflexSettings
from slipd.requests.idempotency import IdempotencyCache
from slipd.types.refusal import Refusal

MS = 1_000_000
MAX_LEASE_MS = 200
LONGEST_DEADLINE_MS = 500
PERIOD_NS = 20 * MS
TINY = 1e-6
CLIENTS = (b"ann", b"ben", b"eve")
LEVELS = ("no_contact", "stable", "caution", "warning", "slipping", "unknown")
FORCES = st.one_of(st.floats(0.0, 30.0), st.floats(), st.sampled_from((3.0, 5.0, 7.0, 25.0, math.nan, math.inf, -1.0)))
READINGS = st.one_of(st.none(), st.floats(0.0, 30.0), st.floats())


@dataclass(frozen=True)
class Command:
    """Something the gripper was told."""

    t_ns: int
    by: str
    requested_n: float
    from_n: float | None
    applied_n: float


class Site(RuleBasedStateMachine):
    """A desk in small, with what it promises written down a second time."""

    @initialize(
        min_n=st.sampled_from((0.0, 3.0)),
        max_n=st.sampled_from((None, 10.0, 25.0, 25.0)),
        step_n=st.sampled_from((0.5, 2.0, 5.0)),
        raise_rate=st.sampled_from((1.0, 10.0, 40.0)),
        lower_rate=st.sampled_from((0.5, 2.0, 10.0)),
        budget_n=st.sampled_from((1.0, 6.0, 25.0)),
        unit_n=st.sampled_from((0.0, 0.1, 0.85)),
        reflex=st.builds(
            ReflexSettings,
            ceiling_n=st.sampled_from((8.0, 20.0)),
            raise_n_per_s=st.sampled_from((2.0, 50.0, 200.0)),
            slip_gain=st.sampled_from((1.0, 1.2, 3.0)),
            calm_s=st.sampled_from((0.01, 0.3)),
            lower_n_per_s=st.sampled_from((0.0, 2.0, 30.0)),
        ),
    )
    def configure(
        self,
        min_n: float,
        max_n: float | None,
        step_n: float,
        raise_rate: float,
        lower_rate: float,
        budget_n: float,
        unit_n: float,
        reflex: ReflexSettings,
    ) -> None:
        self.limits = GripLimits(min_n, max_n, step_n, raise_rate, lower_rate, budget_n)
        self.settings = reflex
        self.unit_n = unit_n
        self.policy = GripPolicy(self.limits, MAX_LEASE_MS)
        self.reflex = Reflex(reflex, self.policy)
        self.once = IdempotencyCache()
        self.t_ns = self.latest_ns = 10_000 * MS
        self.sent: list[tuple[bytes, dict[str, Any]]] = []
        self.answers: dict[tuple[bytes, str], tuple[str, dict[str, Any], int]] = {}
        self.done: set[str] = set()
        self.holder: bytes | None = None
        self.until_ns = self.ttl_ns = 0
        self.taken_away = False
        self.fault = ""
        self.force_n: float | None = None
        self.floor_n = 0.0
        self.raised_n = {"client": 0.0, "reflex": 0.0}
        self.commands: list[Command] = []
        self.acts: list[Command] = []  # rises of the reflex since a client told the gripper anything
        self.watched_ns = self.acted_ns = 0  # the newest time that the reflex was given, and that of its last act
        self.look()

    # Time

    @rule(ms=st.sampled_from((0, 1, 5, 20, 50, 199, 200, 201, 500, 10_000)))
    def time_passes(self, ms: int) -> None:
        self.t_ns = self.latest_ns + ms * MS
        self.look()

    @rule(ms=st.sampled_from((1, 30, 300, 5000)))
    def a_late_loop_brings_an_earlier_time(self, ms: int) -> None:
        self.t_ns = self.latest_ns - ms * MS
        self.look()

    def look(self) -> None:
        """What the engine does at each event: who has lost a lease?"""
        self.latest_ns = max(self.latest_ns, self.t_ns)
        lapsed = self.taken_away or (self.holder is not None and self.latest_ns >= self.until_ns)
        self.taken_away = False
        if lapsed:
            self.holder = None
        assert self.policy.lease.lapsed(self.t_ns) == lapsed
        assert self.policy.lease.holder(self.t_ns) == self.holder
        assert not self.policy.lease.lapsed(self.t_ns)

    # Requests

    @rule(
        client=st.sampled_from(CLIENTS),
        op=st.sampled_from(("lease.acquire", "lease.renew", "lease.release")),
        ttl_ms=st.sampled_from((0, 1, 50, 200, 201, -5, 10**12)),
        ahead_ms=st.integers(-600, 600),
    )
    def ask_about_the_lease(self, client: bytes, op: str, ttl_ms: int, ahead_ms: int) -> None:
        self.send(client, {"op": op, "ttl_ms": ttl_ms}, ahead_ms)

    @rule(client=st.sampled_from(CLIENTS), force_n=FORCES, ahead_ms=st.integers(-20, 520))
    def ask_for_a_force(self, client: bytes, force_n: float, ahead_ms: int) -> None:
        self.send(client, {"op": "grip.set", "force_n": force_n}, ahead_ms)

    @precondition(lambda self: self.force_n is not None)
    @rule(change_n=st.floats(-3.0, 3.0))
    def the_holder_asks_for_a_little_more_or_less(self, change_n: float) -> None:
        assert self.force_n is not None
        client = self.holder or CLIENTS[0]
        self.send(client, {"op": "lease.acquire", "ttl_ms": 200}, 100)
        self.send(client, {"op": "grip.set", "force_n": self.force_n + change_n}, 100)

    @rule(client=st.sampled_from(CLIENTS), force_n=st.floats(3.0, 8.0))
    def take_the_lease_and_grip(self, client: bytes, force_n: float) -> None:
        self.send(client, {"op": "lease.acquire", "ttl_ms": 200}, 100)
        self.send(client, {"op": "grip.set", "force_n": force_n}, 100)

    @precondition(lambda self: bool(self.sent))
    @rule(
        which=st.integers(0, 1000),
        client=st.one_of(st.none(), st.sampled_from(CLIENTS)),
        other=st.booleans(),
        times=st.integers(1, 3),
    )
    def send_again(self, which: int, client: bytes | None, other: bool, times: int) -> None:
        """Repeated by its sender, replayed by another, or another request under the same id."""
        sender, body = self.sent[which % len(self.sent)]
        for _ in range(times):
            self.judge(client or sender, body | ({"force_n": 4.0} if other else {}))

    def send(self, client: bytes, fields: dict[str, Any], ahead_ms: int) -> None:
        body = {"id": f"{len(self.sent)}", "deadline_ns": self.t_ns + ahead_ms * MS, **fields}
        self.sent.append((client, body))
        self.judge(client, body)

    def judge(self, client: bytes, body: dict[str, Any]) -> None:
        if not self.t_ns < body["deadline_ns"] <= self.t_ns + LONGEST_DEADLINE_MS * MS:
            return
        content = repr(sorted(body.items()))
        before = self.answers.get((client, body["id"]))
        known = self.once.seen(client, body, self.t_ns)
        if isinstance(known, dict):
            assert before is not None
            assert (content, known) == before[:2], "the reply of the first is the reply of the second"
            return
        if isinstance(known, Refusal):
            return
        assert content not in self.done, "nothing is done twice, whoever sends it"
        assert before is None or before[2] <= self.latest_ns, "an id stands for one request while that may still come"
        self.done.add(content)
        refusal = self.carry_out(client, body)
        reply = {"ok": refusal is None, "code": refusal and refusal.code}
        self.once.keep(client, body, reply, self.t_ns)
        self.answers[client, body["id"]] = (content, reply, body["deadline_ns"])

    def carry_out(self, client: bytes, body: dict[str, Any]) -> Refusal | None:
        if body["op"].startswith("lease"):
            return self.lease(client, body)
        force_n = body.get("force_n", math.nan)
        found = ask(self.policy, "close", force_n, self.t_ns, who=client)
        if isinstance(found, Refusal):
            return found
        assert self.holder == client, "nobody grips but the holder"
        self.tell("client", force_n)
        return None

    def lease(self, client: bytes, body: dict[str, Any]) -> Refusal | None:
        if body["op"] == "lease.acquire":
            right = 0 < body["ttl_ms"] <= MAX_LEASE_MS and self.holder in (None, client)
            refusal = self.policy.lease.acquire(client, body["ttl_ms"], self.t_ns)
            if right:
                self.holder, self.ttl_ns = client, body["ttl_ms"] * MS
        else:
            right = self.holder == client
            renews = body["op"] == "lease.renew"
            refusal = (self.policy.lease.renew if renews else self.policy.lease.release)(client, self.t_ns)
            self.holder = None if right and not renews else self.holder
        assert (refusal is None) == right
        self.until_ns = self.latest_ns + self.ttl_ns if right else self.until_ns
        return refusal

    # The gripper

    def tell(self, by: str, requested_n: float) -> Command:
        """The gripper is told: its settings are steps, and it takes the one below."""
        least_n, most_n = self.limits.min_n, self.limits.max_n
        assert most_n is not None, "no limit, no actuation"
        assert math.isfinite(requested_n)
        assert least_n <= requested_n <= most_n
        assert not self.fault, "nothing moves while a fault is latched"
        steps = math.floor(requested_n / self.unit_n + 1e-9) * self.unit_n if self.unit_n else requested_n
        t_ns = self.watched_ns if by == "reflex" else self.latest_ns
        command = Command(t_ns, by, requested_n, self.force_n, max(min(steps, requested_n), least_n))
        self.policy.record_force(command.applied_n, self.t_ns, reflex=by == "reflex")
        self.raised_n[by] += max(command.applied_n - self.force_n, 0.0) if self.force_n is not None else 0.0
        self.force_n = command.applied_n
        self.commands.append(command)
        if by == "client":
            self.floor_n, self.acts = command.applied_n, []
        self.check_change(command)
        assert self.raised_n[by] <= self.limits.budget_n + TINY, "one grasp is raised by no more than the budget"
        return command

    def check_change(self, command: Command) -> None:
        """Step, and slew over every window that ends here, by the client and the reflex together."""
        if command.from_n is None:
            return
        assert abs(command.requested_n - command.from_n) <= self.limits.step_n + TINY
        up = down = 0.0
        for earlier in reversed([c for c in self.commands if c.from_n is not None]):
            assert earlier.from_n is not None
            up += max(earlier.applied_n - earlier.from_n, 0.0)
            down += max(earlier.from_n - earlier.requested_n, 0.0)
            window_s = (command.t_ns - earlier.t_ns) * 1e-9
            assert up <= self.limits.step_n + self.limits.raise_n_per_s * window_s + TINY
            assert down <= self.limits.step_n + self.limits.lower_n_per_s * window_s + TINY

    @rule()
    def it_lets_go(self) -> None:
        self.policy.end_grasp()
        self.force_n, self.raised_n, self.acts = None, {"client": 0.0, "reflex": 0.0}, []

    @rule(fault=st.sampled_from(("", "E-stop", "no reply", "overheated")))
    def a_fault_comes(self, fault: str) -> None:
        self.policy.latch(fault)
        self.fault = self.fault or fault

    @rule()
    def the_fault_is_acknowledged(self) -> None:
        self.policy.acknowledge()
        self.fault = ""

    @rule()
    def the_host_slept(self) -> None:
        self.policy.lease.end()
        self.taken_away = self.holder is not None
        self.look()

    # The reflex

    @rule(
        level=st.sampled_from(LEVELS),
        needed_n=READINGS,
        internal_n=READINGS,
        trusted=st.booleans(),
        every_ms=st.sampled_from((0, 1, 5, 30, 150, 400)),
        count=st.integers(1, 40),
    )
    def readings_come(
        self,
        level: str,
        needed_n: float | None,
        internal_n: float | None,
        trusted: bool,
        every_ms: int,
        count: int,
    ) -> None:
        for _ in range(count):
            self.t_ns += every_ms * MS
            self.look()
            self.watched_ns = max(self.watched_ns, self.t_ns)
            act = self.reflex.decide(level, needed_n, internal_n, trusted, self.t_ns)
            if act is None or isinstance(ask(self.policy, "reflex", act.force_n, self.t_ns), Refusal):
                continue
            self.reflex.acted(act)
            assert trusted, "the reflex does nothing on a doubtful finger"
            assert act.from_n == self.force_n
            assert self.watched_ns - self.acted_ns >= PERIOD_NS
            self.acted_ns = self.watched_ns
            told = self.tell("reflex", act.force_n)
            self.check_rise(told, level) if act.force_n > act.from_n else self.check_fall(told, level, needed_n)

    @precondition(lambda self: self.force_n is not None and not self.fault)
    @rule(
        level=st.sampled_from(("stable", "warning", "slipping")),
        more_n=st.one_of(st.none(), st.floats(-6.0, 6.0)),
        felt_n=st.one_of(st.none(), st.floats(-2.0, 2.0)),
        every_ms=st.sampled_from((5, 20, 25)),
        count=st.integers(1, 60),
    )
    def a_held_object_is_watched(
        self, level: str, more_n: float | None, felt_n: float | None, every_ms: int, count: int
    ) -> None:
        assert self.force_n is not None
        needed_n = None if more_n is None else self.force_n + more_n
        self.readings_come(level, needed_n, felt_n and self.force_n + felt_n, True, every_ms, count)

    def check_rise(self, act: Command, level: str) -> None:
        assert level in ("warning", "slipping")
        assert act.requested_n <= self.settings.ceiling_n
        rate = self.settings.raise_n_per_s
        if not self.acts or self.acts[-1].from_n != act.from_n:
            self.acts.append(act)  # else it asks again, for more, as the gripper has no setting so near
        for earlier in self.acts:
            assert earlier.from_n is not None
            window_ns = act.t_ns - earlier.t_ns
            assert act.requested_n - earlier.from_n <= rate * (window_ns + PERIOD_NS) * 1e-9 + TINY

    def check_fall(self, act: Command, level: str, needed_n: float | None) -> None:
        assert level == "stable"
        assert needed_n is not None
        assert act.requested_n >= needed_n - TINY
        assert act.applied_n >= self.floor_n - TINY, "what a client asked for is kept"
        assert act.from_n is not None
        assert act.from_n - act.requested_n <= max(self.settings.lower_n_per_s * PERIOD_NS * 1e-9, 0.1) + TINY

    # What holds always

    @invariant()
    def the_force_in_force_is_the_last_that_was_told(self) -> None:
        if not hasattr(self, "policy"):
            return
        assert self.policy.force_n == self.force_n, "nothing moves by itself, and nothing opens"
        assert self.policy.fault == self.fault


Site.TestCase.settings = settings(
    max_examples=60, stateful_step_count=30, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
TestSite = Site.TestCase
