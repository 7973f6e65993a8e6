"""Measure the latency and the cost of the daemon, and the speed and accuracy of the friction limit.

    make bench    (about 16 minutes; writes docs/bench.md)
    PYTHONPATH=tests/support:tests/lab python -m bench.latency [--quick] [--only PART] [--report FILE]

The daemon is measured from the last byte of a reading to the message, the reply or the gripper command that follows.
Absolute times hold for this machine and its present load. Ratios carry over to other machines: beside the daemon and
the solver, programs in C and other solvers do the same work in the same minutes. The report is printed, and
``--report`` also writes it as Markdown.
"""

from __future__ import annotations

import argparse
import signal
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import zmq
from bench import chain, child, first_call, full_load, million, priority, processes, ratios, reflex, requests, units
from bench.commit import measured_on
from bench.tables import Table

SECONDS, ROUNDS, WARM_UP_S = 5.0, 4, 1.0
QUICK_SECONDS, QUICK_ROUNDS, QUICK_WARM_UP_S = 0.5, 1, 0.5
SHORTEST_S, LONGEST_S = 0.1, 20.0
"""Less has no percentiles; the readings carry their number as a pull, which grows too large for the grip in more."""

PARTS = ("chain", "load", "requests", "reflex", "priority", "ratios", "first", "units", "million")

TRIALS, QUICK_TRIALS = 30, 3
"""Of the reflex in a round, of each kind; a third of a second each."""

FULL_LOAD_TIMES = 6
"""The full load takes as many times as long as a round, to show what builds up."""


def main() -> int:
    """Measure and print; returns the exit code."""
    options = _parser().parse_args()
    seconds = options.seconds or (QUICK_SECONDS if options.quick else SECONDS)
    rounds = options.rounds or (QUICK_ROUNDS if options.quick else ROUNDS)
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda number, _: sys.exit(128 + number))  # what is open is closed on the way out
    header = measured_on(f"libzmq {zmq.zmq_version()}")
    print(f"slipd bench: {header}", flush=True)
    pages = [f"# Measurements\n\n{header}."]
    try:
        for table in _sections(options.only or PARTS, seconds, rounds, quick=options.quick):
            print(table.text(), flush=True)
            pages.append(table.markdown())
    except child.BenchError as error:
        print(f"bench: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 128 + signal.SIGINT
    if options.report:
        options.report.write_text("\n".join(pages) + "\n", encoding="utf-8")
    return 0


def _sections(parts: Sequence[str], seconds: float, rounds: int, *, quick: bool) -> Iterator[Table]:
    warm_up_s = QUICK_WARM_UP_S if quick else WARM_UP_S
    with tempfile.TemporaryDirectory(prefix="slipd-bench-") as name:
        folder = Path(name)
        if "chain" in parts:
            built = processes.build_floor(folder)
            yield chain.run(folder, built, rounds=rounds, seconds=seconds, warm_up_s=warm_up_s)
        if "load" in parts:
            yield from full_load.run(folder, seconds=FULL_LOAD_TIMES * seconds, warm_up_s=warm_up_s)
        if "requests" in parts:
            yield requests.run(folder, rounds=rounds, seconds=seconds)
        if "reflex" in parts:
            yield from reflex.run(folder, rounds=rounds, trials=QUICK_TRIALS if quick else TRIALS)
        if "priority" in parts:
            hogs = priority.QUICK_HOGS if quick else priority.HOGS
            yield priority.run(folder, rounds=rounds, seconds=seconds, warm_up_s=warm_up_s, hogs=hogs)
        if "ratios" in parts:
            yield from ratios.run(folder, quick=quick)
    if "first" in parts:
        yield first_call.run(quick=quick)
    if "units" in parts:
        yield units.run(quick=quick)
    if "million" in parts:
        yield from million.run(*((million.QUICK_SCENES, million.QUICK_CHECKED) if quick else ()))


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
