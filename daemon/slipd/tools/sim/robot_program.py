"""The robot program of the demo grips the box, reacts to warnings, and keeps a report; written like a user's."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, field
from typing import Any

from slipd_client.errors import ClientError, LeaseLost, RequestRefused
from slipd_client.grip import GripClient
from slipd_client.messages import Health
from slipd_client.messages.names import DAEMON_LATE
from slipd_client.messages.topics import Message, Slip, SlipWarning
from slipd_client.subscriber import Subscriber

ALARMING = ("warning", "slipping")
"""Levels that call for more grip force."""


def warns_of_rotation(change: SlipWarning) -> bool:
    """Return whether a change of level calls for more grip force because the object may turn."""
    return change.rising and change.level in ALARMING and "rotation" in change.reasons


@dataclass
class Raise:
    """A request for more grip force, one step of a raise.

    Attributes:
        requested_ns: When the request was sent, CLOCK_MONOTONIC.
        requested_n: The requested force, N on one pad.
        result: Result in the reply; None if the daemon refused.
        refusal: Why the daemon refused; "" if it did not.
        before_n: Measured grip force before the request, N; None if unknown.
        after_n: Measured grip force shortly after it, N; None if unknown.
    """

    requested_ns: int
    requested_n: float
    result: dict[str, Any] | None
    refusal: str
    before_n: float | None
    after_n: float | None = None


@dataclass
class Report:
    """What the program did and received; times are CLOCK_MONOTONIC, None if it did not happen.

    Attributes:
        tares: Result of each tare, by finger.
        activated_ns: When the program activated the gripper: about the start of the scene.
        closed_ns: When the program closed the gripper.
        opened_ns: When the program opened the gripper.
        changes: Every change of level since the gripper closed.
        raises: Every step that raised the grip force.
        refusals: Every other refusal, as text.
        moves: When each move of the arm began, CLOCK_MONOTONIC, and what is to be said of it.
        error: What ended the program early; "" if nothing did.
    """

    tares: dict[str, dict[str, Any]] = field(default_factory=dict)
    activated_ns: int | None = None
    closed_ns: int | None = None
    opened_ns: int | None = None
    changes: list[SlipWarning] = field(default_factory=list)
    raises: list[Raise] = field(default_factory=list)
    refusals: list[str] = field(default_factory=list)
    moves: list[tuple[int, str]] = field(default_factory=list)
    error: str = ""

    @property
    def rotation_warning(self) -> SlipWarning | None:
        """The first warning of rotation."""
        return next((change for change in self.changes if warns_of_rotation(change)), None)

    @property
    def slip_report(self) -> SlipWarning | None:
        """The first report of a slip."""
        return next((change for change in self.changes if "slip_detected" in change.reasons), None)


LISTEN_S = 0.05
"""Longest wait for a message before the program checks its plan again, s."""

SETTLE_S = 0.5
"""Time after a raise at which the force is read, s: the gripper follows within a few tenths of a second."""

LEAST_RAISE_N = 0.1
"""Smallest raise, N: less is within the resolution of the gripper."""

NOT_DONE_IN_TIME = ("deadline_passed", "no_lease", "too_fast", "not_ready", "activating")
"""Refusals that a stalled machine causes; asking again is safe, because a refused request was not carried out."""


@dataclass(frozen=True)
class Plan:
    """What the program does, and when, in s since it activated the gripper.

    Attributes:
        patience_s: Longest wait until all streams deliver.
        tare_s: Averaging time of each tare before the grip.
        close_s: When the gripper closes.
        speed_mps: Closing speed.
        force_n: First grip force, N on one pad.
        limit_n: Largest grip force that the program requests, N on one pad.
        step_n: Largest raise at once, N: the limit of the gripper.
        step_s: Time between steps: slightly longer than the limit of 10 N/s requires.
        open_s: When the gripper opens.
        end_s: When the program ends.
        lease_ms: Life of the lease without renewal, ms.
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


class RobotProgram(threading.Thread):
    """The program as a thread: start it once the daemon serves, join it, and read its report.

    Args:
        publish: Endpoint of the messages.
        requests: Endpoint of the requests.
        plan: What to do, and when.

    Attributes:
        report: What the program did and received so far.
    """

    def __init__(self, publish: str, requests: str, plan: Plan | None = None) -> None:
        super().__init__(name="robot program")
        self.report = Report()
        self._publish, self._requests = publish, requests
        self._plan = plan or Plan()
        self._ending = threading.Event()
        self._force_n = self._wanted_n = 0.0
        self._raised_s = 0.0
        self._slips: dict[str, Slip] = {}
        self._alarm: SlipWarning | None = None

    def end(self) -> None:
        """End the program soon, without opening the gripper."""
        self._ending.set()

    def run(self) -> None:
        """Run the whole program; an early end is in the report."""
        try:
            with Subscriber(self._publish, ("slip", "warning")) as subscriber, GripClient(self._requests) as client:
                self._prepare(client)
                begin_s = time.monotonic()
                while time.monotonic() - begin_s < self._plan.end_s and not self._ending.is_set():
                    self._hold(begin_s, subscriber, client)
        except (ClientError, TimeoutError) as error:
            self.report.error = str(error)

    def _prepare(self, client: GripClient) -> None:
        """Wait until every stream delivers, then tare both fingers; again where a stall prevents one."""
        until_s = time.monotonic() + self._plan.patience_s
        while faults := _faults(client):
            if time.monotonic() > until_s:
                raise TimeoutError(f"streams that do not deliver after {self._plan.patience_s:g} s: {faults}")
            if self._ending.wait(LISTEN_S):
                return
        for finger in client.hello()["fingers"]:
            while finger not in self.report.tares and not self._ending.wait(LISTEN_S):
                try:
                    self.report.tares[finger] = client.tare(finger, self._plan.tare_s)
                except RequestRefused:
                    if time.monotonic() >= until_s:
                        raise

    def _hold(self, begin_s: float, subscriber: Subscriber, client: GripClient) -> None:
        """Work under a lease; where a stall of the machine ends or delays it, the caller takes a new one."""
        try:
            with client.lease(self._plan.lease_ms):
                self._work(begin_s, subscriber, client)
        except LeaseLost as lost:
            self.report.refusals.append(str(lost))
        except RequestRefused as refusal:
            if refusal.code != "deadline_passed":
                raise
            self.report.refusals.append(str(refusal))
            self._ending.wait(LISTEN_S)

    def _work(self, begin_s: float, subscriber: Subscriber, client: GripClient) -> None:
        while (now_s := time.monotonic() - begin_s) < self._plan.end_s and not self._ending.is_set():
            try:
                self._keep_to_plan(now_s, client)
                self._raise_grip(client)
            except RequestRefused as refusal:
                self.report.refusals.append(str(refusal))
                stale = refusal.code == "in_contact" and self.report.activated_ns is None  # nothing is gripped yet
                if refusal.code not in NOT_DONE_IN_TIME and not stale:
                    raise
            message = subscriber.receive(LISTEN_S)
            if message is not None and self.report.closed_ns is not None:
                self._receive(message)

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

    def _receive(self, message: Message) -> None:
        if isinstance(message, Slip):
            self._slips[message.finger] = message
            for made in self.report.raises:  # the force after each raise, once it has settled
                if made.after_n is None and message.t_ns >= made.requested_ns + SETTLE_S * 1e9:
                    made.after_n = self._measured_n()
        elif isinstance(message, SlipWarning):
            self.report.changes.append(message)
            if warns_of_rotation(message):
                self._alarm = message

    def _raise_grip(self, client: GripClient) -> None:
        """After an alarm, request step by step the grip force that the newest verdicts need."""
        if self._alarm is not None and self.report.opened_ns is None:
            self._choose_force(self._alarm)
        now_s, requested_ns = time.monotonic(), time.monotonic_ns()
        if self._wanted_n < self._force_n + LEAST_RAISE_N or now_s < self._raised_s + self._plan.step_s:
            return
        requested_n = min(self._wanted_n, self._force_n + self._plan.step_n)
        made = Raise(requested_ns, requested_n, None, "", self._measured_n())
        try:
            made.result = client.grip_set(requested_n)
            self._force_n, self._raised_s = made.result["applied_n"], now_s
        except RequestRefused as refused:
            if refused.code in NOT_DONE_IN_TIME:
                raise
            made.refusal, self._wanted_n = str(refused), 0.0
        self.report.raises.append(made)

    def _choose_force(self, alarm: SlipWarning) -> None:
        """Choose the force that holds the object, or the limit of the plan if no force is known to hold it."""
        needed = [force_n for slip in self._slips.values() if (force_n := slip.grip_needed_n) is not None]
        if "unsupportable" in alarm.reasons:
            needed = [self._plan.limit_n]
        if needed:  # otherwise a later verdict will know
            self._wanted_n, self._alarm = min(max(needed), self._plan.limit_n), None

    def _measured_n(self) -> float | None:
        """Return the newest grip force of the weaker finger, N; None if unknown."""
        return min((slip.normal_n for slip in self._slips.values() if slip.normal_n is not None), default=None)


def _faults(client: GripClient) -> str:
    """Return the streams that do not deliver, and why, or that the machine was too busy to tell; "" if all do."""
    try:
        streams = client.status()["streams"]
    except RequestRefused as refusal:
        if refusal.code != "deadline_passed":
            raise
        return str(refusal)
    found = {name: stream["message"] for name, stream in streams.items() if stream["health"] != Health.OK}
    return ", ".join(f"{name} ({why})" for name, why in found.items() if not why.startswith(DAEMON_LATE))
