"""``slipd info``: what a recording holds, from one pass over it, without a replay."""

from __future__ import annotations

import json
from collections import Counter
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import msgpack

from slipd.errors import ConfigError, printable
from slipd.events import Bytes
from slipd.recording.reader import EventGaps, Recording, open_recording
from slipd_client.messages import WARNING_TOPIC

MOST_GAPS = 3
"""Most gaps that are printed one by one; the JSON document has all."""


def info_command(path: Path, *, as_json: bool) -> bool:
    """Print what a recording holds; as JSON one document.

    Returns:
        Whether it is complete.

    Raises:
        RecordingError: The file cannot be read, or is not a recording.
    """
    recording = open_recording(path)
    found = recording_info(recording)
    if as_json:
        print(json.dumps(found, ensure_ascii=False))
    else:
        damaged = recording.fault is not None and not recording.stopped
        for line in _lines(found, repairable=damaged or not recording.closed):
            print(printable(line))
    return recording.complete


def recording_info(recording: Recording) -> dict[str, Any]:
    """Return what a recording holds; lengths are in s, rates in Hz."""
    begin_ns, _ = next(recording.events(), (0, None))
    gaps = EventGaps(begin_ns)
    kinds: Counter[str] = Counter()
    topics: Counter[str] = Counter()
    levels: Counter[str] = Counter()
    reads: Counter[str] = Counter()
    received: Counter[str] = Counter()
    for _, t_ns, topic, content in recording.entries():
        if isinstance(content, bytes):
            topics[topic] += 1
            if topic == WARNING_TOPIC:
                levels[msgpack.unpackb(content)["level"]] += 1
            continue
        gaps.add(t_ns)
        kinds[type(content).__name__] += 1
        if isinstance(content, Bytes):
            reads[content.link] += 1
            received[content.link] += len(content.data)
    length_s = gaps.newest_s or 0.0

    def rate(count: int) -> float | None:
        return count / length_s if length_s else None

    begun = datetime.fromtimestamp((begin_ns + recording.wall_minus_monotonic_ns) * 1e-9, UTC)
    return {
        "recording": str(recording.path),
        "bytes": recording.size_bytes,
        "complete": recording.complete,
        "fault": recording.missing,
        "begun": begun.isoformat(timespec="milliseconds"),
        "length_s": length_s,
        "gaps": [list(gap) for gap in gaps.found],
        "boot": recording.boot,
        **_rig(recording),
        "links": {
            link: {"reads": count, "reads_hz": rate(count), "bytes": received[link]}
            for link, count in sorted(reads.items())
        },
        "versions": recording.versions,
        "events": dict(sorted(kinds.items())),
        "topics": {topic: {"messages": count, "rate_hz": rate(count)} for topic, count in sorted(topics.items())},
        "changes_to_level": dict(levels),
    }


def _rig(recording: Recording) -> dict[str, Any]:
    """Return what the recorded config says; of one with faults for this version of slipd, nothing but these."""
    try:
        rig = recording.settings()
    except ConfigError as error:
        return {"config_id": None, "streams": {}, "config_fault": str(error)}
    streams = {name: {"device": stream.device, "rate_hz": stream.rate_hz} for name, stream in rig.streams().items()}
    return {"config_id": rig.config_id, "streams": streams, "config_fault": ""}


def _lines(found: dict[str, Any], *, repairable: bool) -> list[str]:
    streams, topics = found["streams"], found["topics"]
    versions = ", ".join(f"{name} {version}" for name, version in found["versions"].items())
    gaps, more = found["gaps"], found["gaps"][MOST_GAPS:]
    missing_s = sum(end_s - begin_s for begin_s, end_s in more)
    lines = [
        f"recording: {found['recording']}",
        f"length:    {found['length_s']:.3f} s from {found['begun']} on, {found['bytes'] / 1e6:.2f} MB",
        f"complete:  {'yes' if found['complete'] else 'no: ' + found['fault']}",
        *([f"to repair: slipd recover {found['recording']} OUT writes all that is intact"] if repairable else []),
        f"boot:      {found['boot']}",
        f"config:    {found['config_id'] or found['config_fault']}",
        f"versions:  {versions}",
        *(f"gap:       nothing is known from {begin_s:.3f} to {end_s:.3f} s" for begin_s, end_s in gaps[:MOST_GAPS]),
        *([f"           nor in {len(more)} more gaps, {missing_s:.3f} s in all (--json has each)"] if more else []),
        "streams:",
        *(f"    {name}: {each['device']}, {each['rate_hz']:g} Hz in the config" for name, each in streams.items()),
        "links:",
        *(
            f"    {name}: {each['bytes']} bytes in {_rated(each['reads'], 'reads', each['reads_hz'])}"
            for name, each in found["links"].items()
        ),
        "events:    " + ", ".join(f"{count} {name}" for name, count in found["events"].items()),
        "messages:" if topics else "messages:  none; slipd replay and slipd plot make them of events",
        *(f"    {name}: {_rated(each['messages'], 'messages', each['rate_hz'])}" for name, each in topics.items()),
    ]
    if found["changes_to_level"]:
        counts = ", ".join(f"{level} {count}" for level, count in found["changes_to_level"].items())
        lines.append(f"changes of level to: {counts}")
    return lines


def _rated(count: int, what: str, rate_hz: float | None) -> str:
    return f"{count} {what}" + ("" if rate_hz is None else f", {rate_hz:.1f} Hz")
