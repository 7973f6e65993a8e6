"""What a run reported over time, collected from its messages in bounded memory."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from slipd.recording.reader import EventGaps
from slipd.tools.plot.binned_track import NO_VALUE, BinnedTrack, Extent, Range, Window, later, widest
from slipd.tools.plot.change_log import ChangeLog
from slipd_client.messages import GRASP_TOPIC, GRIPPER_TOPIC, SEVERITY, STATUS_TOPIC, WARNING_TOPIC

Numbers = BinnedTrack[Range]


def _numbers() -> Numbers:
    return BinnedTrack(widest)


class LevelState(NamedTuple):
    """Level of a finger with its reasons."""

    level: str
    reasons: tuple[str, ...]


def worse(one: LevelState, other: LevelState) -> LevelState:
    """Merge two levels into the worse one; at the same level, with the reasons of both."""
    if one.level != other.level:
        return max(one, other, key=lambda state: SEVERITY[state.level])
    return LevelState(one.level, tuple(dict.fromkeys(one.reasons + other.reasons)))


def _either(one: frozenset[str], other: frozenset[str]) -> frozenset[str]:
    return one | other


class HealthState(NamedTuple):
    """Health of a stream, a code of `slipd_client.messages.Health`, and why."""

    code: int
    message: str


@dataclass(slots=True)
class FingerTracks:
    """What one finger reported.

    Attributes:
        level: Its level and reasons.
        evidence: Kinds of evidence of motion.
        used: Utilisation, and its bounds.
        bounds: Lower and upper bound of the utilisation.
        relative: Relative utilisation where the utilisation is not known.
        normal: Normal force, N (or in the unit of the sensor).
        tangential: Length of the tangential force, N.
        spin: Spin, N·m.
        needed: Grip force needed, N.
        mu: Coefficient of static friction in use.
        mu_interval: The interval in which it is expected; infinite where nothing limits it.
        mu_source: Where it comes from.
        required: Coefficient of friction at which the load would just slip.
        in_newtons: Whether all forces were in newtons.
    """

    level: BinnedTrack[LevelState] = field(default_factory=lambda: BinnedTrack(worse))
    evidence: BinnedTrack[frozenset[str]] = field(default_factory=lambda: BinnedTrack(_either))
    used: Numbers = field(default_factory=_numbers)
    bounds: Numbers = field(default_factory=_numbers)
    relative: Numbers = field(default_factory=_numbers)
    normal: Numbers = field(default_factory=_numbers)
    tangential: Numbers = field(default_factory=_numbers)
    spin: Numbers = field(default_factory=_numbers)
    needed: Numbers = field(default_factory=_numbers)
    mu: Numbers = field(default_factory=_numbers)
    mu_interval: Numbers = field(default_factory=_numbers)
    mu_source: BinnedTrack[str] = field(default_factory=lambda: BinnedTrack(later))
    required: Numbers = field(default_factory=_numbers)
    in_newtons: bool = True

    def add(self, t_s: float, body: Mapping[str, Any]) -> None:
        """Add a message ``slip``.

        Raises:
            KeyError, TypeError, ValueError: It lacks a field that is drawn, or has one of another kind.
        """
        if body["level"] not in SEVERITY:
            raise ValueError(f"level must be one of {', '.join(SEVERITY)}, got {body['level']!r:.40}")
        used, lower, upper = body["utilisation"], body["utilisation_lower"], body["utilisation_upper"]
        self.level.add(t_s, LevelState(body["level"], tuple(body["reasons"])))
        self.evidence.add(t_s, frozenset(body["evidence"]))
        self.used.add(t_s, between(used, used))
        self.bounds.add(t_s, between(lower, upper))
        relative = body["relative_utilisation"] if used is None else None
        self.relative.add(t_s, between(relative, relative))
        tangential = body["tangential_n"]
        for track, value in (
            (self.normal, body["normal_n"]),
            (self.tangential, None if tangential is None else math.hypot(*tangential)),
            (self.spin, body["spin_nm"]),
            (self.needed, body["grip_needed_n"]),
            (self.mu, body["mu"]),
            (self.required, body["required_friction"]),
        ):
            track.add(t_s, between(value, value))
        unlimited = math.inf if body["mu_high"] is None else body["mu_high"]
        self.mu_interval.add(t_s, between(body["mu_low"], unlimited))
        self.mu_source.add(t_s, body["mu_source"])
        self.in_newtons = self.in_newtons and body["force_unit"] == "N"


def between(low: float | None, high: float | None) -> Range:
    """Return the range from one value to another; no value where either is not known."""
    return NO_VALUE if low is None or high is None else (low, high)


@dataclass(slots=True)
class StreamTracks:
    """How healthy one stream was.

    Attributes:
        health: Its health and why; the worse of two.
        counters: The newest of each counter that reports a fault.
        masked: Largest number of taxels that were not used; None for a stream without taxels.
    """

    health: BinnedTrack[HealthState] = field(default_factory=lambda: BinnedTrack(max))
    counters: dict[str, int] = field(default_factory=dict)
    masked: int | None = None

    def add(self, t_s: float, body: Mapping[str, Any]) -> None:
        """Add an entry of ``status``."""
        self.health.add(t_s, HealthState(body["health"], body["message"]))
        self.counters = {
            name: body[name] for name in ("lost", "bad", "duplicates", "dropped", "restarts", "reconnects")
        }
        if "masked" in body:
            self.masked = max(self.masked or 0, len(body["masked"]))


class RunTracks:
    """All of it.

    Args:
        begin_ns: CLOCK_MONOTONIC at the first event; all times are seconds since then.
        begin_s: Messages before are left out.

    Attributes:
        window: From the begin to the newest message.
        gaps: Times of which nothing is known.
        fingers: By name.
        streams: By name.
        grip: Grip force that both fingers share, N.
        grip_needed: Least such force that would hold the load, N.
        command: Grip force that was sent to the gripper last, N.
        changes: Changes of level, and the image of the pad at each alarm.
    """

    def __init__(self, begin_ns: int, begin_s: float = 0.0) -> None:
        self._begin_ns = begin_ns
        self.window = Window(begin_s, begin_s)
        self.gaps = EventGaps(begin_ns)
        self.fingers: dict[str, FingerTracks] = {}
        self.streams: dict[str, StreamTracks] = {}
        self.grip, self.grip_needed, self.command = _numbers(), _numbers(), _numbers()
        self.changes = ChangeLog()

    def add_event(self, t_ns: int) -> None:
        """Add the time of an event, before the messages that it causes."""
        if self.gaps.add(t_ns):
            self.changes.forget_images()

    def add(self, topic: str, body: Mapping[str, Any]) -> None:
        """Add a message of any topic."""
        t_s = self.time_s(body)
        kind, _, finger = topic.partition(".")
        if kind == "tactile":
            self.changes.add_image(finger, body)
        if t_s < self.window.begin_s:
            return
        if t_s > self.window.end_s:
            self.window = Window(self.window.begin_s, t_s)
        if kind == "slip":
            if finger not in self.fingers:
                self.fingers[finger] = FingerTracks()
            self.fingers[finger].add(t_s, body)
            self.changes.add_verdict(finger, body)
        elif topic == WARNING_TOPIC:
            self.changes.add_change(t_s, body)
        elif topic == GRASP_TOPIC:
            self.grip.add(t_s, between(body["internal_n"], body["internal_n"]))
            self.grip_needed.add(t_s, between(body["grip_needed_n"], body["grip_needed_n"]))
        elif topic == GRIPPER_TOPIC:
            self.command.add(t_s, between(body["force_command_n"], body["force_command_n"]))
        elif topic == STATUS_TOPIC:
            for name, stream in body["streams"].items():
                if name not in self.streams:
                    self.streams[name] = StreamTracks()
                self.streams[name].add(t_s, stream)

    def time_s(self, body: Mapping[str, Any]) -> float:
        """Return the time of a message, s."""
        t_ns: int = body["t_ns"]
        return (t_ns - self._begin_ns) * 1e-9

    @property
    def extent(self) -> Extent:
        """How long values hold that no newer one replaces."""
        return Extent(self.window.end_s, self.gaps.found)

    @property
    def finger_names(self) -> Sequence[str]:
        """Names of the fingers in order."""
        return sorted(self.fingers)
