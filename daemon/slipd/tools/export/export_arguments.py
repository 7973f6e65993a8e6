"""The arguments of ``slipd export``."""

from __future__ import annotations

import argparse
from pathlib import Path

from slipd.tools.cli_arguments import add_recordings

FORMATS = {
    "ros2": "a bag (ROS, Foxglove, PlotJuggler)",
    "json-mcap": "JSON (Foxglove)",
    "csv": "one file for each topic",
    "parquet": "the same with types (pandas, Polars, DuckDB)",
    "lerobot": "a data set for learning (LeRobot), at --rate",
}
"""Formats, and what opens each."""

MOST_HZ = 1000
"""Largest rate of frames; messages are published at 250 Hz unless the config states more."""

_EPILOG = (
    "The recording is replayed, so the messages are those of this version of slipd. docs/viewers.md says which program "
    "opens what, docs/recordings.md what a data set for learning holds. Exit code 1: nothing is written, or a "
    "recording is damaged and the export ends there."
)


def add_export_arguments(parser: argparse.ArgumentParser) -> None:
    """Add them to the parser of the command."""
    parser.epilog = _EPILOG
    add_recordings(parser, "recording, MCAP; for lerobot also several, or folders of them: each is an episode")
    parser.add_argument("out", type=Path, metavar="OUT", help="new folder, or new file (json-mcap)")
    parser.add_argument(
        "--to",
        choices=tuple(FORMATS),
        required=True,
        help="; ".join(f"{name}: {what}" for name, what in FORMATS.items()),
    )
    parser.add_argument("--rate", type=_rate, metavar="HZ", help="frames per second, of lerobot")
    parser.add_argument("--task", type=_task, metavar="TEXT", help="what the robot does, in a sentence, of lerobot")
    parser.add_argument("--overwrite", action="store_true", help="replace an earlier export, never anything else")


def _rate(text: str) -> int:
    if not (text.isdecimal() and 1 <= int(text) <= MOST_HZ):
        raise argparse.ArgumentTypeError(f"must be an integer from 1 to {MOST_HZ}, got {text!r}")
    return int(text)


def _task(text: str) -> str:
    if not text.strip():
        raise argparse.ArgumentTypeError("must be a sentence, got an empty text")
    return text
