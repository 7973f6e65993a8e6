"""Findings of the request fuzzing, and their report: tables and verdicts."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np
from bench.tables import Cell, Table
from fuzz.asking import CLIENTS
from numpy.typing import NDArray

WANTED_NS = 1_000_000
LOOKED_AT_NS = 500_000
"""A message that took longer is timed again, since the delay may be the machine's."""

AGAIN = 3
GROWTH_KB = 4096
"""Memory that a process may keep beyond its first round: arenas of the allocator."""

UNJUDGED = ("busy", "deadline_too_far", "repeated_id", "replayed")
"""Codes of refusals that leave no trace: such a request, sent again, is carried out for the first time."""


@dataclass
class Found:
    """Findings of one or more rounds.

    Attributes:
        messages: Number of messages sent, by kind.
        granted: Number of granted requests by op, without repetitions.
        replays: Number of captured requests that were sent again.
        cached: Number of those that got the first reply again, with nothing done.
        late: Number of those granted that had been refused unjudged before.
        commands: Number of command frames to the gripper.
        acts: Number of acts of the reflex.
        violations: Acts beyond what is allowed, in words.
        accepted_replays: Captured requests that were carried out again, in words.
        took_ns: CPU time of each message, ns.
        slowest: The slowest messages: ns, kind, seed, number.
        memory_kb: Process id → its memory after its first and after its last round, kB.
        faults: All other faults, in words.
    """

    messages: Counter[str] = field(default_factory=Counter)
    granted: Counter[str] = field(default_factory=Counter)
    replays: int = 0
    cached: int = 0
    late: int = 0
    commands: int = 0
    acts: int = 0
    violations: list[str] = field(default_factory=list)
    accepted_replays: list[str] = field(default_factory=list)
    took_ns: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    slowest: list[tuple[int, str, int, int]] = field(default_factory=list)
    memory_kb: dict[int, tuple[int, int]] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)

    @property
    def bad(self) -> list[str]:
        """All faults, in words."""
        return self.violations + self.accepted_replays + self.faults

    def add(self, other: Found) -> None:
        """Add the findings of another round."""
        self.messages += other.messages
        self.granted += other.granted
        self.replays += other.replays
        self.cached += other.cached
        self.late += other.late
        self.commands += other.commands
        self.acts += other.acts
        self.violations += other.violations
        self.accepted_replays += other.accepted_replays
        self.took_ns = np.concatenate((self.took_ns, other.took_ns))
        self.slowest = sorted(self.slowest + other.slowest, reverse=True)[:5]
        self.faults += other.faults
        for process, (first, last) in other.memory_kb.items():
            self.memory_kb[process] = self.memory_kb.get(process, (first, last))[0], last


def tables(found: Found, wanted: int) -> list[Table]:
    """Return the tables of what was sent and what was found; ``wanted`` is the wanted number of messages."""
    sent = Table(f"Requests: {sum(found.messages.values())} messages at a daemon without sockets", ("made", "messages"))
    sent.rows += [(kind, count) for kind, count in found.messages.most_common()]
    ops = ", ".join(f"{op} {count}" for op, count in found.granted.most_common())
    sent.notes += [
        f"Of {len(CLIENTS)} clients with clocks of their own, while sensors fall silent, saturate or are unplugged, "
        "the gripper faults, lies, goes deaf or loses its power, the host sleeps, and the daemon starts anew.",
        f"Granted: {ops}.",
        f"{found.commands} command frames were sent to the gripper, each decoded by an independent implementation "
        f"of the manual; the reflex, on in every second round, acted {found.acts} times.",
    ]
    head = ("requests", "found", "wanted", "reached")
    figures = Table("Requests: what must hold", head)
    p50, p999 = (float(np.percentile(found.took_ns, share)) * 1e-3 for share in (50, 99.9))
    worst_ms = int(found.took_ns.max()) * 1e-6
    grown_kb = max(last - first for first, last in found.memory_kb.values())
    figures.rows += [
        _figure("messages", sum(found.messages.values()), wanted, above=True),
        _figure("limit violations", len(found.violations), 0),
        _figure(f"captured requests done again, of {found.replays}", len(found.accepted_replays), 0),
        _figure("raised, unanswered, or answered with nonsense", len(found.faults), 0),
        ("CPU time of a message, p50, µs", p50, "", ""),
        ("CPU time of a message, p99.9, µs", p999, "", ""),
        _figure("CPU time of a message, worst, ms", worst_ms, WANTED_NS * 1e-6),
        _figure("memory of a process behind its last round, beyond that behind its first, kB", grown_kb, GROWTH_KB),
    ]
    slowest = ", ".join(f"{ns * 1e-3:.0f} µs {kind}" for ns, kind, _, _ in found.slowest)
    figures.notes += [
        f"Captured requests: {found.cached} came from their own client within their deadline, and were answered as "
        f"before with nothing done; {found.late} had been refused unjudged ({', '.join(UNJUDGED)}), and so were done "
        "for the first time. hello and status are not counted: they do nothing.",
        "CPU time: from a message's frames to its packed reply, all that it writes and publishes included; what took "
        f"over {LOOKED_AT_NS * 1e-6:g} ms was done again up to {AGAIN} times from the same seed, and the least counts.",
        f"The slowest: {slowest}.",
    ]
    return [sent, figures]


def verdicts(found: Found) -> list[str]:
    """Return one line for each kind of fault."""
    told = []
    if found.bad:
        told.append(f"requests: {len(found.bad)} faults")
    if found.took_ns.max() > WANTED_NS:
        told.append(f"requests: the worst message takes {found.took_ns.max() * 1e-6:.2f} ms")
    if max(last - first for first, last in found.memory_kb.values()) > GROWTH_KB:
        told.append("requests: memory grows")
    return told


def _figure(what: str, found: float, wanted: float, *, above: bool = False) -> tuple[Cell, ...]:
    reached = found >= wanted if above else found <= wanted
    return what, found, f"at {'least' if above else 'most'} {wanted:g}", "yes" if reached else "no"
