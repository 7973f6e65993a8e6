"""Import gripper trials with two XELA pads as recordings.

The source is a trial folder as published with "proactive slip control" (github.com/imanlab/proactive-slip-control):
``xela_sensor1.csv`` and ``xela_sensor2.csv`` with the raw counts of sixteen three-axis taxels per row, and
``robot_state.csv`` with the ``time`` of each row. The counts become the messages that the XELA server would have sent,
so that everything from the decoder on runs as in a live run.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slipd import config
from slipd.errors import RecordingError
from slipd.events import Bytes, Event, LinkSpec
from slipd.tools.commission.config_update import with_value
from slipd.tools.recordings.imported_run import START_NS, source_of, write_run
from slipd.tools.sim.emulated_pads import encode_message
from slipd.types.arrays import Array

SENSORS = {"1": "xela_sensor1.csv", "2": "xela_sensor2.csv"}
TIMES = "robot_state.csv"
TAXELS = 16
LONGEST_S = 3600.0
"""Longest trial, s: trials last seconds, so a longer one has its times in another unit."""

WELCOME = b'{"message":"Welcome"}'

FEWEST_ROWS = 5
"""Fewest rows of a tare: fewer do not show whether the pad is at rest."""

REST = 0.5
"""The force on a pad at rest stays within this share of ``min_normal_n`` of its mean, so that the zero is known better
than what counts as a contact."""

DIGITS = 1
"""Decimals of a count in the config: the noise of the mean of 40 readings of some counts."""

Counts = NDArray[np.uint16]
_COLUMNS = [f"txl{taxel}_{axis}" for taxel in range(1, TAXELS + 1) for axis in "xyz"]
_COUNT_MAX = 2**16 - 1


def import_trial(source: Path, out: Path, config_text: str, tare_rows: int | None = None) -> list[str]:
    """Write one trial as the recording of a live run with this config; return what the tare found, for people.

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
    _, link = source_of(config_text, file_name, "xela", SENSORS)
    times_ns = _times_ns(source / TIMES)
    pads = {sensor: _counts(source / name) for sensor, name in SENSORS.items()}
    for sensor, pad in pads.items():
        if len(pad) != len(times_ns):
            path = source / SENSORS[sensor]
            raise RecordingError(f"{path}: must have as many rows as {TIMES}, {len(times_ns)}, got {len(pad)}")
    findings: list[str] = []
    if tare_rows is not None:
        try:
            config_text, findings = tared_config(config_text, file_name, pads, tare_rows)
        except RecordingError as error:
            raise RecordingError(f"{source}: {error}") from error
    write_run(out, config_text, link, times_ns[-1], _server_events(link, times_ns, pads))
    return findings


def _server_events(link: LinkSpec, times_ns: list[int], pads: dict[str, Counts]) -> Iterator[tuple[int, Event]]:
    yield START_NS, Bytes(link.name, WELCOME)
    for row, t_ns in enumerate(times_ns):
        counts = {sensor: pad[row] for sensor, pad in pads.items()}
        yield t_ns, Bytes(link.name, encode_message(row, counts, t_ns / 1e9))


def _columns(path: Path, names: list[str]) -> Array:
    """Read columns of numbers of a CSV file, shape (rows, columns)."""
    try:
        with path.open(encoding="utf-8") as file, warnings.catch_warnings(action="ignore"):  # of a file without rows
            header = file.readline().strip().split(",")
            for name in names:
                if header.count(name) != 1:
                    raise RecordingError(f"{path}:1: must have one column {name!r}, got {header.count(name)}")
            return np.loadtxt(file, delimiter=",", usecols=[header.index(name) for name in names], ndmin=2)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise RecordingError(f"{path}: must be a table of numbers in CSV: {error}") from error


def _check(path: Path, names: list[str], numbers: Array, good: NDArray[np.bool_], rule: str) -> None:
    """Refuse the first number that is not good."""
    for row, column in np.argwhere(~good)[:1]:
        raise RecordingError(f"{path}:{row + 2}: {names[column]} {rule}, got {numbers[row, column]:g}")


def _times_ns(path: Path) -> list[int]:
    """Read the time of each row, ns; the first is at ``START_NS``."""
    times_s = _columns(path, ["time"])
    if not len(times_s):
        raise RecordingError(f"{path}: must have one row for each reading, got none")
    since_s = times_s - times_s[0]
    _check(path, ["time"], times_s, since_s <= LONGEST_S, "must be in seconds, within an hour of the first row")
    _check(path, ["time"], times_s, np.diff(since_s, axis=0, prepend=0.0) >= 0.0, "must not decrease")
    return [START_NS + round(1e9 * each_s) for each_s in since_s[:, 0].tolist()]


def _counts(path: Path) -> Counts:
    """Read the counts of one pad, shape (rows, taxels, 3)."""
    counts = _columns(path, _COLUMNS)
    whole = (counts >= 0) & (counts <= _COUNT_MAX) & (counts == np.floor(counts))
    _check(path, _COLUMNS, counts, whole, f"must be an integer from 0 to {_COUNT_MAX}")
    return counts.astype(np.uint16).reshape(-1, TAXELS, 3)


def tared_config(config_text: str, file_name: str, pads: Mapping[str, Counts], rows: int) -> tuple[str, list[str]]:
    """Return a config whose XELA pads have the mean of the first rows of a trial as their ``tare``, and what was found.

    Args:
        config_text: The config, TOML; other values and comments stay.
        file_name: Its name, for errors.
        pads: Counts of each sensor, shape (rows of the trial, taxels, 3).
        rows: Number of first rows without load.

    Raises:
        ConfigError: The config has faults.
        RecordingError: There are too few or too many rows, a pad is not at rest in them, or the config cannot hold the
            key ``tare``.
    """
    count = len(next(iter(pads.values())))
    if not FEWEST_ROWS <= rows <= count:
        raise RecordingError(f"tare-rows must be from {FEWEST_ROWS} to {count}, the rows of the trial, got {rows}")
    text, findings = config_text, list[str]()
    for name, finger in config.parse(config_text, file_name).finger.items():
        if finger.pad is None or finger.pad.device != "xela":
            continue
        pad = finger.pad
        counts = pads[pad.sensor].astype(np.float64)
        zero = counts[:rows].mean(axis=0)
        forces = (counts - zero).sum(axis=1) * np.array(pad.axis_scale)
        findings.extend(_findings(f"finger {name}, sensor {pad.sensor}", forces, rows, finger.min_normal_n))
        lines = [f"    {', '.join(map(repr, row))}," for row in zero.round(DIGITS).reshape(TAXELS // 4, -1).tolist()]
        comment = f"unloaded counts, x y z of each taxel: mean of the first {rows} rows of the trial"
        try:
            text = with_value(text, ("finger", name, "pad", "tare"), "\n".join(["[", *lines, "]"]), comment)
        except ValueError as error:
            raise RecordingError(f"{file_name}: {error}") from error
    config.parse(text, f"{file_name} with the tare of {rows} rows")
    return text, findings


def _findings(pad: str, forces: Array, rows: int, min_normal: float) -> Iterator[str]:
    """Yield what the tare of a pad found; refuse rows in which it moves, because then no zero is known.

    A pull is no reason to refuse: the run marks such readings as not trusted.

    Args:
        pad: What to call it.
        forces: Force on the pad above the zero, shape (rows of the trial, 3), in the unit of its ``axis_scale``.
        rows: Number of rows without load.
        min_normal: Least normal force of a contact, in the same unit.
    """
    away = np.linalg.norm(forces[:rows], axis=1)
    limit = REST * min_normal
    if away.max() > limit:
        raise RecordingError(
            f"{pad}: must be at rest in the first {rows} rows, within {limit:g} of their mean "
            f"({REST:g} · min_normal_n), got {away.max():.4g} in row {away.argmax() + 1}: give fewer rows"
        )
    yield f"{pad}: zero from the first {rows} rows, at rest within {away.max():.3g}"
    pull = forces[:, 2]  # the force on the finger points into the pad, so a pull is positive
    pulled = int((pull > min_normal).sum())
    if not pulled:
        return
    pressed = int((pull < -min_normal).sum())
    cause = (
        "it was pressed in the first rows, or axis_scale has a wrong sign"
        if pulled > pressed
        else "crosstalk of pressed taxels, for example"
    )
    yield (
        f"{pad}: reads a pull in {pulled} rows, of up to {pull.max():.4g} in row {pull.argmax() + 1}, and is pressed "
        f"in {pressed}: {cause}; in the run these readings are no contact, or not trusted"
    )
