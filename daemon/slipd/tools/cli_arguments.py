"""Kinds of arguments of ``slipd``, the recordings that they name, and printed tables."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Collection, Iterable, Sequence
from pathlib import Path

from slipd.errors import UsageError
from slipd_client.arguments import argument, matching, number_in

MOST_HZ = 1000
"""Largest rate of frames; messages are published at 250 Hz unless the config states more."""

EXPORTS = {
    "ros2": "a bag (ROS, Foxglove, PlotJuggler)",
    "csv": "one file for each topic",
    "parquet": "the same with types (pandas, Polars, DuckDB)",
    "lerobot": "a data set for learning (LeRobot), sampled at --rate",
}
"""Formats of an export, and what opens each."""

EVERY = (1, 1)
"""The share of the recordings that is all of them."""

JSON = argument("--json", dest="as_json", action="store_true", help="print the result as one JSON document")


positive = number_in("a positive number", lambda value: value > 0.0)
"""Type of arguments that are above 0."""

time_s = number_in("0 or a positive number", lambda value: value >= 0.0)
"""Type of arguments that are times, s."""

endpoint = matching(r"(.*://.*)?", "be an endpoint such as tcp://127.0.0.1:5555")
"""Type of arguments that are endpoints of ZeroMQ."""

sentence = matching(r"(?s).*\S.*", "be a sentence")
"""Type of arguments that are texts, not empty."""


def file_in(ending: str, more: str = "") -> Callable[[str], Path]:
    """Return a type of arguments: the path of a file with this ending; ``more`` is appended to its error."""

    def path(text: str) -> Path:
        if not text.endswith(ending):
            raise argparse.ArgumentTypeError(f"must end in {ending}, got {text!r}{more}")
        return Path(text)

    return path


def speed(text: str) -> float | None:
    """Return a speed; None: as fast as possible."""
    return None if text == "max" else positive(text)


def rate(text: str) -> int:
    """Return a number of frames per second."""
    if not (text.isdecimal() and 1 <= int(text) <= MOST_HZ):
        raise argparse.ArgumentTypeError(f"must be an integer from 1 to {MOST_HZ}, got {text!r}")
    return int(text)


def shard(text: str) -> tuple[int, int]:
    """Return a share such as ``2/8``: its number, from 1 on, and how many there are."""
    found = re.fullmatch(r"(\d{1,9})/(\d{1,9})", text)
    if found is None or not 1 <= int(found[1]) <= int(found[2]):
        raise argparse.ArgumentTypeError(f"must be I/N with I from 1 to N, such as 2/8, got {text!r}")
    return int(found[1]), int(found[2])


def chosen(paths: Iterable[Path], share: tuple[int, int] = EVERY) -> list[Path]:
    """Return the recordings that are named, each once; of a folder all ``*.mcap`` in and below it, by name.

    The shares of the same recordings have none in common, and together they are all of them.

    Raises:
        UsageError: A folder has no recording.
    """
    found: dict[Path, None] = {}
    for path in paths:
        inside = sorted(path.rglob("*.mcap")) if path.is_dir() else [path]
        if not inside:
            raise UsageError(f"{path}: no recording (*.mcap) in this folder")
        found |= dict.fromkeys(inside)
    number, of = share
    return list(found)[number - 1 :: of]


def aligned(rows: Sequence[Sequence[str]], right: Collection[int] = ()) -> list[str]:
    """Return the lines of a table; columns with these numbers end at one place, the others begin at one."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    sides = [">" if number in right else "<" for number in range(len(widths))]
    return ["  ".join(map("{:{}{}}".format, row, sides, widths)).rstrip() for row in rows]
