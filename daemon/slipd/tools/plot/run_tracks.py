"""What a run reported over time, collected from its messages in bounded memory."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from slipd.recording.reader import EventGaps
from slipd.tools.plot.binned_track import NO_VALUE, BinnedTrack, Extent, Range, Window, later, widest
from slipd_client.messages import GRASP_TOPIC, GRIPPER_TOPIC, MOTION_TOPIC, SEVERITY, STATUS_TOPIC, WARNING_TOPIC
from slipd_client.messages.names import SlipLevel

MOST_CHANGES = 400
"""Changes that are listed; a run may have any number."""

MOST_SNAPSHOTS = 24
"""Images that are kept."""

SHOWN = ("finger", "previous", "level", "utilisation", "reasons", "evidence")
"""What is shown of a change of level."""

COUNTERS = ("lost", "bad", "duplicates", "dropped", "restarts", "reconnects")
"""Counters of a stream that report a fault."""

GRASP_NUMBERS = {
    GRASP_TOPIC: {"now": "internal_n", "needed": "grip_needed_n"},
    MOTION_TOPIC: {"speed_scale": "speed_scale"},
    GRIPPER_TOPIC: {"commanded": "force_command_n"},
}
"""Numbers of `RunTracks.grasp`, and their keys in the messages of a topic."""


class Numbers(defaultdict[str, BinnedTrack[Range]]):
    """Least and largest value of some quantities over time, by name."""

    def __init__(self) -> None:
        super().__init__(lambda: BinnedTrack(widest))

    def note(self, name: str, t_s: float, low: float | None, high: float | None) -> None:
        """Note the range from one value to another at a time; no value where either is not known."""
        self[name].add(t_s, NO_VALUE if low is None or high is None else (low, high))


class LevelState(NamedTuple):
    """Level of a finger with its reasons."""

    level: str
    reasons: tuple[str, ...]


def worse(one: LevelState, other: LevelState) -> LevelState:
    """Merge two levels into the worse one; at the same level, with the reasons of both."""
    if one.level != other.level:
        return max(one, other, key=lambda state: SEVERITY[state.level])
    return LevelState(one.level, tuple(dict.fromkeys(one.reasons + other.reasons)))


@dataclass(slots=True)
class FingerTracks:
    """What one finger reported.

    Attributes:
        level: Its level and reasons.
        evidence: Kinds of evidence of motion.
        mu_source: Where the coefficient of friction comes from.
        numbers: Quantities of the message ``slip`` by key, N (or the unit of the sensor), N·m; and "bounds" of the
            utilisation, "relative" where the utilisation is not known, "tangential" its length, and "mu_interval", in
            which the coefficient is expected: infinite where nothing limits it.
        in_newtons: Whether all forces were in newtons.
    """

    level: BinnedTrack[LevelState] = field(default_factory=lambda: BinnedTrack(worse))
    evidence: BinnedTrack[frozenset[str]] = field(default_factory=lambda: BinnedTrack(lambda one, other: one | other))
    mu_source: BinnedTrack[str] = field(default_factory=lambda: BinnedTrack(later))
    numbers: Numbers = field(default_factory=Numbers)
    in_newtons: bool = True

    def add(self, t_s: float, body: Mapping[str, Any]) -> None:
        """Add a message ``slip``.

        Raises:
            KeyError, TypeError, ValueError: It lacks a field that is drawn, or has one of another kind.
        """
        if body["level"] not in SEVERITY:
            raise ValueError(f"level must be one of {', '.join(SEVERITY)}, got {body['level']!r:.40}")
        self.level.add(t_s, LevelState(body["level"], tuple(body["reasons"])))
        self.evidence.add(t_s, frozenset(body["evidence"]))
        self.mu_source.add(t_s, body["mu_source"])
        self.in_newtons = self.in_newtons and body["force_unit"] == "N"
        note, known = self.numbers.note, body["utilisation"] is not None
        for name in ("utilisation", "normal_n", "spin_nm", "grip_needed_n", "mu", "required_friction"):
            note(name, t_s, body[name], body[name])
        tangential = None if body["tangential_n"] is None else math.hypot(*body["tangential_n"])
        note("tangential", t_s, tangential, tangential)
        note("bounds", t_s, body["utilisation_lower"], body["utilisation_upper"])
        relative = None if known else body["relative_utilisation"]
        note("relative", t_s, relative, relative)
        note("mu_interval", t_s, body["mu_low"], math.inf if body["mu_high"] is None else body["mu_high"])


@dataclass(slots=True)
class StreamTracks:
    """How healthy one stream was.

    Attributes:
        health: Its health, a code of `slipd_client.messages.Health`, and why; the worse of two.
        counters: The newest of each counter that reports a fault.
        masked: Largest number of taxels that were not used; None for a stream without taxels.
    """

    health: BinnedTrack[tuple[int, str]] = field(default_factory=lambda: BinnedTrack(max))
    counters: dict[str, int] = field(default_factory=dict)
    masked: int | None = None

    def add(self, t_s: float, body: Mapping[str, Any]) -> None:
        """Add an entry of ``status``."""
        self.health.add(t_s, (body["health"], body["message"]))
        self.counters = {name: body[name] for name in COUNTERS}
        if "masked" in body:
            self.masked = max(self.masked or 0, len(body["masked"]))


@dataclass(slots=True)
class Change:
    """One change of level.

    Attributes:
        t_s: When, s.
        warning: What is `SHOWN` of the message ``warning``.
        verdict: The first message ``slip`` after the image of a snapshot: it is about the same reading.
    """

    t_s: float
    warning: Mapping[str, Any]
    verdict: Mapping[str, Any] = field(default_factory=dict)


class ChangeLog:
    """The changes of level of a run, and the image of the pad at each alarm: the first ones, and the count of all.

    Attributes:
        changes: The first ``MOST_CHANGES``, in order.
        count: Number of all.
        snapshots: Rises to an alarm, each with the newest image of the pad; the first ``MOST_SNAPSHOTS`` with one.
        alarms: Number of all rises to an alarm.
        newest_images: The newest message ``tactile`` with an image of each finger; none after a gap, because it does
            not show what follows.
    """

    def __init__(self) -> None:
        self.changes: list[Change] = []
        self.snapshots: list[tuple[Change, Mapping[str, Any]]] = []
        self.count = self.alarms = 0
        self.newest_images: dict[str, Mapping[str, Any]] = {}
        self._unfinished: dict[str, Change] = {}

    def add_change(self, t_s: float, body: Mapping[str, Any]) -> None:
        """Add a message ``warning``.

        Raises:
            KeyError, ValueError: It lacks a field that is drawn, or has one of another kind.
        """
        alarming = SlipLevel(body["level"]).alarming and body["rising"]
        change, finger = Change(t_s, {key: body[key] for key in SHOWN}), body["finger"]
        self.count += 1
        if len(self.changes) < MOST_CHANGES:
            self.changes.append(change)
        if not alarming:
            return
        self.alarms += 1
        if len(self.snapshots) < MOST_SNAPSHOTS and finger in self.newest_images:
            self.snapshots.append((change, self.newest_images[finger]))
            self._unfinished[finger] = change

    def add_verdict(self, finger: str, body: Mapping[str, Any]) -> None:
        """Add a message ``slip``."""
        if change := self._unfinished.pop(finger, None):
            change.verdict = body


class RunTracks:
    """All of it.

    Args:
        begin_ns: CLOCK_MONOTONIC at the first event; all times are seconds since then.
        begin_s: Messages before are left out.

    Attributes:
        window: From the begin to the newest message.
        gaps: Times of which nothing is known, and the begin from which times count.
        fingers: By name.
        streams: By name.
        grasp: Grip force that both fingers share ("now"), the least such force that would hold the load ("needed"), and
            that which was sent to the gripper last ("commanded"), N; and the time scale at which the grip holds the
            motion of the arm ("speed_scale").
        changes: Changes of level, and the image of the pad at each alarm.
    """

    def __init__(self, begin_ns: int, begin_s: float = 0.0) -> None:
        self.window = Window(begin_s, begin_s)
        self.gaps = EventGaps(begin_ns)
        self.fingers: defaultdict[str, FingerTracks] = defaultdict(FingerTracks)
        self.streams: defaultdict[str, StreamTracks] = defaultdict(StreamTracks)
        self.grasp = Numbers()
        self.changes = ChangeLog()

    def add_event(self, t_ns: int) -> None:
        """Add the time of an event, before the messages that it causes."""
        if self.gaps.add(t_ns):
            self.changes.newest_images.clear()

    def add(self, topic: str, body: Mapping[str, Any]) -> None:
        """Add a message of any topic."""
        t_s = self.gaps.time_s(body["t_ns"])
        kind, _, finger = topic.partition(".")
        if kind == "tactile" and body["loads_n"] is not None:
            self.changes.newest_images[finger] = body
        if t_s < self.window.begin_s:
            return
        self.window = Window(self.window.begin_s, max(self.window.end_s, t_s))
        if kind == "slip":
            self.fingers[finger].add(t_s, body)
            self.changes.add_verdict(finger, body)
        elif topic == WARNING_TOPIC:
            self.changes.add_change(t_s, body)
        elif topic == STATUS_TOPIC:
            for name, stream in body["streams"].items():
                self.streams[name].add(t_s, stream)
        for name, key in GRASP_NUMBERS.get(topic, {}).items():
            self.grasp.note(name, t_s, body[key], body[key])

    @property
    def extent(self) -> Extent:
        """How long values hold that no newer one replaces."""
        return Extent(self.window.end_s, self.gaps.found)
