"""What is known of every robot of a fleet: level, health, age, and what was missed. Pure: time is an argument."""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from slipd_client.errors import MessageError
from slipd_client.messages.codec import RunOrder, read
from slipd_client.messages.names import SEVERITY, STATUS_TOPIC, WARNING_TOPIC, Health
from slipd_client.messages.topics import Message, SlipWarning, Status

SILENT_AFTER_S = 1.8
"""A robot whose ``status``, once a second, is older is silent, whatever its signs of life."""

LIVE, SILENT, GONE, CLASH = "live", "silent", "gone", "clash"
"""States of a robot: its daemon publishes; its bridge runs, but the daemon is silent; the bridge is gone as well;
daemons of several robots publish under its name."""

PUBLISHING = (LIVE, CLASH)
"""States in which what is shown is of now."""

NAME_CLASH = "name_clash"
"""Reason of the level "unknown" of a row that stands for several robots."""

CLASH_TEXT = "two or more robots call themselves {}: give each a name of its own, slipctl serve fleet --robot NAME"

MOST_ROBOTS = 10_000
"""Most robots that are listed. A further one displaces an unexpected one of the session that publishes the most; where
none has more than its own session, its messages only count as `FleetState.unread`."""

MOST_RUNS = 8
"""Most runs of the daemon that are remembered of each robot: kept warnings of earlier ones may arrive late."""


BESIDE_S = 3.0
"""A daemon whose last ``status`` is no older counts beside the one that was heard last, s."""

CLASH_S = 1.2
"""Daemons whose times of ``status`` overlap by so much are those of several robots, s: the network drops a silent
connection within 1 s, so the last messages of a daemon that ended are not that late."""

BRIDGE, DAEMON = "bridge", "daemon"
"""Last words of the two liveliness tokens of a robot: its bridge runs; the daemon behind it publishes."""


@dataclass(frozen=True)
class RobotRow:
    """One robot at some time.

    Attributes:
        robot: Its name.
        state: "live", "silent", "gone" or "clash".
        level: Level of the worst finger, where several daemons publish that of all of them, and then "unknown" or
            worse; "unknown" where none publishes.
        fingers: Finger → its level, when the robot was last heard; the worst where several daemons publish.
        reasons: Reasons of that level.
        health: Worst health of its streams; None before the first ``status``, and where no daemon publishes.
        complaint: The stream with that health and its message; "" where all are well.
        fault: Why the row stands for several robots, and what to do; "" where it stands for one.
        age_s: Time since the last message, s; None where it is not known.
        missed_warnings: Warnings that did not arrive, by the daemon's own numbers.
        restarts: Times that the daemon was restarted; a run beyond the last ``MOST_RUNS`` counts again.
        version: Of slipd.
        object_name: What is held, where it is named.
        expected: Whether it is one of the robots that the user named; true where none are named.
    """

    robot: str
    state: str
    level: str
    fingers: dict[str, str]
    reasons: tuple[str, ...]
    health: Health | None
    complaint: str
    fault: str
    age_s: float | None
    missed_warnings: int
    restarts: int
    version: str
    object_name: str
    expected: bool = True


class FleetState:
    """Keeps the state of every robot by its messages and signs of life.

    Args:
        expected: Names of robots that are listed from the beginning, and that no other robot displaces.

    Attributes:
        unread: Messages that could not be read, and those of robots beyond ``MOST_ROBOTS``.
    """

    def __init__(self, expected: Iterable[str] = ()) -> None:
        self.unread = 0
        self._expected = frozenset(expected)
        self._robots: dict[str, _Robot] = {name: _Robot() for name in self._expected}
        self._names: dict[str, dict[str, None]] = {}
        """Peer → the robots that it was the first to publish, the newest last; "": known by signs of life alone."""

    def add_message(self, robot: str, topic: str, payload: bytes, now_s: float, peer: str = "") -> Message | None:
        """Update with a message; return it, or None where it cannot be read, is a repeat, or is of another topic.

        Args:
            robot: Name of the robot.
            topic: Topic of the daemon.
            payload: The daemon's message.
            now_s: When it arrived.
            peer: Session that published it; "" where it names none.
        """
        if topic not in (STATUS_TOPIC, WARNING_TOPIC):
            return None
        with contextlib.suppress(MessageError):
            raw = read([topic.encode(), payload])[1]
            if (known := self._robot(robot, peer)) is not None:
                return known.add(topic, raw, now_s)
        self.unread += 1
        return None

    def add_token(self, robot: str, what: str, *, alive: bool) -> None:
        """Update with a sign of life: a liveliness token of this robot was declared or has ended."""
        if (known := self._robot(robot, "")) is None:
            return
        known.token_seen = True
        if what == BRIDGE:
            known.bridge = alive
        elif what == DAEMON:
            known.daemon = alive
            known.daemon_seen |= alive

    def rows(self, now_s: float) -> list[RobotRow]:
        """Return the state of every robot that is expected or was ever seen, sorted by name."""
        return [
            self._robots[name].row(name, now_s, expected=not self._expected or name in self._expected)
            for name in sorted(self._robots)
        ]

    def _robot(self, name: str, peer: str) -> _Robot | None:
        known = self._robots.get(name)
        if known is None:
            if len(self._robots) >= MOST_ROBOTS and not self._make_room(peer):
                return None
            known = self._robots[name] = _Robot()
            self._names.setdefault(peer, {})[name] = None
        elif peer and self._names.get("", {}).pop(name, "") is None:  # so far seen by signs of life alone, not expected
            self._names.setdefault(peer, {})[name] = None
        return known

    def _make_room(self, peer: str) -> bool:
        """Forget the newest robot of the peer with the most, unless it then has fewer than ``peer``."""
        largest = max(self._names, key=lambda each: len(self._names[each]), default="")
        if len(self._names.get(largest, ())) <= len(self._names.get(peer, ())) + 1:
            return False
        name, _ = self._names[largest].popitem()
        del self._robots[name]
        return True


@dataclass
class _Run:
    """One run of a daemon, of which `status` and `warning` arrive in any order."""

    heard_s: float = 0.0
    first_status_s: float = math.inf
    last_status_s: float = -math.inf
    order: RunOrder = field(default_factory=RunOrder)
    status: Status | None = None
    fingers: dict[str, tuple[int, str, tuple[str, ...]]] = field(default_factory=dict)
    """Finger → time (CLOCK_MONOTONIC of the daemon, ns), level and reasons."""

    def beside(self, now_s: float) -> bool:
        """Return whether its daemon published a moment ago."""
        return now_s - self.last_status_s <= BESIDE_S

    def overlaps(self, other: _Run) -> bool:
        """Return whether both daemons published at the same time."""
        both_s = min(self.last_status_s, other.last_status_s) - max(self.first_status_s, other.first_status_s)
        return both_s >= CLASH_S

    def note(self, message: Message, now_s: float) -> None:
        """Update with a message that arrived at ``now_s``."""
        self.heard_s = now_s
        if isinstance(message, SlipWarning):
            self._level(message.finger, message.t_ns, message.level.value, message.reasons)
        elif isinstance(message, Status):
            self.status = message
            self.first_status_s, self.last_status_s = min(self.first_status_s, now_s), now_s
            for finger, each in message.fingers.items():
                self._level(finger, message.t_ns, each.level.value, each.reasons)

    def _level(self, finger: str, t_ns: int, level: str, reasons: tuple[str, ...]) -> None:
        """Note the level of a finger; warnings overtake ``status`` on the way."""
        if t_ns >= self.fingers.get(finger, (t_ns,))[0]:
            self.fingers[finger] = (t_ns, level, reasons)


@dataclass
class _Robot:
    bridge: bool = False
    daemon: bool = False
    daemon_seen: bool = False
    token_seen: bool = False
    runs: dict[str, _Run] = field(default_factory=dict)
    begun: int = 0
    run: _Run = field(default_factory=_Run)
    missed: int = 0

    def add(self, topic: str, raw: dict[str, Any], now_s: float) -> Message | None:
        """Note a message and return it; None for a repeat."""
        run = self.runs.get(raw["boot"]) or _Run()
        message = run.order.accept(topic, raw)
        if message is None:
            return None
        if message.boot not in self.runs:
            self._begin(message.boot, run, now_s)
        if isinstance(message, SlipWarning):
            self.missed += message.missed
        self.run = run
        if isinstance(message, Status) and run.status is not None and not self.token_seen:
            self.bridge = self.daemon = self.daemon_seen = True  # its tokens came while there was no room
        run.note(message, now_s)
        return message

    def _begin(self, boot: str, run: _Run, now_s: float) -> None:
        """Remember a further run, instead of the one that is silent for the longest time.

        Where all of them are of daemons that publish, the newest gives way: the others show that they are several.
        """
        if len(self.runs) >= MOST_RUNS:
            past = [boot for boot, each in self.runs.items() if not each.beside(now_s)]
            del self.runs[min(past, key=lambda boot: self.runs[boot].heard_s) if past else list(self.runs)[-1]]
        self.runs[boot] = run
        self.begun += 1

    def row(self, name: str, now_s: float, *, expected: bool) -> RobotRow:
        # a kept message of a daemon that has been silent since this view began is of unknown age
        age_s = now_s - self.run.heard_s if self.runs and self.daemon_seen else None
        beside = [run for run in self.runs.values() if run is not self.run and run.beside(now_s)]
        state = GONE if not self.bridge else SILENT
        if self.bridge and self.daemon and age_s is not None and age_s <= SILENT_AFTER_S:
            state = LIVE
            if any(one.overlaps(other) for one, other in itertools.combinations([self.run, *beside], 2)):
                state = CLASH
        runs = [self.run, *beside] if state in PUBLISHING else [self.run]
        fingers = _fingers(runs)
        worst = max(fingers.values(), key=lambda each: SEVERITY[each[0]], default=("unknown", ()))
        level, reasons = worst if state in PUBLISHING else ("unknown", ("stale",))
        if state == CLASH and SEVERITY[level] <= SEVERITY["unknown"]:
            level, reasons = "unknown", (NAME_CLASH,)
        health, complaint = _health(runs) if state in PUBLISHING else (None, "")
        return RobotRow(
            robot=name,
            state=state,
            level=level,
            fingers={finger: each[0] for finger, each in sorted(fingers.items())},
            reasons=reasons,
            health=health,
            complaint=complaint,
            fault=CLASH_TEXT.format(name) if state == CLASH else "",
            age_s=age_s,
            missed_warnings=self.missed,
            restarts=max(self.begun - 1, 0),
            version=(self.run.status and self.run.status.version) or "",
            object_name=(self.run.status and self.run.status.object_name) or "",
            expected=expected,
        )


def _fingers(runs: Sequence[_Run]) -> dict[str, tuple[str, tuple[str, ...]]]:
    """Return the worst level of each finger in any of the runs, and its reasons."""
    fingers: dict[str, tuple[str, tuple[str, ...]]] = {}
    for run in runs:
        for finger, (_, level, reasons) in run.fingers.items():
            if finger not in fingers or SEVERITY[level] > SEVERITY[fingers[finger][0]]:
                fingers[finger] = level, reasons
    return fingers


def _health(runs: Sequence[_Run]) -> tuple[Health | None, str]:
    """Return the worst health of the streams of any of the runs."""
    known = [run.status for run in runs if run.status is not None]
    worst, complaint = Health.OK, ""
    for status in known:
        for name, stream in status.streams.items():
            if stream.health > worst:
                worst, complaint = stream.health, f"{name}: {stream.message or stream.health.name}"
    return (worst, complaint) if known else (None, "")
