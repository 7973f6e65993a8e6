"""The labels of real grasps: what happened in each trial, and when."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

KINDS = ("slip", "hold", "unclear")
ROWS = ("grasp_row", "begin_row", "onset_row", "far_row", "end_row")
COLUMNS = ("name", "object", "rate_hz", "dropped", "kind", *ROWS)
TIMES = "robot_state.csv"
START_S = 1.0
"""Time of the first row in an imported recording, s."""


class LabelError(Exception):
    """A folder of trials or its labels are not as described; the text names file, line and rule."""


@dataclass(frozen=True, slots=True)
class Label:
    """What happened in one trial; times as in its recording, s.

    Attributes:
        name: Folder of the trial.
        thing: What was grasped.
        kind: "slip", "hold" or "unclear".
        dropped: The object left the hand at the end.
        grasp_s: The object is held from here on.
        end_s: Last time that counts: the drop, or before the hand opens.
        begin_s: The object begins to move over the pads; None without a slip.
        onset_s: It has moved by 5 mm or 5°.
        far_s: It has moved by 10 mm or 10°; None where it never did.
    """

    name: str
    thing: str
    kind: str
    dropped: bool
    grasp_s: float
    end_s: float
    begin_s: float | None
    onset_s: float | None
    far_s: float | None


def read_labels(folder: Path) -> list[Label]:
    """Read ``labels.csv`` and the times of the trials it names.

    Raises:
        LabelError: A file is missing, or a row is not as described in `realgrasps.__main__`.
    """
    path = folder / "labels.csv"
    try:
        with path.open(encoding="utf-8", newline="") as file:
            reader = csv.DictReader(file)
            if missing := [name for name in COLUMNS if name not in (reader.fieldnames or ())]:
                raise LabelError(f"{path}:1: must have the columns {', '.join(COLUMNS)}, lacks {', '.join(missing)}")
            return [_label(folder, row, f"{path}:{reader.line_num}") for row in reader]
    except OSError as error:
        raise LabelError(f"{path}: cannot be read: {error.strerror}") from error


def _label(folder: Path, row: dict[str, str], where: str) -> Label:
    if row["kind"] not in KINDS:
        raise LabelError(f"{where}: kind must be one of {', '.join(KINDS)}, got {row['kind']!r}")
    times_s = list(_times(folder / row["name"] / TIMES))
    at = {name: _time(times_s, row[name], f"{where}: {name}") for name in ROWS}
    needed = ["grasp_row", "end_row", *(["begin_row", "onset_row"] if row["kind"] == "slip" else [])]
    if missing := [name for name in needed if at[name] is None]:
        raise LabelError(f"{where}: a {row['kind']} must have {', '.join(missing)}, got none")
    in_order = [t_s for name in ROWS if (t_s := at[name]) is not None]
    if in_order != sorted(in_order):
        raise LabelError(f"{where}: the rows must be in the order {', '.join(ROWS)}")
    grasp_s, begin_s, onset_s, far_s, end_s = at.values()
    assert grasp_s is not None
    assert end_s is not None
    dropped = row["dropped"] == "1"
    return Label(row["name"], row["object"], row["kind"], dropped, grasp_s, end_s, begin_s, onset_s, far_s)


def _time(times_s: list[float], cell: str, where: str) -> float | None:
    """Return the time of a row, counted from 0, as in the recording; None where the cell is empty."""
    if not cell:
        return None
    if not cell.isdecimal() or int(cell) >= len(times_s):
        raise LabelError(f"{where} must be a row of the trial, 0 to {len(times_s) - 1}, got {cell!r}")
    return START_S + times_s[int(cell)] - times_s[0]


def _times(path: Path) -> Iterator[float]:
    try:
        with path.open(encoding="utf-8", newline="") as file:
            for row in csv.DictReader(file):
                yield float(row["time"])
    except (OSError, KeyError, ValueError) as error:
        raise LabelError(f"{path}: must have a column time of numbers: {error}") from error
