"""Frames at a fixed rate from messages at their own times.

A frame holds the newest values that were published at its time or before, never later ones: what a program on the robot
had then. How old they are is part of the frame.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from slipd.errors import SlipdError
from slipd.recording.reader import EventGaps
from slipd.tools.export.frame_layout import AGE, UNKNOWN_LEVEL, FrameLayout, Tap
from slipd.tools.export.message_files import Body

MOST_GAP_NS = 3_600_000_000_000
"""Longest gap that is filled with frames in which nothing is known: a clock that jumps by years fills the disk."""

Frame = dict[str, npt.NDArray[np.generic]]
"""Numbers by the name of their feature; NaN: not known. The arrays are used again for the next frame."""


class FrameSampler:
    """Samples the messages of one recording.

    Args:
        layout: What a frame holds.
        rate_hz: Frames per second.
        write: Called with each frame in the order of time; it copies what it keeps.

    Attributes:
        begin_ns: Time of the first frame, that of the first message; None before it.
    """

    def __init__(self, layout: FrameLayout, rate_hz: int, write: Callable[[Frame], None]) -> None:
        self.begin_ns: int | None = None
        self._taps = layout.taps
        self._rate_hz = rate_hz
        self._write = write
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
                f"a gap of an episode may last at most {MOST_GAP_NS * 1e-9:.0f} s, because it is filled with frames;"
                f" {begin_s:.1f} s after the first message one of {gap_s:.0f} s begins"
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
        taps = self._taps.get(topic)
        if taps is None:
            return
        for tap in taps:
            value = body[tap.key]
            self._frame[tap.feature][tap.begin : tap.end] = _missing(tap) if value is None else value
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
                self._frame[tap.feature][tap.begin : tap.end] = _missing(tap)


def _missing(tap: Tap) -> float:
    return UNKNOWN_LEVEL if tap.key == "level_code" else math.nan


def _acquired_ns(t_ns: int, body: Body) -> float:
    """Return when the readings of a message were acquired, ns; NaN where there were none yet."""
    if "age_s" not in body:
        return float(body["t_ns"])
    age_s = body["age_s"]
    return math.nan if age_s is None else t_ns - age_s * 1e9
