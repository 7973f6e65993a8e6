"""Frames at a fixed rate from messages at their own times: what a frame holds, how it is sampled, and its statistics.

A frame holds the newest values that were published at its time or before, never later ones: what a program on the robot
had then. How old they are is part of the frame.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from slipd.config import Config
from slipd.errors import SlipdError
from slipd.recording.reader import EventGaps
from slipd.tools.export.message_tables import Body
from slipd_client.messages import GRIPPER_TOPIC, level_code, slip_topic, tactile_topic, wrench_topic

STATE = "observation.state"
LEVEL = "observation.level"
TACTILE = "observation.tactile."
AGE = "observation.age_s"
ACTION = "action"

UNKNOWN_LEVEL = level_code("unknown")
"""Level of a finger before its first verdict, and where the recording has a gap."""

MOST_GAP_NS = 3_600_000_000_000
"""Longest gap that is filled with frames in which nothing is known: a clock that jumps by years fills the disk."""

Frame = dict[str, npt.NDArray[np.generic]]
"""Numbers by the name of their feature; NaN: not known. The arrays are used again for the next frame."""

_AXES = ("x", "y", "z")


@dataclass(frozen=True, slots=True)
class Feature:
    """Numbers of one kind in every frame.

    Attributes:
        name: Its key.
        names: Name of each number.
        dtype: Name of their NumPy type, "float32" or "int64".
    """

    name: str
    names: tuple[str, ...]
    dtype: str = "float32"


class Tap(NamedTuple):
    """Where the numbers of one key of a message go.

    Attributes:
        feature: Name of the feature.
        place: Their places in it.
        key: Key in the message.
    """

    feature: str
    place: slice
    key: str


@dataclass(frozen=True, slots=True)
class FrameLayout:
    """The features of a rig.

    Attributes:
        features: In their order.
        taps: By topic.
        pads: Rows and columns of each pad, by the name of its feature.
    """

    features: tuple[Feature, ...]
    taps: dict[str, tuple[Tap, ...]]
    pads: dict[str, tuple[int, int]]


def frame_layout(settings: Config) -> FrameLayout:
    """Return the features of the rig of a config."""
    names: dict[str, list[str]] = {STATE: [], LEVEL: []}
    taps: dict[str, tuple[Tap, ...]] = {}
    pads: dict[str, tuple[int, int]] = {}

    def add(topic: str, feature: str, key: str, *of_numbers: str) -> None:
        found = names.setdefault(feature, [])
        tap = Tap(feature, slice(len(found), len(found) + len(of_numbers)), key)
        taps[topic] = (*taps.get(topic, ()), tap)
        found.extend(of_numbers)

    for finger, sensors in settings.finger.items():
        slip, wrench = slip_topic(finger), wrench_topic(finger)
        for key in ("force_n", "torque_nm"):
            add(wrench, STATE, key, *(f"{finger}.{key}.{axis}" for axis in _AXES))
        for key in ("utilisation", "grip_needed_n"):
            add(slip, STATE, key, f"{finger}.{key}")
        add(slip, LEVEL, "level_code", finger)
        if sensors.pad is not None:
            rows, cols = pads[TACTILE + finger] = (sensors.pad.rows, sensors.pad.cols)
            taxels = (f"row{row}.col{col}" for row in range(rows) for col in range(cols))
            add(tactile_topic(finger), TACTILE + finger, "loads_n", *taxels)
    if settings.gripper is not None:
        for key in ("width_m", "force_n"):
            add(GRIPPER_TOPIC, STATE, key, f"gripper.{key}")
        add(GRIPPER_TOPIC, ACTION, "force_command_n", "grip_force_n")
    names[AGE] = list(taps)
    features = tuple(
        Feature(name, tuple(found), "int64" if name == LEVEL else "float32") for name, found in names.items()
    )
    return FrameLayout(features, taps, pads)


class FrameSampler:
    """Samples the messages of one recording.

    Args:
        layout: What a frame holds.
        rate_hz: Frames per second.
        write: Called with each frame in the order of time; it copies what it keeps.
        name: Name of the recording, for errors.

    Attributes:
        begin_ns: Time of the first frame, that of the first message; None before it.
    """

    def __init__(self, layout: FrameLayout, rate_hz: int, write: Callable[[Frame], None], name: str) -> None:
        self.begin_ns: int | None = None
        self._taps = layout.taps
        self._rate_hz = rate_hz
        self._write, self._name = write, name
        self._frame: Frame = {each.name: np.empty(len(each.names), each.dtype) for each in layout.features}
        self._acquired_ns: dict[str, float] = {}
        self._gaps = EventGaps()
        self._event_ns = 0
        self._frames = 0
        self._forget()

    def event(self, t_ns: int) -> None:
        """Note the time of an event, CLOCK_MONOTONIC, before the messages that it causes.

        Nothing is known in a gap of the recording, so no value is held there.

        Raises:
            SlipdError: The gap is longer than `MOST_GAP_NS`.
        """
        if self.begin_ns is not None and t_ns - self._event_ns > MOST_GAP_NS:
            begin_s, gap_s = (self._event_ns - self.begin_ns) * 1e-9, (t_ns - self._event_ns) * 1e-9
            raise SlipdError(
                f"{self._name}: a gap of an episode may last at most {MOST_GAP_NS * 1e-9:.0f} s, because it is filled "
                f"with frames; {begin_s:.1f} s after the first message one of {gap_s:.0f} s begins"
            )
        if self._gaps.add(t_ns):
            self._write_until(self._event_ns)
            self._forget()
        self._event_ns = t_ns

    def message(self, t_ns: int, topic: str, body: Body) -> None:
        """Handle a message that was published at ``t_ns``, CLOCK_MONOTONIC."""
        if self.begin_ns is None:
            self.begin_ns = t_ns
        self._write_until(t_ns - 1)
        for tap in self._taps.get(topic, ()):
            value = body[tap.key]
            self._frame[tap.feature][tap.place] = _missing(tap) if value is None else value
        self._acquired_ns[topic] = _acquired_ns(t_ns, body)

    def finish(self) -> None:
        """Write the frames up to the last event."""
        self._write_until(self._event_ns)

    def _write_until(self, end_ns: int) -> None:
        if self.begin_ns is None:
            return
        while (t_ns := self.begin_ns + self._frames * 1_000_000_000 // self._rate_hz) <= end_ns:
            ages = (t_ns - self._acquired_ns.get(topic, math.nan) for topic in self._taps)
            self._frame[AGE][:] = [age_ns * 1e-9 for age_ns in ages]
            self._write(self._frame)
            self._frames += 1

    def _forget(self) -> None:
        self._acquired_ns.clear()
        for taps in self._taps.values():
            for tap in taps:
                self._frame[tap.feature][tap.place] = _missing(tap)


def _missing(tap: Tap) -> float:
    return UNKNOWN_LEVEL if tap.key == "level_code" else math.nan


def _acquired_ns(t_ns: int, body: Body) -> float:
    """Return when the readings of a message were acquired, ns; NaN where there were none yet."""
    if "age_s" not in body:
        return float(body["t_ns"])
    age_s = body["age_s"]
    return math.nan if age_s is None else t_ns - age_s * 1e9
