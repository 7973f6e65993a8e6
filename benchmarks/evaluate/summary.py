"""Figures of many runs: every metric of `evaluate.score` over a set of them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from evaluate.intervals import quantile, rate_upper, share
from evaluate.score import SHORT, RunScore

CREEP_M = 1e-3
"""Creep should be reported within this path."""


@dataclass(frozen=True, slots=True)
class Summary:
    """Figures of a set of runs; NaN where there is nothing to take them from.

    Attributes:
        runs: Number of runs.
        slips: Gross slips, of all lengths.
        long: Those of `PROMPT_S` or longer.
        warned: Share of the first slips of the runs that were warned of.
        warned_again: Likewise of later ones.
        lead_p50_ms: Lead of the warnings.
        lead_p5_ms: Likewise.
        oracle_warned: Share of the first slips that the oracle of the warnings warns of.
        oracle_lead_p5_ms: Lead of its warnings.
        latency_p50_ms: From onset to "slipping", of long slips.
        latency_p95_ms: Likewise; infinite where more are not reported.
        missed: Share of long slips without "slipping" within 100 ms.
        silent: Share of long slips without any alarm within 100 ms.
        visible: Share of long slips of which an oracle sees the fall.
        within_1mm: Share of long slips reported within 1 mm of sliding.
        closing: Share of runs with a false "slipping" while the grip closes.
        early: Share of runs with one later, before their first slip or without one.
        false_slipping: Their number.
        quiet_h: Time in which they could happen, h.
        false_slipping_upper: Upper bound of the rate, 1/h.
        false_warnings: Alarms on a safe load.
        safe_h: Time with a safe load, h.
        false_warnings_upper: Upper bound of the rate, 1/h.
        sliding_s: Sliding time beyond 100 ms, s.
        seen: Share of it in slips of which an oracle sees the fall.
        reported: Share of the sliding time beyond 100 ms that is reported as slipping.
        stable: Share of it that is reported as stable.
        changes_p95: Changes of level on the way to the first slip.
        changes_per_min: In steady holds.
        overstay_p95_ms: How long "slipping" outlasts the slip.
        used_p50: Utilisation error.
        used_p95: Likewise.
        grip_short: Share of messages whose grip force is more than 5 % short.
    """

    runs: int
    slips: int
    long: int
    warned: float
    warned_again: float
    lead_p50_ms: float
    lead_p5_ms: float
    oracle_warned: float
    oracle_lead_p5_ms: float
    latency_p50_ms: float
    latency_p95_ms: float
    missed: float
    silent: float
    visible: float
    within_1mm: float
    closing: float
    early: float
    false_slipping: int
    quiet_h: float
    false_slipping_upper: float
    false_warnings: int
    safe_h: float
    false_warnings_upper: float
    sliding_s: float
    seen: float
    reported: float
    stable: float
    changes_p95: float
    changes_per_min: float
    overstay_p95_ms: float
    used_p50: float
    used_p95: float
    grip_short: float


def summarise(scores: Iterable[RunScore]) -> Summary:
    """Return the figures of some runs."""
    runs = list(scores)
    slips = [slip for run in runs for slip in run.episodes]
    long = [slip for slip in slips if slip.long]
    leads = [1e3 * slip.lead_s for slip in slips if slip.warned]
    oracle_leads = [1e3 * slip.oracle_lead_s for slip in slips if not math.isnan(slip.oracle_lead_s)]
    latencies = [1e3 * slip.latency_s for slip in long]
    quiet_h, safe_h = (sum(getattr(run, name) for run in runs) / 3600.0 for name in ("quiet_s", "safe_s"))
    false_slips, false_warnings = (sum(getattr(r, name) for r in runs) for name in ("false_slipping", "false_warnings"))
    sliding_s = sum(run.sliding_s for run in runs)
    used, grip = (_joined([getattr(run, name) for run in runs]) for name in ("used_errors", "grip_errors"))
    return Summary(
        runs=len(runs),
        slips=len(slips),
        long=len(long),
        warned=_share(slip.warned for slip in slips if slip.first),
        warned_again=_share(slip.warned for slip in slips if not slip.first),
        lead_p50_ms=quantile(leads, 0.5),
        lead_p5_ms=quantile(leads, 0.05),
        oracle_warned=_share(not math.isnan(slip.oracle_lead_s) for slip in slips if slip.first),
        oracle_lead_p5_ms=quantile(oracle_leads, 0.05),
        latency_p50_ms=quantile(latencies, 0.5),
        latency_p95_ms=quantile(latencies, 0.95),
        missed=_share(slip.missed for slip in long),
        silent=_share(slip.silent for slip in long),
        visible=_share(slip.visible for slip in long),
        within_1mm=_share(slip.path_m <= CREEP_M for slip in long),
        closing=_share(run.closing for run in runs),
        early=_share(run.early for run in runs),
        false_slipping=false_slips,
        quiet_h=quiet_h,
        false_slipping_upper=rate_upper(false_slips, quiet_h),
        false_warnings=false_warnings,
        safe_h=safe_h,
        false_warnings_upper=rate_upper(false_warnings, safe_h),
        sliding_s=sliding_s,
        seen=share(sum(run.sliding_seen_s for run in runs), sliding_s),
        reported=share(sum(run.sliding_reported_s for run in runs), sliding_s),
        stable=share(sum(run.sliding_stable_s for run in runs), sliding_s),
        changes_p95=quantile([r.changes_before for r in runs if r.changes_before is not None], 0.95),
        changes_per_min=60.0 * share(sum(r.steady_changes for r in runs), sum(r.steady_s for r in runs)),
        overstay_p95_ms=quantile([1e3 * s.overstay_s for s in slips if not math.isnan(s.overstay_s)], 0.95),
        used_p50=quantile(used, 0.5),
        used_p95=quantile(used, 0.95),
        grip_short=share(float((grip < -SHORT).sum()), grip.size),
    )


def _share(flags: Iterable[bool]) -> float:
    found = list(flags)
    return share(sum(found), len(found))


def _joined(arrays: Sequence[np.ndarray]) -> np.ndarray:
    return np.concatenate(arrays) if arrays else np.zeros(0)
