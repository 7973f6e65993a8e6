"""Fuzz the decoder of every device with split, damaged and random bytes, the daemon with hostile requests, and the
reader of recordings with damaged files.

    make fuzz    (about 30 minutes; writes docs/fuzz.md)
    PYTHONPATH=tests/support:tests/lab python -m fuzz [--strict] [--only devices|requests|recordings] [--device NAME]
        [--seed S] [--rounds N] [--report FILE]

Counted are frames that are lost, accepted wrongly or read differently when split, requests that break a limit, and the
processor time of each. All devices get the same time. ``--strict`` runs until the amounts of the report are reached:
every split of 200 frames, ten million damaged frames, ten gigabytes of noise and a million requests. Each failure is
printed with the command that repeats it. The report is printed, and ``--report`` also writes it as Markdown.
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
from pathlib import Path

from bench.tables import Table
from fuzz import recordings, request_report, requests
from fuzz.outcome import Outcome
from fuzz.report import document, tables, verdicts
from fuzz.rounds import SECONDS, Job, Results, Wish, cores, stages
from fuzz.strength import STRENGTHS

MOST_TOLD = 5
"""Faults of one round that are printed."""


def main(argv: list[str] | None = None) -> int:
    """Run the fuzzing that the arguments name; return 1 if it found a fault, else 0."""
    parser = argparse.ArgumentParser(
        prog="python -m fuzz", description="Fuzz the decoders of all devices and the requests."
    )
    parser.add_argument("--strict", action="store_true", help="run the full amounts (about 20 minutes on two cores)")
    parser.add_argument(
        "--seconds", type=float, default=SECONDS, help=f"total time for all devices (default {SECONDS:g})"
    )
    parser.add_argument("--device", choices=sorted(STRENGTHS), help="fuzz this device only, and nothing else")
    parser.add_argument("--only", choices=("devices", "requests", "recordings"), help="fuzz these only (default: all)")
    parser.add_argument(
        "--seed", type=int, default=1, help="seed of the first round; each further round adds 1 (default 1)"
    )
    parser.add_argument(
        "--rounds", type=int, help="run this many rounds of each kind instead of a time; 1 repeats a failure"
    )
    parser.add_argument("--report", type=Path, help="also write the report as Markdown")
    options = parser.parse_args(argv)
    devices = [options.device] if options.device else list(STRENGTHS)
    wish = Wish(devices, options.seed, options.strict, options.seconds, options.rounds)
    shown: list[Table] = []
    found: list[str] = []
    if options.only in (None, "devices"):
        results = _devices(wish)
        shown, found = tables(results, devices), verdicts(results)
    if options.only in (None, "requests") and not options.device:
        asked = _requests(wish)
        shown += request_report.tables(asked, requests.STRICT if wish.strict else 1)
        found += request_report.verdicts(asked)
    if options.only in (None, "recordings") and not options.device:
        damaged = _recordings(wish)
        shown.append(recordings.table(damaged))
        found += recordings.verdicts(damaged)
    print("\n".join(table.text() for table in shown))
    print("\n".join(("", *(found or ["No faults found."]))))
    if options.report is not None:
        options.report.write_text(document(shown, found), encoding="utf-8")
    return 1 if found else 0


def _devices(wish: Wish) -> Results:
    """Every device, on all cores."""
    results: Results = {}
    with multiprocessing.get_context("spawn").Pool(cores()) as pool:
        for stage in stages(wish, results):
            for job, outcome in pool.imap_unordered(Job.run, stage):
                results.setdefault((job.measure, job.device), Outcome(job.device)).add(outcome)
                for fault in outcome.faults[:MOST_TOLD]:
                    print(f"{job.device}: {job.measure}: {fault[:400]}")
                    print(f"  to repeat: python -m fuzz --device {job.device} --seed {job.seed} --rounds 1", flush=True)
    return results


def _requests(wish: Wish) -> request_report.Found:
    """The requests, on all cores."""
    found = request_report.Found()
    count = wish.rounds or (requests.STRICT // requests.ROUND if wish.strict else cores())
    seeds = range(wish.seed, wish.seed + count)
    with multiprocessing.get_context("spawn").Pool(min(cores(), count)) as pool:
        for seed, one in zip(seeds, pool.imap(requests.fuzz, seeds), strict=True):
            found.add(one)
            for fault in one.bad[:MOST_TOLD]:
                print(f"requests: {fault[:400]}")
            if one.bad:
                print(f"  to repeat: python -m fuzz --only requests --seed {seed} --rounds 1", flush=True)
    return found


def _recordings(wish: Wish) -> dict[tuple[str, int], recordings.Damaged]:
    """Damaged recordings, on all cores; without ``--strict`` one part in forty."""
    found: dict[tuple[str, int], recordings.Damaged] = {}
    parts = list(recordings.parts(wish.seed))[:: 1 if wish.strict else 40]
    with multiprocessing.get_context("spawn").Pool(cores()) as pool:
        for part, one in zip(parts, pool.imap(recordings.Part.run, parts), strict=True):
            found.setdefault((part.kind, part.size), recordings.Damaged()).add(one)
            for fault in one.misread[:MOST_TOLD]:
                print(f"recordings of {part.size} bytes: {fault}", flush=True)
    return found


if __name__ == "__main__":
    sys.exit(main())
