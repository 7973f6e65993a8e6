"""``slipd import``: writes measurements from elsewhere as the recording of a live run; what all importers share."""

from __future__ import annotations

import contextlib
import heapq
import pkgutil
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any

from slipd import config
from slipd.engine.engine import Engine
from slipd.errors import RecordingError
from slipd.events import Event, LinkSpec, LinkUp, Request, Tick
from slipd.recording.mcap_file import EVENTS, RecordingFile, RunHead
from slipd.tools.outputs import NEW, draft
from slipd.tools.shipped_files import shipped_config

START_NS = 1_000_000_000
"""Time of the first row, ns; the wall-clock time too, because it is not known."""

TICK_NS = 10_000_000
AFTER_NS = 500_000_000
"""Recorded time after the last row, ns: long enough for every stream to become stale."""

BOOT = "imported"


def import_command(importer: str, shipped: str, source: Path, out: Path, config_file: Path | None, **more: Any) -> None:
    """Import data, and print what follows.

    Args:
        importer: What imports them, "module:function": it takes source, recording and text of the config, and may
            return what it found, for people.
        shipped: Name of the shipped config of their format.
        source: The data.
        out: New recording.
        config_file: Config; None: the shipped one.
        more: What this format alone needs.

    Raises:
        SlipdError: The source or the config has faults, or the recording cannot be written.
    """
    rig = config.load(config_file or shipped_config(shipped))
    for finding in pkgutil.resolve_name(importer)(source, out, rig.text, **more) or ():
        print(finding)
    print(f"{out}: written; replay it with: slipd replay {out} --speed max")


def source_of(config_text: str, file_name: str, device: str, sensors: Collection[str]) -> tuple[str, LinkSpec]:
    """Return the finger with the sensors of a source, and the link over which a run with this config reads them.

    Args:
        config_text: The config, TOML.
        file_name: Its name, for errors.
        device: Device that the source becomes.
        sensors: Its sensors; the config may leave out some of them.

    Raises:
        ConfigError: The config has faults.
        RecordingError: The config has other sensors of this device, or at several addresses.
    """
    settings = config.parse(config_text, file_name)
    streams = {name: stream for name, stream in settings.streams().items() if stream.device == device}
    ports = {stream.port for stream in streams.values()}
    found = {stream.sensor for stream in streams.values()}
    if len(ports) != 1 or not found <= set(sensors):
        raise RecordingError(
            f"{file_name}: must have the {device} sensors {' and '.join(sensors)} at one address, "
            f"got {sorted(found)} at {len(ports)} addresses"
        )
    links = Engine(settings, boot=BOOT, wall_minus_monotonic_ns=0).links.values()
    return next(iter(streams)).partition(".")[0], next(link for link in links if link.address in ports)


def tare_request(finger: str, t_ns: int, length_ns: int) -> tuple[int, Event]:
    """Return the request at ``t_ns`` that tares a finger for ``length_ns``."""
    body = {"v": 1, "id": 1, "op": "tare", "boot": BOOT, "deadline_ns": t_ns + length_ns, "finger": finger}
    return t_ns, Request(b"import", {**body, "stream": "all", "seconds": length_ns * 1e-9})


def write_run(out: Path, config_text: str, link: LinkSpec, last_ns: int, *events: Iterable[tuple[int, Event]]) -> None:
    """Write a run: the link comes up at ``START_NS``, and ticks come every 10 ms until 0.5 s after the last row.

    Args:
        out: Recording to write; an existing one is never overwritten, and a failure leaves no file.
        config_text: Config for the replay, TOML.
        link: The link of the sensors.
        last_ns: Time of the last row, ns.
        events: ``(t_ns, event)``, each in order of time.

    Raises:
        UsageError: ``out`` exists.
        SlipdError: ``out`` cannot be written.
    """
    up = [(START_NS, LinkUp(link.name, link.address))]
    ticks = ((t_ns, Tick()) for t_ns in range(START_NS, last_ns + AFTER_NS + 1, TICK_NS))
    with draft(out, NEW) as path:
        file = RecordingFile(path, RunHead(config_text, BOOT, 0))
        with contextlib.closing(file):
            count = 0
            for t_ns, event in heapq.merge(up, *events, ticks, key=lambda timed: timed[0]):
                file.add(count, t_ns, EVENTS, event)
                count += 1
            file.finish(count)
