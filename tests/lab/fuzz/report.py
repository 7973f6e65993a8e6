"""Report of a fuzzing run: its tables, its faults, and the page with both."""

from __future__ import annotations

import platform
from datetime import UTC, datetime
from math import ceil

from bench.commit import measured_commit
from bench.tables import Table
from fuzz import splits, talks
from fuzz.corpus import record
from fuzz.damage import KINDS
from fuzz.outcome import allowed
from fuzz.rounds import Results, cores
from fuzz.strength import STRENGTHS

from slipd.devices import DEVICES


def tables(results: Results, devices: list[str]) -> list[Table]:
    """What was done and found, one table a measure."""
    make = (_splits, _mutations, _noise, _talks)
    return [table(results, devices) for table in make]


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
    kinds = ", ".join(kind.__name__ for kind in KINDS)
    table.notes.append(f"Each damaged frame suffers one mishap ({kinds}); two good ones follow.")
    table.notes.append("Two lost: damaged frames, not believed, that cost more than one good frame.")
    table.notes.append("Believed: readings never sent; the number of one may make those behind it look old.")
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


def _talks(results: Results, devices: list[str]) -> Table:
    table = Table("Sessions over a line that is bad for 6 s", ("device", "conversations", "that never ran, or raised"))
    for device in devices:
        if DEVICES[device].session is not None:
            outcome = results["talks", device]
            table.rows.append((device, outcome.amount, len(outcome.faults)))
    share, patience_s = round(100 * talks.BAD_SHARE), round(talks.PATIENCE_NS * 1e-9)
    table.notes.append(f"In both directions {share} % of all pieces suffer a mishap; then the line is good.")
    table.notes.append(f"Readings must come within {patience_s} s from then on.")
    return table


def _bound(measure: str, device: str, amount: int) -> int | None:
    strength = STRENGTHS[device]
    bits = strength.mishap_bits if measure == "mutations" else strength.position_bits
    return None if bits is None else allowed(amount, 2.0**-bits)


def verdicts(results: Results) -> list[str]:
    """Return one line for each kind of fault."""
    found = []
    for (measure, device), outcome in sorted(results.items()):
        bound = None if measure in ("splits", "talks") else _bound(measure, device, outcome.amount)
        if outcome.faults:
            found.append(f"{device}: {measure}: {len(outcome.faults)} faults")
        if bound is not None and outcome.false > bound:
            found.append(f"{device}: {measure}: {outcome.false} believed, which is not within the bound of {bound}")
    return found


def document(shown: list[Table], found: list[str]) -> str:
    """The report as markdown."""
    measured = datetime.now(tz=UTC).date().isoformat()
    head = (
        f"Commit {measured_commit()}, {platform.system()} {platform.machine()}, "
        f"Python {platform.python_version()}, {cores()} cores, {measured}."
    )
    lines = ["# Fuzzing of devices, requests and recordings", "", head, *(table.markdown() for table in shown), ""]
    return "\n".join([*lines, *(found or ["No faults found."]), ""])
