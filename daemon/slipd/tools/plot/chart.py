"""The course of a run as curves and strips over time: what is drawn, without how."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from slipd.config import Levels
from slipd.tools.plot.binned_track import BinnedTrack, Extent, Held, Range
from slipd.tools.plot.run_tracks import FingerTracks, RunTracks
from slipd_client.messages import HEALTH

MOST_UTILISATION = 1.3
"""Larger utilisations are cut off here: the contact slips at 1."""

HEADROOM = 0.06
"""Share of an axis beyond the largest value."""

COLOURS = {
    "finger0": ("#0072b2", "#56b4e9"),
    "finger1": ("#d55e00", "#ff9e4a"),
    "finger2": ("#007a55", "#2fd0a0"),
    "finger3": ("#a3467f", "#e6a5c9"),
    "now": ("#0072b2", "#56b4e9"),
    "needed": ("#b2182b", "#ff7b7b"),
    "commanded": ("#444444", "#cccccc"),
}
"""Colour of each curve on white and on black; told apart by colour-blind people too."""

SPAN_COLOURS = {
    "no_contact": "#d9d9d9",
    "stable": "#7fbf7b",
    "unknown": "#b39ddb",
    "caution": "#fdd835",
    "warning": "#fb8c00",
    "slipping": "#c62828",
    "evidence": "#8e5ea2",
    "OK": "#7fbf7b",
    "WARN": "#fdd835",
    "ERROR": "#c62828",
    "STALE": "#b39ddb",
    "config": "#d9d9d9",
    "request": "#9ecae1",
    "learned": "#7fbf7b",
    "none": "#b39ddb",
}
"""Colour of each span; what is written on it is black, or white on the darkest."""

DARK_SPANS = frozenset({"slipping", "ERROR", "evidence"})


@dataclass(frozen=True, slots=True)
class Curve:
    """One quantity over time.

    Attributes:
        name: For the legend.
        colour: A key of ``COLOURS``.
        points: Its values; nothing is drawn where none is known.
        kind: "line", "dashed", or "band" for what lies between least and largest value.
    """

    name: str
    colour: str
    points: Sequence[Held[Range]]
    kind: str = "line"


@dataclass(frozen=True, slots=True)
class Panel:
    """Curves with a common axis.

    Attributes:
        title: What is drawn, with its unit.
        curves: From the back to the front.
        limits: Values that are marked by a line, with a name.
        most: Larger values are drawn as this; None: the axis reaches up to the largest.
    """

    title: str
    curves: Sequence[Curve]
    limits: Sequence[tuple[float, str]] = ()
    most: float | None = None

    @property
    def span(self) -> Range:
        """Least and largest value of the axis; 0 is on it."""
        values = [
            value
            for curve in self.curves
            for each in curve.points
            if known(each.value)
            for value in each.value
            if math.isfinite(value)
        ]
        values += [limit for limit, _ in self.limits] + [0.0]
        most = max(values) if self.most is None else min(max(values), self.most)
        room = HEADROOM * (most - min(values))
        return (min(values) - (room if min(values) < 0.0 else 0.0), most + room) if room else (min(values), most + 1.0)


@dataclass(frozen=True, slots=True)
class Span:
    """A time with one state.

    Attributes:
        begin_s: Its begin, s.
        end_s: Its end, s.
        colour: A key of ``SPAN_COLOURS``.
        texts: What is written on it: the first that fits, or nothing.
        whole: All of it.
    """

    begin_s: float
    end_s: float
    colour: str
    texts: tuple[str, ...]
    whole: str

    def text_for(self, letters: float) -> str:
        """Return what is written where there is room for so many letters; capitals are wider than others."""
        return next((text for text in self.texts if len(text) + 0.4 * sum(map(str.isupper, text)) <= letters), "")


@dataclass(frozen=True, slots=True)
class StripGroup:
    """Rows that belong together.

    Attributes:
        title: What they show.
        strips: States over time of each row, by its name.
        note: More about them; "" for nothing.
    """

    title: str
    strips: Mapping[str, Sequence[Span]]
    note: str = ""


def known(value: Range) -> bool:
    """Return whether a range holds any value."""
    return value[0] <= value[1]


def chart(tracks: RunTracks, levels: Levels) -> list[Panel | StripGroup]:
    """Return what is drawn of a run, from above to below; what was never known is left out.

    Args:
        tracks: What the run reported.
        levels: The thresholds in force.
    """
    extent = tracks.extent
    fingers = [(name, one, f"finger{at % 4}") for at, (name, one) in enumerate(sorted(tracks.fingers.items()))]
    limits = ((levels.caution, "caution"), (levels.warning, "warning"), (1.0, "slips"))
    force, torque = ("N", "N·m") if all(one.in_newtons for _, one, _ in fingers) else ("uncalibrated", "uncalibrated")
    parts: list[Panel | StripGroup] = [
        StripGroup("level and reasons", {name: list(_levels(one, extent)) for name, one, _ in fingers}),
        Panel(
            "utilisation λ",
            [
                *_of_each(fingers, "bounds", extent, "bounds", "band"),
                *_of_each(fingers, "utilisation", extent),
                *_of_each(fingers, "relative", extent, "relative, without μ", "dashed"),
            ],
            limits,
            MOST_UTILISATION,
        ),
        StripGroup(
            "evidence of motion", dict(strip for name, one, _ in fingers for strip in _evidence(name, one, extent))
        ),
        Panel(f"normal force, {force}", list(_of_each(fingers, "normal_n", extent))),
        Panel(f"tangential force, {force}", list(_of_each(fingers, "tangential", extent))),
        Panel(f"spin, {torque}", list(_of_each(fingers, "spin_nm", extent))),
        Panel(f"grip force on one pad, {force}", list(_grip(tracks, fingers))),
        Panel(
            "speed scale that the grip holds",
            list(_curve("of the arm", "now", tracks.grasp["speed_scale"], extent)),
        ),
        Panel(
            "friction coefficient μ",
            [
                *_of_each(fingers, "mu_interval", extent, "interval", "band", steps=True),
                *_of_each(fingers, "mu", extent, "in use", steps=True),
                *_of_each(fingers, "required_friction", extent, "required", "dashed"),
            ],
            most=2.0,
        ),
        StripGroup("source of μ", {name: list(_sources(one, extent)) for name, one, _ in fingers}),
        _health(tracks),
    ]
    return [part for part in parts if (part.curves if isinstance(part, Panel) else part.strips)]


Fingers = Sequence[tuple[str, FingerTracks, str]]
"""Name, tracks and colour of every finger."""


def _curve(
    name: str, colour: str, track: BinnedTrack[Range], extent: Extent, kind: str = "line", *, steps: bool = False
) -> Iterator[Curve]:
    """Yield the curve of a track, unless its value was never known; with ``steps``, a value stays until the next."""
    points = list(track.held(extent))
    if steps:
        points = [corner for point in points for corner in (point, point._replace(begin_s=point.end_s))]
    if any(known(point.value) for point in points):
        yield Curve(name, colour, points, kind)


def _of_each(
    fingers: Fingers, key: str, extent: Extent, what: str = "", kind: str = "line", *, steps: bool = False
) -> Iterator[Curve]:
    """Yield the same quantity of every finger."""
    for name, one, colour in fingers:
        yield from _curve(f"{name}: {what}" if what else name, colour, one.numbers[key], extent, kind, steps=steps)


def _grip(tracks: RunTracks, fingers: Fingers) -> Iterator[Curve]:
    extent = tracks.extent
    both = [curve for name in ("now", "needed") for curve in _curve(name, name, tracks.grasp[name], extent)]
    yield from both or _of_each(fingers, "grip_needed_n", extent, "needed", "dashed")
    yield from _curve("commanded", "commanded", tracks.grasp["commanded"], extent, "dashed", steps=True)


def _levels(finger: FingerTracks, extent: Extent) -> Iterator[Span]:
    for begin_s, until_s, state in finger.level.runs(extent):
        reasons = ", ".join(state.reasons)
        whole = f"{state.level}: {reasons}" if reasons else state.level
        yield Span(begin_s, until_s, state.level, (whole, reasons, state.level) if reasons else (whole,), whole)


def _evidence(name: str, finger: FingerTracks, extent: Extent) -> Iterator[tuple[str, list[Span]]]:
    runs = finger.evidence.runs(extent)
    for kind in sorted({kind for run in runs for kind in run.value}):
        spans = [Span(run.begin_s, run.end_s, "evidence", (), kind) for run in runs if kind in run.value]
        yield f"{name}: {kind}", spans


def _sources(finger: FingerTracks, extent: Extent) -> Iterator[Span]:
    for begin_s, until_s, source in finger.mu_source.runs(extent):
        yield Span(begin_s, until_s, source if source in SPAN_COLOURS else "none", (source,), source)


def _health(tracks: RunTracks) -> StripGroup:
    strips: dict[str, list[Span]] = {}
    notes = []
    for name, stream in sorted(tracks.streams.items()):
        strips[name] = []
        for begin_s, until_s, (code, message) in stream.health.runs(tracks.extent):
            word = HEALTH[code]
            whole = f"{word}: {message}" if message else word
            strips[name].append(Span(begin_s, until_s, word, (whole, word), whole))
        counted = [f"{count} {what}" for what, count in stream.counters.items() if count]
        if stream.masked:
            counted.append(f"{stream.masked} taxels masked")
        if counted:
            notes.append(f"{name}: {', '.join(counted)}")
    return StripGroup("health of the streams", strips, "; ".join(notes))


def stretches(points: Iterable[Held[Range]]) -> Iterator[list[Held[Range]]]:
    """Yield the stretches of a curve between the times at which its value was not known."""
    stretch: list[Held[Range]] = []
    for point in points:
        if stretch and not (known(point.value) and point.begin_s <= stretch[-1].end_s):
            yield stretch
            stretch = []
        if known(point.value):
            stretch.append(point)
    if stretch:
        yield stretch


def ticks(least: float, most: float, about: int) -> list[float]:
    """Return round numbers from ``least`` to ``most``, at most ``about`` steps apart."""
    wanted = (most - least) / about
    power = 10.0 ** math.floor(math.log10(wanted))
    step = next(digit * power for digit in (1.0, 2.0, 5.0, 10.0) if digit * power >= wanted * (1.0 - 1e-9))
    return [n * step for n in range(math.ceil(least / step - 1e-9), math.floor(most / step + 1e-9) + 1)]
