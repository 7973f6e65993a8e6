"""The tables of the report: what grew, what was done, what was recorded, and where traced memory went."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median_low

from bench.tables import Table
from shifts.shift_holdings import ShiftHoldings
from shifts.shift_watch import WARM_UP_SHARE, WINDOW_SHARE, Found

MOST_DRIFT_KB = 1024
MEDIANS = ("memory_kb", "mapped_kb", "blocks", "objects")
"""Compared by the medians of both windows, because what is in progress comes and goes; the others by the most."""

GROWN_SHOWN, TRACED_SHOWN = 5, 10
FIGURES = (
    ("memory, kB", "memory_kb", MOST_DRIFT_KB),
    ("pages of files in memory, kB", "mapped_kb", None),
    ("open files", "files", 0),
    ("tasks", "tasks", 0),
    ("threads", "threads", 0),
    ("blocks of Python's memory", "blocks", None),
    ("objects that the garbage collector knows", "objects", None),
    ("engine, bytes", "engine_bytes", None),
)
"""What is held, and by how much it may grow; None: shown alone."""


def windows(samples: Sequence[ShiftHoldings]) -> tuple[list[ShiftHoldings], list[ShiftHoldings]]:
    """Return the samples of the window behind the warm-up, and of the one at the end."""
    part, begin = max(1, round(WINDOW_SHARE * len(samples))), round(WARM_UP_SHARE * len(samples))
    return list(samples[begin : begin + part]), list(samples[-part:])


def grown(found: Found) -> Table:
    """Return what was held behind the warm-up and at the end."""
    head = ("what", "behind the warm-up", "at the end", "most", "wanted", "reached")
    table = Table(f"{found.hours:.3g} simulated hours: what grows", head)
    early, late = windows(found.samples)
    for name, attribute, drift in FIGURES:
        values = [[getattr(one, attribute) for one in part] for part in (early, late, found.samples)]
        before, after = (median_low(part) if attribute in MEDIANS else max(part) for part in values[:2])
        most = max(values[2])
        wanted = "" if drift is None else f"at most {drift} more" if drift else "no more"
        reached = "" if drift is None else "yes" if after - before <= drift else "no"
        table.rows.append((name, before, after, most, wanted, reached))
    more = containers_grown(early, late)
    places = len(found.samples[-1].containers)
    table.rows.append(("entries of all containers in the engine", *_entries(early, late, found.samples), "", ""))
    named = "; ".join(f"`{place}` {before} to {after}" for place, before, after in more[:GROWN_SHOWN])
    table.notes += [
        f"A healthy subscriber of everything, in a process of its own, received {found.heard[0]} messages of"
        f" {found.published}; missing by their numbers: {found.heard[1]}; wanted: 0.",
        f"Containers of the engine: {places} places, of which {len(more)} hold more at the end{': ' if named else ''}"
        f"{named}.",
        f"Medians of memory, blocks and objects, else the most, within {100 * WINDOW_SHARE:g} % of the time, after the"
        f" first {100 * WARM_UP_SHARE:g} % and at the end;"
        f" {len(found.samples)} samples, each after a collection of garbage.",
    ]
    return table


def overdrawn(table: Table) -> bool:
    """Return whether something in the table of `grown` grew by more than wanted."""
    return any(row[-1] == "no" for row in table.rows)


def containers_grown(early: Sequence[ShiftHoldings], late: Sequence[ShiftHoldings]) -> list[tuple[str, int, int]]:
    """Return the containers that hold more at the end than behind the warm-up, those that grew most first."""
    places = {place for one in late for place in one.containers}
    both = [(place, *(max(one.containers.get(place, 0) for one in part) for part in (early, late))) for place in places]
    return sorted((one for one in both if one[2] > one[1]), key=lambda one: (one[1] - one[2], one[0]))


def _entries(*parts: Sequence[ShiftHoldings]) -> tuple[int, ...]:
    return tuple(max(sum(one.containers.values()) for one in part) for part in parts)


def worked(found: Found) -> Table:
    """Return what happened in the run."""
    table = Table("What happened", ("what", "count"))
    table.rows += [
        ("events that entered the daemon", found.events),
        ("messages", found.published),
        ("requests, without renewals of the lease", found.requests),
        ("requests refused", sum(found.refusals.values())),
        ("jobs", sum(found.jobs.values())),
        ("slides of the box", found.slips),
        ("faults of the lines and the host", sum(found.faults.values())),
        ("times that a stream did not work again", found.not_ready),
        ("contradictions in the messages", len(found.wrong)),
    ]
    speed = found.hours * 3600 / found.took_s
    table.notes += [
        f"{found.hours:.3g} h took {found.took_s:.0f} s ({speed:.1f} times real time), {found.cpu_s:.0f} s of them on"
        " a processor.",
        f"Jobs: {_listed(found.jobs)}. Faults: {_listed(found.faults)}. Breaks with devices on {found.breaks['on']},"
        f" switched off {found.breaks['off']} ({found.off_hours:.2f} h).",
        f"Refused: {_listed(found.refusals)}.",
        "Checked in every message: its number, that a level changes with a warning only, and that numbers are finite.",
        *(f"Wrong: {what}." for what in found.wrong),
    ]
    return table


def recorded(found: Found) -> Table:
    """Return what was recorded."""
    table = Table("What was recorded", ("what", "count"))
    saved, failed = found.incidents
    table.rows += [
        ("files of the continuous recording", found.run_files),
        ("incidents saved", saved),
        ("incidents not saved", failed),
        ("entries lost", found.lost),
        *((f"kept files `{kind}-*`, complete of all", f"{whole} of {n}") for kind, (n, whole) in found.files.items()),
    ]
    table.notes.append(f"Lines of the log from warnings on: {_listed(found.log)}.")
    return table


def traced(found: Found) -> Table:
    """Return where memory grew in a run with traced allocations."""
    title = f"{found.hours:.3g} simulated hours with traced allocations: what grows"
    table = Table(title, ("line", "bytes", "blocks"))
    table.rows += found.traced[:TRACED_SHOWN]
    table.notes += [
        f"The {TRACED_SHOWN} lines whose memory grew or shrank most between the first {100 * WARM_UP_SHARE:g} % and"
        f" the end; all together {sum(size for _, size, _ in found.traced)} bytes. Memory from before counts nowhere.",
    ]
    return table


def _listed(counts: dict[str, int]) -> str:
    return ", ".join(f"{name} {count}" for name, count in sorted(counts.items())) or "none"
