"""``slipd info``: what a recording holds, from one pass over it, without a replay."""

from __future__ import annotations

import json
from collections import Counter
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import msgpack

from slipd import config
from slipd.errors import ConfigError
from slipd.recording.entry_walk import Published
from slipd.recording.reader import EventGaps, Recording, open_recording
from slipd.types.device_text import printable
from slipd_client.messages import WARNING_TOPIC


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
        for line in _lines(found):
            print(printable(line))
    return recording.complete


def recording_info(recording: Recording) -> dict[str, Any]:
    """Return what a recording holds; lengths are in s, rates in Hz."""
    gaps, times_ns = EventGaps(), [0, 0]
    kinds: Counter[str] = Counter()
    topics: Counter[str] = Counter()
    levels: Counter[str] = Counter()
    received: Counter[str] = Counter()
    for entry in recording.entries():
        times_ns = [times_ns[0] or entry.t_ns, entry.t_ns]
        if isinstance(entry, Published):
            topics[entry.topic] += 1
            if entry.topic == WARNING_TOPIC:
                levels[msgpack.unpackb(entry.payload)["level"]] += 1
            continue
        gaps.add(entry.t_ns)
        kinds[type(entry.event).__name__] += 1
        if link := getattr(entry.event, "link", None):
            received[link] += len(getattr(entry.event, "data", b""))
    length_s = (times_ns[1] - times_ns[0]) * 1e-9
    begun = datetime.fromtimestamp((times_ns[0] + recording.wall_minus_monotonic_ns) * 1e-9, UTC)
    return {
        "recording": str(recording.path),
        "bytes": recording.size_bytes,
        "complete": recording.complete,
        "fault": recording.gap,
        "begun": begun.isoformat(timespec="milliseconds"),
        "length_s": length_s,
        "gaps": [[gap.begin_s - times_ns[0] * 1e-9, gap.end_s - times_ns[0] * 1e-9] for gap in gaps.found],
        "boot": recording.boot,
        **_rig(recording),
        "versions": recording.versions,
        "events": dict(sorted(kinds.items())),
        "received_bytes": dict(sorted(received.items())),
        "topics": {
            topic: {"messages": count, "rate_hz": count / length_s if length_s else None}
            for topic, count in sorted(topics.items())
        },
        "changes_to_level": dict(levels),
    }


def _rig(recording: Recording) -> dict[str, Any]:
    """Return what the recorded config says; of one with faults for this version of slipd, nothing but these."""
    try:
        rig = config.parse(recording.config_text, f"{recording.path}: config")
    except ConfigError as error:
        return {"config_id": None, "streams": {}, "config_fault": str(error)}
    streams = {name: {"device": stream.device, "rate_hz": stream.rate_hz} for name, stream in rig.streams().items()}
    return {"config_id": rig.config_id, "streams": streams, "config_fault": ""}


def _lines(found: dict[str, Any]) -> list[str]:
    versions = ", ".join(f"{name} {version}" for name, version in found["versions"].items())
    length = f"{found['length_s']:.3f} s from {found['begun']} on, {found['bytes'] / 1e6:.2f} MB"
    lines = [
        f"recording: {found['recording']}",
        f"length:    {length}",
        f"complete:  {'yes' if found['complete'] else 'no: ' + found['fault']}",
        f"boot:      {found['boot']}",
        f"config:    {found['config_id'] or found['config_fault']}",
        f"versions:  {versions}",
        *(f"gap:       nothing is known from {begin_s:.3f} to {end_s:.3f} s" for begin_s, end_s in found["gaps"]),
        "streams:",
        *(
            f"    {name}: {stream['device']}, {stream['rate_hz']:g} Hz, {found['received_bytes'].get(name, 0)} bytes"
            for name, stream in found["streams"].items()
        ),
        "events:",
        *(f"    {name}: {count}" for name, count in found["events"].items()),
        "messages:",
        *(
            f"    {topic}: {each['messages']}" + ("" if each["rate_hz"] is None else f", {each['rate_hz']:.1f} Hz")
            for topic, each in found["topics"].items()
        ),
    ]
    if found["changes_to_level"]:
        counts = ", ".join(f"{level} {count}" for level, count in found["changes_to_level"].items())
        lines.append(f"changes of level to: {counts}")
    return lines
