"""The end of the demo: what slipd reported, compared with the true state of the scene."""

from __future__ import annotations

import os
import statistics
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from slipd.tools.sim.robot_program import Report
from slipd_client.messages import STATUS_TOPIC
from slipd_client.subscriber import Message

Events = dict[str, dict[str, Any]]
"""The first event of each kind."""


@dataclass(slots=True)
class Tally:
    """Counts of a subscriber of every topic.

    Attributes:
        messages: Number of messages of each kind of topic.
        missed: Number of messages that did not arrive.
        latencies_s: Time from the last byte of a reading to its message in this process, s.
        streams: Streams of the newest message ``status``.
    """

    messages: Counter[str] = field(default_factory=Counter)
    missed: int = 0
    latencies_s: list[float] = field(default_factory=list)
    streams: dict[str, dict[str, Any]] = field(default_factory=dict)

    def add(self, message: Message) -> None:
        """Count one message."""
        self.messages[message.topic.partition(".")[0]] += 1
        self.missed += message.missed
        if message.topic.startswith("slip."):
            self.latencies_s.append(message.age_s)
        elif message.topic == STATUS_TOPIC:
            self.streams = message.raw["streams"]


def print_summary(tally: Tally, report: Report, truth: list[dict[str, Any]]) -> None:
    """Print what happened, what slipd reported about it, and how many messages there were."""
    events = {event["event"]: event for event in reversed(truth)}  # the first of each kind
    begin = events["begin"]["t_ns"] if "begin" in events else report.activated_ns

    def at(t_ns: int) -> str:
        return f"{(t_ns - begin) * 1e-9:6.2f} s" if begin is not None else "     ? s"

    print("\nThe scene, and what slipd reported:")
    lines = [(event["t_ns"], f"truth    {_truth_line(event)}") for event in truth if event.get("t_s") is not None]
    lines += [
        (c.t_ns, f"slipd    {c.finger}: {c.level} ({', '.join(c.reasons) or 'no reasons'})") for c in report.changes
    ]
    lines += [(t_ns, f"program  moves {what}") for t_ns, what in report.moves]
    for r in report.raises:
        applied = f"granted {r.result['applied_n']:.1f} N" if r.result else f"refused: {r.refusal}"
        measured = f"; measured {_n(r.before_n)} → {_n(r.after_n)}"
        lines.append((r.requested_ns, f"program  requests {r.requested_n:.1f} N on each pad: {applied}{measured}"))
    for t_ns, line in sorted(lines):
        print(f"  {at(t_ns)}  {line}")
    for line in _carry_lines(truth, events) if report.moves else _verdict_lines(report, events):
        print(line)
    lost = sum(stream["lost"] for stream in tally.streams.values())
    bad = sum(stream["bad"] for stream in tally.streams.values())
    latency = statistics.median(tally.latencies_s) * 1e3 if tally.latencies_s else float("nan")
    print(f"readings: {sum(stream['samples'] for stream in tally.streams.values())} ({bad} bad, {lost} lost)")
    counts = ", ".join(f"{count} {kind}" for kind, count in sorted(tally.messages.items()))
    print(f"messages: {tally.messages.total()} ({counts})")
    alarms = sum(change.rising and change.level in ("warning", "slipping") for change in report.changes)
    unknowns = sum(change.level == "unknown" for change in report.changes)
    print(f"warnings: {alarms} (unknown: {unknowns}; changes of level: {len(report.changes)})")
    for line in _shortfall(report, events, tally.missed, lost):
        print(line)
    print(f"gaps: {tally.missed}")
    print(f"median latency: {latency:.2f} ms from the last byte of a reading to its message here")
    if report.error:
        print(f"the robot program ended early: {report.error}", file=sys.stderr)


def _carry_lines(truth: list[dict[str, Any]], events: Events) -> Iterator[str]:
    """Yield whether the glass slid, and how far."""
    moved_m = max(
        (event["displacement_m"] for event in truth if event["event"] in ("slide_ends", "dropped")), default=0.0
    )
    yield f"glass: slid by {1000 * moved_m:.0f} mm" if "slide_begins" in events else "glass: did not slip"


def _verdict_lines(report: Report, events: Events) -> Iterator[str]:
    warned, reported = report.rotation_warning, report.slip_report
    forecast_s = events.get("forecast", {}).get("rotation_would_begin_s")
    if warned is not None and forecast_s is not None:
        lead_s = forecast_s - (warned.t_ns - events["begin"]["t_ns"]) * 1e-9
        yield f"rotation: warned {lead_s:.2f} s before it would have begun at the first grip force"
    if reported is not None and "slide_begins" in events:
        yield f"slip: reported {(reported.t_ns - events['slide_begins']['t_ns']) * 1e-6:.0f} ms after it began"


def _shortfall(report: Report, events: Events, missed: int, lost: int) -> Iterator[str]:
    """Yield what the scene should have shown and did not, why, and what to do."""
    dropped = sum(events.get("end", {}).get("dropped_bytes", {}).values())
    missing = [f"the robot program ended early ({report.error})"] if report.error else []
    if "hold" in events and report.rotation_warning is None:
        missing.append("the rotation was not warned of")
    if "slide_begins" in events and report.slip_report is None:
        missing.append("the slip was not reported")
    if not missing:
        if "hold" not in events and not report.moves:
            yield "ended before the box would turn: no warning is due yet"
        return
    load, processors = os.getloadavg()[0], os.cpu_count() or 1
    found = (
        (dropped, f"{dropped} bytes of the sensors were not read in time"),
        (lost, f"{lost} readings were lost"),
        (missed, f"{missed} messages were missed"),
        (len(report.refusals), f"{len(report.refusals)} requests were too late or refused"),
        (load > processors, f"{load:.1f} programs computed on {processors} processors"),
    )
    yield f"NOT AS EXPECTED: {'; '.join(missing)}"
    if reasons := [text for is_so, text in found if is_so]:
        yield f"this machine was too busy: {', '.join(reasons)}"
        yield "end other programs that compute, then run the demo again; slipd demo --headless needs less"


def _truth_line(event: dict[str, Any]) -> str:
    values = {key: value for key, value in event.items() if key not in ("t_s", "t_ns", "event") and value is not None}
    shown = ", ".join(
        f"{key} {value:.3g}" if isinstance(value, float) else f"{key} {value}" for key, value in values.items()
    )
    return f"{event['event']}" + (f" ({shown})" if shown else "")


def _n(force_n: float | None) -> str:
    return "unknown" if force_n is None else f"{force_n:.1f} N"
