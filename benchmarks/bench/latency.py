"""Measure the latency and the cost of the daemon, and the speed and accuracy of the friction limit.

    make bench    (about 18 minutes; writes build/measured/bench.md)
    make bench BENCH='--only replay --only recording'    (these parts; the others of that report stay)
    PYTHONPATH=tests/support:benchmarks python -m bench.latency [--quick] [--only PART] [--report FILE]

The daemon is measured from the last byte of a reading to the message that follows.
Absolute times hold for this machine and its present load. Ratios carry over to other machines: beside the daemon and
the solver, programs in C and other solvers do the same work in the same minutes. The report is printed, and
``--report`` also writes it as Markdown, part by part as they are measured.
"""

from __future__ import annotations

import argparse
import signal
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

import zmq
from bench import (
    chain,
    child,
    full_load,
    million,
    processes,
    ratios,
    recorded,
    replaying,
)
from bench.commit import measured_on
from bench.report import Report
from bench.tables import Table

SECONDS, ROUNDS, WARM_UP_S = 5.0, 4, 2.0
QUICK_SECONDS, QUICK_ROUNDS, QUICK_WARM_UP_S = 0.5, 1, 1.5
SHORTEST_S, LONGEST_S = 0.1, 20.0
"""Less has no percentiles; the readings carry their number as a pull, which grows too large for the grip in more."""

PARTS = ("chain", "load", "recording", "replay", "ratios", "million")

FULL_LOAD_TIMES = 6
"""The full load takes as many times as long as a round, to show what builds up."""

REPLAY_TIMES = 4
"""The replayed recording is as many times as long as a round."""


def main() -> int:
    """Measure and print; returns the exit code."""
    options = _parser().parse_args()
    seconds = options.seconds or (QUICK_SECONDS if options.quick else SECONDS)
    rounds = options.rounds or (QUICK_ROUNDS if options.quick else ROUNDS)
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda number, _: sys.exit(128 + number))  # what is open is closed on the way out
    version = f"libzmq {zmq.zmq_version()}"
    print(f"slipd bench: {measured_on(version)}", flush=True)
    try:
        report = None if options.report is None else Report(options.report, PARTS)
        for part in [name for name in PARTS if name in (options.only or PARTS)]:
            measured, tables = measured_on(version), []
            for table in _measure(part, seconds, rounds, quick=options.quick):
                print(table.text(), flush=True)
                tables.append(table)
            if report is not None:
                report.put(part, measured, tables)
    except (child.BenchError, ValueError) as error:
        print(f"bench: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 128 + signal.SIGINT
    return 0


def _measure(part: str, seconds: float, rounds: int, *, quick: bool) -> Iterable[Table]:
    """The tables of one part."""
    if part == "million":
        return million.run(*((million.QUICK_SCENES, million.QUICK_CHECKED) if quick else ()))
    with tempfile.TemporaryDirectory(prefix="slipd-bench-") as name:
        return list(_in_folder(part, Path(name), seconds, rounds, quick=quick))


def _in_folder(part: str, folder: Path, seconds: float, rounds: int, *, quick: bool) -> Iterable[Table]:
    """The tables of a part that needs a folder for sockets, programs and recordings."""
    warm_up_s = QUICK_WARM_UP_S if quick else WARM_UP_S
    if part == "chain":
        built = processes.build_floor(folder)
        return [chain.run(folder, built, rounds=rounds, seconds=seconds, warm_up_s=warm_up_s)]
    if part == "load":
        return full_load.run(folder, seconds=FULL_LOAD_TIMES * seconds, warm_up_s=warm_up_s)
    if part == "recording":
        return [recorded.run(folder, rounds=rounds, seconds=seconds, warm_up_s=warm_up_s)]
    if part == "replay":
        return [replaying.run(folder, seconds=REPLAY_TIMES * seconds, quick=quick)]
    return ratios.run(folder, quick=quick)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m bench.latency", description="Measure the daemon and the friction limit on this machine."
    )
    parser.add_argument(
        "--only", action="append", choices=PARTS, help="measure this part only; may be repeated (default: all)"
    )
    parser.add_argument("--seconds", type=_seconds, metavar="S", help=f"length of each round (default {SECONDS:g})")
    parser.add_argument(
        "--rounds", type=_count, metavar="N", help=f"rounds of the daemon and of the C program (default {ROUNDS})"
    )
    parser.add_argument(
        "--quick", action="store_true", help="a short run, at most a minute, to check the program itself"
    )
    parser.add_argument("--report", type=Path, metavar="FILE", help="also write the report as Markdown")
    return parser


def _seconds(text: str) -> float:
    value = float(text)
    if not SHORTEST_S <= value <= LONGEST_S:
        raise argparse.ArgumentTypeError(f"must be from {SHORTEST_S:g} to {LONGEST_S:g}, got {text}")
    return value


def _count(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"must be at least 1, got {text}")
    return value


if __name__ == "__main__":
    sys.exit(main())
