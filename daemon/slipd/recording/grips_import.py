"""Import gripper trials with two XELA pads as recordings.

The source is a trial folder as published with "proactive slip control" (github.com/imanlab/proactive-slip-control):
``xela_sensor1.csv`` and ``xela_sensor2.csv`` with the raw counts of sixteen three-axis taxels per row, and
``robot_state.csv`` with the ``time`` of each row. The counts become the messages that the XELA server would have sent,
so that everything from the decoder on runs as in a live run.
"""

from __future__ import annotations

import csv
import heapq
import math
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slipd import config
from slipd.devices import xela
from slipd.engine.engine import Engine
from slipd.errors import RecordingError
from slipd.events import Bytes, Event, LinkSpec, LinkUp, Tick
from slipd.recording.mcap_file import RecordingFile
from slipd.recording.tare_rows import tared_config

SENSORS = {"1": "xela_sensor1.csv", "2": "xela_sensor2.csv"}
TIMES = "robot_state.csv"
TAXELS = 16
LONGEST_S = 3600.0
"""Longest trial, s: trials last seconds, so a longer one has its times in another unit."""

START_NS = 1_000_000_000
"""Time of the first row, ns; the wall-clock time too, because it is not known."""

TICK_NS = 10_000_000
AFTER_NS = 500_000_000
"""Recorded time after the last row, ns: long enough for every stream to become stale."""

BOOT = "imported"
WELCOME = b'{"message":"Welcome"}'

Counts = NDArray[np.uint16]
_COLUMNS = [f"txl{taxel}_{axis}" for taxel in range(1, TAXELS + 1) for axis in "xyz"]
_COUNT_MAX = 2**16 - 1


def import_trial(source: Path, out: Path, config_text: str, tare_rows: int | None = None) -> None:
    """Write one trial as the recording of a live run with this config.

    The server connects and sends its welcome at ``START_NS``, then one message per row with both pads, at the time of
    the row. A tick comes every 10 ms, until half a second after the last row.

    Args:
        source: Folder of the trial.
        out: Recording to write; an existing one is never overwritten, and a failure leaves no file.
        config_text: Config for the replay, TOML; its pads share one WebSocket address.
        tare_rows: Number of first rows in which the fingers are open: their mean becomes the ``tare`` of the pads in
            the recorded config. None: the config has the tare.

    Raises:
        ConfigError: The config has faults.
        RecordingError: The source is not such a trial (with file, line and rule), the config has no such address,
            the pads are not at rest in the rows of the tare, or ``out`` cannot be written.
    """
    file_name = f"config for {out.name}"
    link = _server(config_text, file_name)
    times_ns = _times_ns(source / TIMES)
    pads = {sensor: _counts(source / name) for sensor, name in SENSORS.items()}
    for sensor, pad in pads.items():
        if len(pad) != len(times_ns):
            path = source / SENSORS[sensor]
            raise RecordingError(f"{path}: must have as many rows as {TIMES}, {len(times_ns)}, got {len(pad)}")
    if tare_rows is not None:
        try:
            config_text = tared_config(config_text, file_name, pads, tare_rows)
        except RecordingError as error:
            raise RecordingError(f"{source}: {error}") from error
    if out.exists():
        raise RecordingError(f"{out}: exists already; give the name of a new file")
    try:
        with tempfile.TemporaryDirectory(dir=out.parent, prefix=".import-") as folder:
            whole = Path(folder) / out.name
            _write(whole, config_text, _events(link, times_ns, pads))
            whole.rename(out)
    except OSError as error:
        raise RecordingError(f"{out}: cannot be written: {error.strerror}") from error


def _server(config_text: str, file_name: str) -> LinkSpec:
    """Return the link over which the config reads both pads."""
    settings = config.parse(config_text, file_name)
    pads = [finger.pad for finger in settings.finger.values() if finger.pad and finger.pad.device == "xela"]
    ports, sensors = {pad.port for pad in pads}, {pad.sensor for pad in pads}
    if len(ports) != 1 or not sensors <= SENSORS.keys():
        raise RecordingError(
            f"{file_name}: must have the XELA sensors {' and '.join(SENSORS)} at one address, "
            f"got {sorted(sensors)} at {len(ports)} addresses"
        )
    links = Engine(settings, boot=BOOT, wall_minus_monotonic_ns=0).links
    return next(link for link in links.values() if link.address in ports)


def _events(link: LinkSpec, times_ns: list[int], pads: dict[str, list[Counts]]) -> Iterator[tuple[int, Event]]:
    """Yield ``(t_ns, event)`` in order of time."""
    ticks = range(START_NS, times_ns[-1] + AFTER_NS + 1, TICK_NS)
    return heapq.merge(
        _server_events(link, times_ns, pads), ((t_ns, Tick()) for t_ns in ticks), key=lambda timed: timed[0]
    )


def _server_events(link: LinkSpec, times_ns: list[int], pads: dict[str, list[Counts]]) -> Iterator[tuple[int, Event]]:
    yield START_NS, LinkUp(link.name, link.address)
    yield START_NS, Bytes(link.name, WELCOME)
    for row, t_ns in enumerate(times_ns):
        counts = {sensor: pad[row] for sensor, pad in pads.items()}
        yield t_ns, Bytes(link.name, xela.encode_message(row, counts, t_ns / 1e9))


def _write(path: Path, config_text: str, events: Iterator[tuple[int, Event]]) -> None:
    file = RecordingFile(path, config_text=config_text, boot=BOOT, wall_minus_monotonic_ns=0)
    try:
        count = 0
        for t_ns, event in events:
            file.event(count, t_ns, event)
            count += 1
        file.finish(count)
    except BaseException:
        file.close()
        raise


def _rows(path: Path, columns: list[str]) -> Iterator[tuple[int, list[str]]]:
    """Yield the line number and the cells of ``columns`` of every row."""
    try:
        with path.open(encoding="utf-8", newline="") as file:
            reader = csv.reader(file, strict=True)
            header = next(reader, [])
            for name in columns:
                if header.count(name) != 1:
                    found = header.count(name)
                    raise RecordingError(f"{path}:1: must have one column {name!r}, got {found}")
            places = [header.index(name) for name in columns]
            for row in reader:
                if len(row) != len(header):
                    raise RecordingError(
                        f"{path}:{reader.line_num}: must have {len(header)} cells, as the header, got {len(row)}"
                    )
                yield reader.line_num, [row[place] for place in places]
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise RecordingError(f"{path}: not a CSV file in UTF-8: {error}") from error


def _number(path: Path, line: int, column: str, cell: str) -> float:
    try:
        number = float(cell)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise RecordingError(f"{path}:{line}: {column} must be a finite number, got {cell!r}")
    return number


def _times_ns(path: Path) -> list[int]:
    """Read the time of each row, ns; the first is at ``START_NS``."""
    times_ns: list[int] = []
    first_s = 0.0
    for line, (cell,) in _rows(path, ["time"]):
        time_s = _number(path, line, "time", cell)
        if not times_ns:
            first_s = time_s
        t_ns = START_NS + round((time_s - first_s) * 1e9)
        if times_ns and t_ns < times_ns[-1]:
            raise RecordingError(f"{path}:{line}: time must not decrease, got {cell} after a later time")
        if time_s - first_s > LONGEST_S:
            raise RecordingError(f"{path}:{line}: time must be in seconds, within an hour of the first row, got {cell}")
        times_ns.append(t_ns)
    if not times_ns:
        raise RecordingError(f"{path}: must have one row for each reading, got none")
    return times_ns


def _counts(path: Path) -> list[Counts]:
    """Read the counts of one pad, one array of shape (taxels, 3) per row."""
    pad = []
    for line, cells in _rows(path, _COLUMNS):
        row = [_number(path, line, *named) for named in zip(_COLUMNS, cells, strict=True)]
        for column, cell, count in zip(_COLUMNS, cells, row, strict=True):
            if not (0 <= count <= _COUNT_MAX and count.is_integer()):
                rule = f"must be an integer from 0 to {_COUNT_MAX}"
                raise RecordingError(f"{path}:{line}: {column} {rule}, got {cell!r}")
        pad.append(np.array(row, dtype=np.uint16).reshape(TAXELS, 3))
    return pad
