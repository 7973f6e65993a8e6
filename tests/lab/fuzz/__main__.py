"""``python -m fuzz``: bytes that were never sent, at every device's decoder and as requests, and what became of them.

Each device gets the same time. ``--strict`` goes on to the numbers of the report: every split of 200 frames, ten
million damaged frames and ten gigabytes of noise in all, and a million requests. What fails is printed with the call
that repeats it.
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
from pathlib import Path

from bench.tables import Table
from fuzz import requests
from fuzz.outcome import Outcome
from fuzz.report import document, tables, verdicts
from fuzz.rounds import SECONDS, Job, Results, Wish, cores, stages
from fuzz.strength import STRENGTHS

MOST_TOLD = 5
"""Faults of one round that are printed."""


def main(argv: list[str] | None = None) -> int:
    """Runs what is asked for; 1 where anything was not as it must be."""
    parser = argparse.ArgumentParser(prog="python -m fuzz", description=__doc__)
    parser.add_argument("--strict", action="store_true", help="the whole of it (some minutes on two cores)")
    parser.add_argument("--seconds", type=float, default=SECONDS, help=f"of all devices together (default {SECONDS:g})")
    parser.add_argument("--device", choices=sorted(STRENGTHS), help="this one alone, and no requests")
    parser.add_argument("--only", choices=("devices", "requests"), help="these alone (default: both)")
    parser.add_argument("--seed", type=int, default=1, help="of the first round; the next ones count on (default 1)")
    parser.add_argument("--rounds", type=int, help="so many rounds of each kind, and no clock: 1 repeats a failure")
    parser.add_argument("--report", type=Path, help="where to write the report")
    options = parser.parse_args(argv)
    devices = [options.device] if options.device else list(STRENGTHS)
    wish = Wish(devices, options.seed, options.strict, options.seconds, options.rounds)
    shown: list[Table] = []
    found: list[str] = []
    if options.only != "requests":
        results = _devices(wish)
        shown, found = tables(results, devices), verdicts(results)
    if options.only != "devices" and not options.device:
        asked = _requests(wish)
        shown += requests.tables(asked, requests.STRICT if wish.strict else 1)
        found += requests.verdicts(asked)
    print("\n".join(table.text() for table in shown))
    print("\n".join(("", *(found or ["All is as it must be."]))))
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
                    print(f"  again: python -m fuzz --device {job.device} --seed {job.seed} --rounds 1", flush=True)
    return results


def _requests(wish: Wish) -> requests.Found:
    """The requests, on all cores."""
    found = requests.Found()
    count = wish.rounds or (requests.STRICT // requests.ROUND if wish.strict else cores())
    seeds = range(wish.seed, wish.seed + count)
    with multiprocessing.get_context("spawn").Pool(min(cores(), count)) as pool:
        for seed, one in zip(seeds, pool.imap(requests.fuzz, seeds), strict=True):
            found.add(one)
            for fault in one.bad[:MOST_TOLD]:
                print(f"requests: {fault[:400]}")
            if one.bad:
                print(f"  again: python -m fuzz --only requests --seed {seed} --rounds 1", flush=True)
    return found


if __name__ == "__main__":
    sys.exit(main())
