"""``python -m fuzz``: bytes that were never sent, at every device's decoder, and what became of them.

Each device gets the same time. ``--strict`` goes on to the numbers of the report: every split of 200 frames, ten
million damaged frames and ten gigabytes of noise in all. What fails is printed with the call that repeats it.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import platform
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from math import ceil
from pathlib import Path

from bench.commit import measured_commit
from bench.tables import Table
from fuzz import mutations, noise, splits
from fuzz.corpus import record
from fuzz.outcome import Outcome, allowed
from fuzz.strength import STRENGTHS

MEASURES: dict[str, Callable[..., Outcome]] = {"splits": splits.fuzz, "mutations": mutations.fuzz, "noise": noise.fuzz}
STRICT = {"mutations": 10_000_000, "noise": 10_000_000_000}
SECONDS = 60.0
"""Of a run that is not strict, on all cores together: ``--seconds`` says otherwise."""

SHARE = 0.05
"""Of the splits in a run that is not strict."""

MOST_TOLD = 5
"""Faults of one round that are printed."""


@dataclass(frozen=True)
class Job:
    """One round: what is done, to which device, with which seed."""

    measure: str
    device: str
    seed: int
    share: float

    def run(self) -> tuple[Job, Outcome]:
        """Does it."""
        if self.measure == "splits":
            return self, splits.fuzz(record(self.device), self.seed, self.share)
        return self, MEASURES[self.measure](record(self.device), self.seed)


Results = dict[tuple[str, str], Outcome]


def main(argv: list[str] | None = None) -> int:
    """Runs what is asked for; 1 where anything was not as it must be."""
    parser = argparse.ArgumentParser(prog="python -m fuzz", description=__doc__)
    parser.add_argument("--strict", action="store_true", help="the whole of it (some minutes on two cores)")
    parser.add_argument("--seconds", type=float, default=SECONDS, help=f"of all devices together (default {SECONDS:g})")
    parser.add_argument("--device", choices=sorted(STRENGTHS), help="this one alone")
    parser.add_argument("--seed", type=int, default=1, help="of the first round; the next ones count on (default 1)")
    parser.add_argument("--rounds", type=int, help="so many rounds of each kind, and no clock: 1 repeats a failure")
    parser.add_argument("--report", type=Path, help="where to write the report")
    options = parser.parse_args(argv)
    devices = [options.device] if options.device else list(STRENGTHS)
    results: Results = {}
    with multiprocessing.get_context("spawn").Pool(os.cpu_count()) as pool:
        for stage in _stages(options, devices, results):
            for job, outcome in pool.imap_unordered(Job.run, stage):
                results.setdefault((job.measure, job.device), Outcome(job.device)).add(outcome)
                for fault in outcome.faults[:MOST_TOLD]:
                    print(f"{job.device}: {job.measure}: {fault[:400]}")
                    print(f"  again: python -m fuzz --device {job.device} --seed {job.seed} --rounds 1", flush=True)
    tables, verdicts = _tables(results, devices)
    print("\n".join(table.text() for table in tables))
    print("\n".join(("", *verdicts)))
    if options.report is not None:
        options.report.write_text(_report(tables, verdicts), encoding="utf-8")
    return 0 if all("not" not in verdict for verdict in verdicts) else 1


def _stages(options: argparse.Namespace, devices: list[str], results: Results) -> Iterator[Iterable[Job]]:
    """One round of everything, and behind it as many more as time or the strict numbers ask for."""
    rounds = 1 if options.rounds is None else options.rounds
    share = 1.0 if options.strict or options.rounds is not None else SHARE
    yield [
        Job(measure, device, options.seed + n, share)
        for measure in MEASURES
        for device in devices
        for n in range(1 if measure == "splits" else rounds)
    ]
    if options.rounds is not None:
        return
    more: list[Job] = []
    for measure in ("mutations", "noise"):
        done = {device: results[measure, device] for device in devices}
        if options.strict:
            wanted = _strict_rounds(measure, done)
        else:
            each_s = options.seconds * (os.cpu_count() or 1) / (2 * len(devices))
            wanted = {device: int(each_s / outcome.seconds) for device, outcome in done.items()}
        for device, count in wanted.items():
            more += [Job(measure, device, options.seed + 1 + n, share) for n in range(count)]
    yield more


def _strict_rounds(measure: str, done: dict[str, Outcome]) -> dict[str, int]:
    """Rounds that make up the strict number: damaged frames alike for all, noise for the same time each."""
    left = STRICT[measure] - sum(outcome.amount for outcome in done.values())
    if measure == "mutations":
        return {device: ceil(left / len(done) / outcome.amount) for device, outcome in done.items()}
    each_s = left / sum(outcome.amount / outcome.seconds for outcome in done.values())
    return {device: ceil(each_s / outcome.seconds) for device, outcome in done.items()}


def _tables(results: Results, devices: list[str]) -> tuple[list[Table], list[str]]:
    return [_splits(results, devices), _mutations(results, devices), _noise(results, devices)], _verdicts(results)


def _splits(results: Results, devices: list[str]) -> Table:
    table = Table(
        f"The same bytes in every split: {splits.FRAMES} frames, good ones and some damaged",
        ("device", "bytes a reading", "splits", "that differ"),
    )
    for device in devices:
        outcome = results["splits", device]
        length = ceil(sum(map(len, record(device).units)) / len(record(device).units))
        table.rows.append((device, length, outcome.amount, len(outcome.faults)))
    table.notes.append("A split cuts each frame at one byte, or the whole into pieces of one length, from one byte on.")
    table.notes.append("Samples and health counters must be those of the bytes in one piece.")
    return table


def _mutations(results: Results, devices: list[str]) -> Table:
    table = Table(
        "Damaged frames among good ones",
        ("device", "damaged", "good", "good lost", "two lost", "raised", "believed", "bound", "damaged/s"),
    )
    for device in devices:
        outcome = results["mutations", device]
        two = sum("lost behind" in fault for fault in outcome.faults)
        bound = _bound("mutations", device, outcome.amount)
        table.rows.append(
            (
                *(device, outcome.amount, outcome.good, outcome.lost, two, len(outcome.faults) - two, outcome.false),
                "the transport's" if bound is None else bound,
                round(outcome.amount / outcome.seconds),
            )
        )
    kinds = ", ".join(kind.__name__ for kind in mutations.KINDS)
    table.notes.append(f"Each damaged frame suffers one mishap ({kinds}); two good ones follow.")
    table.notes.append("Two lost: damaged frames that cost more than one good frame. Believed: readings never sent.")
    table.notes += [
        f"{device}: {strength.mishap}"
        + ("." if strength.mishap_bits is None else f": at most 2^-{strength.mishap_bits:g} a mishap.")
        for device, strength in STRENGTHS.items()
        if device in devices
    ]
    return table


def _noise(results: Results, devices: list[str]) -> Table:
    table = Table("Random bytes", ("device", "MB", "raised", "believed", "bound", "2^-n a position", "MB/s"))
    for device in devices:
        outcome = results["noise", device]
        table.rows.append(
            (
                *(device, round(outcome.amount / 1e6), len(outcome.faults), outcome.false),
                *(allowed(outcome.amount, 2.0 ** -STRENGTHS[device].position_bits), STRENGTHS[device].position_bits),
                round(outcome.amount / outcome.seconds / 1e6),
            )
        )
    table.notes += [f"{device}: {STRENGTHS[device].position}." for device in devices]
    return table


def _bound(measure: str, device: str, amount: int) -> int | None:
    strength = STRENGTHS[device]
    bits = strength.mishap_bits if measure == "mutations" else strength.position_bits
    return None if bits is None else allowed(amount, 2.0**-bits)


def _verdicts(results: Results) -> list[str]:
    verdicts = []
    for (measure, device), outcome in sorted(results.items()):
        bound = None if measure == "splits" else _bound(measure, device, outcome.amount)
        if outcome.faults:
            verdicts.append(f"{device}: {measure}: {len(outcome.faults)} times not as it must be")
        if bound is not None and outcome.false > bound:
            verdicts.append(f"{device}: {measure}: {outcome.false} believed, which is not within the bound of {bound}")
    return verdicts or ["All is as it must be."]


def _report(tables: list[Table], verdicts: list[str]) -> str:
    measured = datetime.now(tz=UTC).date().isoformat()
    head = (
        f"Commit {measured_commit()}, {platform.system()} {platform.machine()}, "
        f"Python {platform.python_version()}, {os.cpu_count()} cores, {measured}."
    )
    lines = ["# Fuzzing of the devices", "", head, *(table.markdown() for table in tables), ""]
    return "\n".join([*lines, *verdicts, ""])


if __name__ == "__main__":
    sys.exit(main())
