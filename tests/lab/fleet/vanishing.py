"""Robots vanish in three ways: how soon the view no longer shows them as live."""

from __future__ import annotations

import time
from collections.abc import Callable

from bench.child import BenchError, Child
from bench.tables import Table
from fleet.network import Network, go_on, killed, stopped
from fleet.observer import robot_name
from fleet.watching import watching

EACH = 5
"""Robots that vanish in each way."""

PAUSE_S = 1.0
PATIENCE_S = 30.0

Way = tuple[str, Callable[[Network, int], Child], Callable[[Child], None]]

WAYS: tuple[Way, ...] = (
    ("its bridge is killed", lambda network, number: network.bridges[number], killed),
    ("its bridge freezes; its connections stay open", lambda network, number: network.bridges[number], stopped),
    ("its daemon is killed", lambda network, number: network.robots[number], killed),
)


def run(network: Network) -> Table:
    """Let robots vanish one after another."""
    table = Table("A robot vanishes", ("how", "robots", "shown after, s: least", "median", "largest"))
    with watching(network.endpoint) as live:
        _wait(lambda: len(live()) == len(network.robots))
        time.sleep(PAUSE_S)
        for way, (how, victim, act) in enumerate(WAYS):
            times = []
            for number in range(way * EACH, min((way + 1) * EACH, len(network.robots))):
                _wait(lambda number=number: robot_name(number) in live())
                child, begin_s = victim(network, number), time.monotonic()
                act(child)
                _wait(lambda number=number: robot_name(number) not in live())
                times.append(time.monotonic() - begin_s)
                if act is stopped:
                    go_on(child)
            if times:
                times.sort()
                table.rows.append((how, len(times), times[0], times[len(times) // 2], times[-1]))
    return table


def _wait(condition: Callable[[], bool]) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not condition():
        if time.monotonic() > end_s:
            raise BenchError("the fleet did not come to the state that was waited for")
