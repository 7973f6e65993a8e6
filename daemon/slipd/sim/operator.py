"""The demo's robot program: grips the box, heeds the daemon's warnings, and reports what it was told.

It is written as a user's program would be: a subscriber and a requester of ``slipd_client``, one thread, no more.
"""

from __future__ import annotations

import contextlib
import threading
import time
from dataclasses import dataclass, field
from typing import Any

from slipd_client.errors import ClientError, LeaseLost, RequestRefused
from slipd_client.grip import GripClient
from slipd_client.messages import Health
from slipd_client.subscriber import Message, Subscriber

LISTEN_S = 0.05
"""How long it waits for a message before it looks at its plan again."""

TARES = 3
"""So often is a tare asked for before the program gives up."""

SETTLE_S = 0.5
"""When the force after a raise is read: the gripper follows within a few tenths of a second."""

LEAST_RAISE_N = 0.1
"""A smaller raise is within the gripper's own step."""

ALARMING = ("warning", "slipping")

NOT_DONE_IN_TIME = ("deadline_passed", "no_lease", "too_fast", "not_ready")
"""Refusals that a stalled machine brings about; asking again is safe, for what was refused was not done."""


@dataclass(frozen=True)
class Plan:
    """What the program does, and when, in s since it told the gripper to activate.

    Attributes:
        patience_s: How long it waits for the daemon and all its streams to be well.
        tare_s: How long each finger is averaged before the grip.
        close_s: When it closes.
        speed_mps: How fast.
        force_n: First grip force, N on one pad.
        limit_n: Its own limit for raising that force.
        step_n: Most by which it raises the force at once: the gripper's own limit.
        step_s: Time from one step to the next: a little longer than the gripper's limit of 10 N/s asks for.
        open_s: When it opens.
        end_s: When it ends.
        lease_ms: Life of its lease without renewal.
    """

    patience_s: float = 30.0
    tare_s: float = 0.5
    close_s: float = 1.5
    speed_mps: float = 0.05
    force_n: float = 7.0
    limit_n: float = 24.0
    step_n: float = 2.0
    step_s: float = 0.22
    open_s: float = 16.0
    end_s: float = 18.0
    lease_ms: int = 200


@dataclass
class Change:
    """A change of level that was heard.

    Attributes:
        t_ns: Of the reading that changed it (CLOCK_MONOTONIC).
        heard_ns: When the program had it in hand.
        finger: Which finger.
        level: The new level.
        rising: It is more alarming than the one before.
        reasons: Why.
        utilisation: Of that reading, where known.
    """

    t_ns: int
    heard_ns: int
    finger: str
    level: str
    rising: bool
    reasons: list[str]
    utilisation: float | None


@dataclass
class Raise:
    """A request for more grip, one step of a raise.

    Attributes:
        asked_ns: When it was sent.
        answered_ns: When its reply was in hand.
        asked_n: The force asked for.
        result: What the daemon replied; None when it refused.
        refusal: Why it refused; "" when it did not.
        before_n: Measured grip force when it was sent.
        after_n: The same shortly afterwards.
    """

    asked_ns: int
    answered_ns: int
    asked_n: float
    result: dict[str, Any] | None
    refusal: str
    before_n: float | None
    after_n: float | None = None


@dataclass
class Report:
    """What the program did and heard; times are CLOCK_MONOTONIC, None for what did not happen.

    Attributes:
        tares: What each tare said, by finger.
        activated_ns: When it told the gripper to activate: about the beginning of the scene.
        closed_ns: When it told the gripper to close.
        opened_ns: When it told the gripper to open.
        changes: Every change of level from the closing on.
        raises: Every raise of the grip.
        refusals: Every other refusal, as text.
        error: What ended it early; "" when nothing did.
    """

    tares: dict[str, dict[str, Any]] = field(default_factory=dict)
    activated_ns: int | None = None
    closed_ns: int | None = None
    opened_ns: int | None = None
    changes: list[Change] = field(default_factory=list)
    raises: list[Raise] = field(default_factory=list)
    refusals: list[str] = field(default_factory=list)
    error: str = ""

    @property
    def rotation_warning(self) -> Change | None:
        """The first warning that rotation threatens."""
        return next((c for c in self.changes if c.rising and c.level in ALARMING and "rotation" in c.reasons), None)

    @property
    def slip_told(self) -> Change | None:
        """The first time that a slip was told."""
        return next((change for change in self.changes if "slip_detected" in change.reasons), None)


class Operator(threading.Thread):
    """The program as a thread; start it once the daemon serves, join it, read its report.

    Args:
        publish: Endpoint where the daemon publishes.
        requests: Endpoint where it takes requests.
        plan: What to do.

    Attributes:
        report: What was done and heard so far.
    """

    def __init__(self, publish: str, requests: str, plan: Plan | None = None) -> None:
        super().__init__(name="operator")
        self.report = Report()
        self._endpoints = (publish, requests)
        self._plan = plan or Plan()
        self._ending = threading.Event()
        self._force_n = self._wanted_n = 0.0
        self._raised_s = 0.0
        self._slips: dict[str, dict[str, Any]] = {}
        self._alarm: Change | None = None

    def end(self) -> None:
        """Let it end soon, without opening the gripper."""
        self._ending.set()

    def run(self) -> None:
        """The whole program; what ends it early is told in the report."""
        publish, requests = self._endpoints
        try:
            with Subscriber(publish, ("slip", "warning")) as subscriber, GripClient(requests) as client:
                self._prepare(client)
                begin_s = time.monotonic()
                while time.monotonic() - begin_s < self._plan.end_s and not self._ending.is_set():
                    self._hold(begin_s, subscriber, client)
        except (ClientError, TimeoutError) as error:
            self.report.error = str(error)

    def _prepare(self, client: GripClient) -> None:
        """Wait until every stream is well, then tare both fingers."""
        until_s = time.monotonic() + self._plan.patience_s
        while ill := _ill(client.status()["streams"]):
            if time.monotonic() > until_s:
                raise TimeoutError(f"streams that are not well after {self._plan.patience_s:g} s: {ill}")
            if self._ending.wait(LISTEN_S):
                return
        for finger in client.hello()["fingers"]:
            self.report.tares[finger] = self._tare(client, finger)

    def _tare(self, client: GripClient, finger: str) -> dict[str, Any]:
        """Tare a finger; a machine that stalls tears images, which may end a tare that nothing else speaks against."""
        for _ in range(TARES - 1):
            with contextlib.suppress(RequestRefused):
                return client.tare(finger, self._plan.tare_s)
        return client.tare(finger, self._plan.tare_s)

    def _hold(self, begin_s: float, subscriber: Subscriber, client: GripClient) -> None:
        """Work while a lease lasts; one that a stalled machine let run out is taken anew."""
        try:
            with client.lease(self._plan.lease_ms):
                self._work(begin_s, subscriber, client)
        except LeaseLost as lost:
            self.report.refusals.append(str(lost))

    def _work(self, begin_s: float, subscriber: Subscriber, client: GripClient) -> None:
        while (now_s := time.monotonic() - begin_s) < self._plan.end_s and not self._ending.is_set():
            try:
                self._keep_to_plan(now_s, client)
                self._raise_grip(client)
            except RequestRefused as refusal:
                self.report.refusals.append(str(refusal))
                if refusal.code not in NOT_DONE_IN_TIME:
                    raise
            message = subscriber.receive(LISTEN_S)
            if message is not None and self.report.closed_ns is not None:
                self._hear(message)

    def _keep_to_plan(self, now_s: float, client: GripClient) -> None:
        plan, report = self._plan, self.report
        if report.activated_ns is None:
            client.gripper_activate()
            report.activated_ns = time.monotonic_ns()
        if report.closed_ns is None and now_s >= plan.close_s:
            closed = client.gripper_close(plan.force_n, speed_mps=plan.speed_mps)
            report.closed_ns, self._force_n = time.monotonic_ns(), closed["applied_n"]
        if report.opened_ns is None and now_s >= plan.open_s:
            client.gripper_open(drop=True)
            report.opened_ns, self._wanted_n = time.monotonic_ns(), 0.0

    def _hear(self, message: Message) -> None:
        body = message.raw
        if message.topic != "warning":
            self._slips[body["finger"]] = body
            self._note_force(body)
            return
        change = Change(
            t_ns=body["t_ns"],
            heard_ns=time.monotonic_ns(),
            finger=body["finger"],
            level=body["level"],
            rising=body["rising"],
            reasons=body["reasons"],
            utilisation=body["utilisation"],
        )
        self.report.changes.append(change)
        if change.rising and change.level in ALARMING and "rotation" in change.reasons:
            self._alarm = change

    def _raise_grip(self, client: GripClient) -> None:
        """After an alarm, ask step by step for the grip that the newest verdicts say is needed."""
        if self._alarm is not None and self.report.opened_ns is None:
            self._heed(self._alarm)
        now_s = time.monotonic()
        if self._wanted_n < self._force_n + LEAST_RAISE_N or now_s < self._raised_s + self._plan.step_s:
            return
        asked_n = min(self._wanted_n, self._force_n + self._plan.step_n)
        asked_ns, before_n = time.monotonic_ns(), self._measured_n()
        result, refusal = None, ""
        try:
            result = client.grip_set(asked_n)
            self._force_n, self._raised_s = result["applied_n"], now_s
        except RequestRefused as refused:
            if refused.code in NOT_DONE_IN_TIME:
                raise
            refusal, self._wanted_n = str(refused), 0.0
        self.report.raises.append(Raise(asked_ns, time.monotonic_ns(), asked_n, result, refusal, before_n))

    def _heed(self, alarm: Change) -> None:
        """Want what holds, or all that the plan allows where nothing is known to."""
        if "unsupportable" in alarm.reasons:
            self._wanted_n = self._plan.limit_n
        else:
            needed = [force_n for slip in self._slips.values() if (force_n := slip["grip_needed_n"]) is not None]
            if not needed:
                return  # the next verdict that knows will say
            self._wanted_n = min(max(needed), self._plan.limit_n)
        self._alarm = None

    def _note_force(self, slip: dict[str, Any]) -> None:
        """Read the force that a raise has brought, once it has settled."""
        for made in self.report.raises:
            if made.after_n is None and slip["t_ns"] >= made.asked_ns + SETTLE_S * 1e9:
                made.after_n = self._measured_n()

    def _measured_n(self) -> float | None:
        """The weaker finger's grip force, newest."""
        known = [slip["normal_n"] for slip in self._slips.values() if slip["normal_n"] is not None]
        return min(known, default=None)


def _ill(streams: dict[str, dict[str, Any]]) -> str:
    """Which streams are not well, and why; empty when all are."""
    return ", ".join(f"{name} ({s['message']})" for name, s in streams.items() if s["health"] != Health.OK)
