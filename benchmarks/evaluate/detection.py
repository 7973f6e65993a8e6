"""How soon sliding is reported, and what is reported falsely: one table for either world.

    PYTHONPATH=tests/support:benchmarks .venv/bin/python -m evaluate --detection --world second --seeds 4

A slip counts for *by x mm* if it slides by x mm or farther: it is reported if the level becomes "slipping" before the
contact has slid by so much. *Never*: of the slips of 10 mm or farther. In brackets stands the oracle of the fall, see
`evaluate.score`, that is told the onset. *False*: share of the grasps with a false "slipping" once the grip is closed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

from bench.tables import Table
from evaluate.campaign import CREEPING, FORESEEN, HOLDING
from evaluate.intervals import quantile, share
from evaluate.running import Result
from evaluate.score import EpisodeScore

BY_M = (1e-3, 2e-3, 5e-3)
FAR_M = 0.01

HEAD = ("family", "grasps", "slips", *(f"by {1e3 * far:g} mm" for far in BY_M), "never", "warned", "lead p50/p5, ms",
        "false", "per h")  # fmt: skip


def by(slips: Iterable[EpisodeScore], far_m: float, path: Callable[[EpisodeScore], float]) -> float:
    """Return the share of the slips of ``far_m`` or farther that are found within it; NaN if there are none."""
    long = [path(slip) for slip in slips if slip.slid_m >= far_m]
    return share(sum(found <= far_m for found in long), len(long))


def never(slips: Iterable[EpisodeScore]) -> float:
    """Return the share of the far slips that are never reported."""
    far = [slip for slip in slips if slip.slid_m >= FAR_M]
    return share(sum(math.isinf(slip.latency_s) for slip in far), len(far))


def detection(results: Sequence[Result], families: Sequence[str], title: str) -> Table:
    """Return a row for each family, and one for each kind of family."""
    table = Table(title, HEAD)
    groups = {name: (name,) for name in families}
    groups |= {
        "all that slip, creep apart": tuple(f for f in families if f not in (*CREEPING, *HOLDING)),
        "all that can be foreseen": tuple(f for f in families if f in FORESEEN),
        "all that hold": tuple(f for f in families if f in HOLDING),
    }
    for name, members in groups.items():
        if runs := [one.score for one in results if one.family in members]:
            slips = [slip for run in runs for slip in run.episodes]
            first = [slip for slip in slips if slip.first]
            leads = [1e3 * slip.lead_s for slip in first if slip.warned]
            found = [(by(slips, far, lambda s: s.path_m), by(slips, far, lambda s: s.oracle_path_m)) for far in BY_M]
            hours = sum(run.quiet_s for run in runs) / 3600.0
            table.rows.append((
                name, len(runs), len(slips), *(f"{_percent(ours)} ({_percent(oracle)})" for ours, oracle in found),
                _percent(never(slips)), _percent(share(sum(slip.warned for slip in first), len(first))),
                f"{quantile(leads, 0.5):.0f}/{quantile(leads, 0.05):.0f}" if leads else "–",
                _percent(share(sum(run.early for run in runs), len(runs))),
                f"{share(sum(run.false_slipping for run in runs), hours):.0f}",
            ))  # fmt: skip
    return table


def _percent(value: float) -> str:
    return "–" if math.isnan(value) else f"{100.0 * value:.0f}%"
