"""The router is killed and started again, or freezes: how soon all robots are live again, and what is lost."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from bench.child import BenchError
from bench.tables import Table
from fleet.network import Network, go_on, killed, stopped
from fleet.steady import WARM_S, arrivals
from fleet.watching import watching

OUTAGES: tuple[tuple[str, float], ...] = (("killed", 0.5), ("killed", 3.0), ("frozen", 3.0))
"""What happens to the router, and for how long it is away, s. A frozen one keeps its connections."""

SETTLE_S = 6.0
PATIENCE_S = 60.0


def run(network: Network, folder: Path) -> Table:
    """Let the router fail, some seconds apart."""
    head = (
        "router",
        "away, s",
        "no robot live after, s",
        "all robots live again after, s",
        "warnings meanwhile",
        "lost",
    )
    table = Table("The router fails", head)
    for what, away_s in OUTAGES:
        direct, fleet = folder / f"direct-{what}{away_s}.json", folder / f"fleet-{what}{away_s}.json"
        with network.observed("zeromq", direct), network.observed("zenoh", fleet), watching(network.endpoint) as live:
            _until(lambda live=live: len(live()) == len(network.robots))
            time.sleep(WARM_S)
            begin_ns = time.monotonic_ns()
            (killed if what == "killed" else stopped)(network.router)
            gone_s = _until(lambda live=live: not live())
            time.sleep(max(0.0, away_s - gone_s))
            if what == "killed":
                network.start_router()
            else:
                go_on(network.router)
            back_s = _until(lambda live=live: len(live()) == len(network.robots))
            end_ns = time.monotonic_ns()
            time.sleep(SETTLE_S)
        sent, *_ = arrivals(direct)
        came, *_ = arrivals(fleet)
        warnings = [key for key, t_ns in sent.items() if key[1] == "warning" and begin_ns <= t_ns <= end_ns]
        lost = sum(key not in came for key in warnings)
        table.rows.append((what, f"{away_s:g}", gone_s, back_s, len(warnings), lost))
    table.notes.append(
        "Times from the outage, and from the moment at which a new router listens, or the frozen one goes on."
    )
    return table


def _until(condition: Callable[[], bool]) -> float:
    """Wait for a condition, and return how long that took, s."""
    begin_s = time.monotonic()
    while not condition():
        if time.monotonic() > begin_s + PATIENCE_S:
            raise BenchError("the fleet did not come to the state that was waited for")
    return time.monotonic() - begin_s
