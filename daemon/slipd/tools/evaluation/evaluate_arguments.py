"""The arguments of ``slipd evaluate``."""

from __future__ import annotations

import argparse
from pathlib import Path

from slipd.tools.cli_arguments import add_recordings
from slipd.tools.evaluation.recording_choice import EVERY, Shard

_EPILOG = (
    "The recorded motion stays as it was: a config changes what is reported on it, not what the robot would have done "
    "about that. The zero of a pad stays that of the recording too. Results are kept: what was replayed once with a "
    "config is not replayed again, and an interrupted evaluation goes on. Exit code 1: a recording is damaged, or does "
    "not fit a config; the others are evaluated. docs/fleet.md covers large batches and clusters."
)


def add_evaluate_arguments(parser: argparse.ArgumentParser) -> None:
    """Add them to the parser of the command."""
    parser.epilog = _EPILOG
    add_recordings(parser, "recordings, MCAP; of a folder, all *.mcap in and below it")
    parser.add_argument(
        "--config",
        type=Path,
        action="append",
        default=[],
        metavar="FILE",
        help="replay with this config too, beside the recorded one; may be given several times",
    )
    shown = parser.add_mutually_exclusive_group()
    shown.add_argument("--out", type=Path, metavar="FOLDER", help="draw the levels over time into levels.svg there")
    shown.add_argument(
        "--table",
        type=Path,
        metavar="FILE",
        help="write a Parquet file with one row for each recording and config, and print only its totals",
    )
    parser.add_argument("--json", action="store_true", help="print all figures as one JSON list")
    parser.add_argument(
        "--shard",
        type=_shard,
        default=EVERY,
        metavar="I/N",
        help="take only this share of the recordings, the I-th of N: one for each machine of a cluster",
    )
    parser.add_argument(
        "--dask", metavar="ADDRESS", help="replay on the workers of this Dask scheduler, e.g. tcp://10.0.0.5:8786"
    )
    parser.add_argument(
        "--results",
        type=Path,
        metavar="FOLDER",
        help="keep all results in this folder, which several machines may share, instead of the newest in the cache",
    )


def _shard(text: str) -> Shard:
    try:
        return Shard.parse(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
