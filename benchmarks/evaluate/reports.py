"""What the engine published about one finger, as arrays over time."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from slipd.types.arrays import Array
from slipd_client.messages import level_code

NO_CONTACT, STABLE, CAUTION, WARNING, SLIPPING, UNKNOWN = (
    level_code(name) for name in ("no_contact", "stable", "caution", "warning", "slipping", "unknown")
)
ALARMS = (WARNING, SLIPPING)
"""Levels that are an alarm. Caution is none, and "unknown" says that there is no verdict."""


class Span(NamedTuple):
    """A time during which one level was reported."""

    level: int
    begin_s: float
    end_s: float


@dataclass(frozen=True, slots=True, eq=False)
class Reports:
    """Every ``slip`` message of a finger, in order; a change of level is always published.

    Attributes:
        t_s: When the message left the engine, shape (n,), s of the simulation.
        acquired_s: Acquisition time of the reading behind it, shape (n,), s.
        level: Level codes, shape (n,).
        utilisation: λ, shape (n,); NaN where unknown.
        mu: The μ behind it, shape (n,); NaN where there is none.
        required: Required friction q = λ μ, shape (n,); NaN where unknown.
        needed_n: ``grip_needed_n``, shape (n,), N; NaN where unknown.
    """

    t_s: Array
    acquired_s: Array
    level: Array
    utilisation: Array
    mu: Array
    required: Array
    needed_n: Array

    def spans(self, until_s: float) -> list[Span]:
        """Return the levels over time, the last one until ``until_s``."""
        if self.t_s.size == 0:
            return []
        changes = np.flatnonzero(np.diff(self.level, prepend=-1))
        ends = np.append(self.t_s[changes[1:]], until_s)
        return [Span(int(self.level[k]), float(self.t_s[k]), float(end)) for k, end in zip(changes, ends, strict=True)]


def reports_of(bodies: Iterable[tuple[int, dict[str, Any]]], zero_ns: int) -> Reports:
    """Collect the ``slip`` messages of a finger.

    Args:
        bodies: When each left the engine, ns, and its body.
        zero_ns: Time of the engine at which the simulation began, ns.
    """
    rows = [_row(t_ns, body, zero_ns) for t_ns, body in bodies]
    return Reports(*np.ascontiguousarray(np.array(rows, dtype=np.float64).reshape(-1, 7).T))


def _row(t_ns: int, body: dict[str, Any], zero_ns: int) -> tuple[float, ...]:
    used, mu, needed = (
        math.nan if body.get(key) is None else body[key] for key in ("utilisation", "mu", "grip_needed_n")
    )
    required = body.get("required_friction")
    return (
        (t_ns - zero_ns) * 1e-9,
        (body["t_ns"] - zero_ns) * 1e-9,
        body["level_code"],
        used,
        mu,
        used * mu if required is None else required,
        needed,
    )


def merged_alarms(spans: Iterable[Span]) -> list[Span]:
    """Join neighbouring spans whose levels are alarms; the joined span has the level WARNING."""
    alarms: list[Span] = []
    for span in spans:
        if span.level not in ALARMS:
            continue
        if alarms and alarms[-1].end_s == span.begin_s:
            alarms[-1] = alarms[-1]._replace(end_s=span.end_s)
        else:
            alarms.append(span._replace(level=WARNING))
    return alarms
