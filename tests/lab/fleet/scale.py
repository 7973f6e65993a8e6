"""A thousand robots' statuses and warnings through one router to one view: what both take."""

from __future__ import annotations

import gc
import sys
import time

from bench.tables import Table
from fleet.network import Network, cpu_s, memory_mb
from fleet.watching import FLEET
from zenoh_peers import session

from slipd_client.fleet.fleet_listener import FleetListener
from slipd_client.fleet.fleet_state import LIVE

ROBOTS = 1000
SECONDS = 15.0
WARM_S = 5.0
JOINED_S = 60.0
LOOK_S = 0.2
"""As ``slipctl fleet`` looks at what has arrived."""


def run(network: Network, robots: int = ROBOTS) -> Table:
    """Let a view join a crowd of robots, and watch it for some seconds."""
    crowd = network.child(sys.executable, "-m", "fleet.crowd", network.endpoint, str(robots))
    crowd.told("publishing")
    gc.freeze()  # what a view never loads: to look through it again and again would hold up this one
    with session(network.endpoint) as here:
        joins_s = time.monotonic()
        listener = FleetListener(here, FLEET)
        live = 0
        while live < robots and time.monotonic() < joins_s + JOINED_S:
            _watched(listener, LOOK_S)
            live = _live(listener)
        joined_s = time.monotonic() - joins_s
        _watched(listener, WARM_S)
        begin_s, router_s, view_s = time.monotonic(), cpu_s(network.router.pid), time.process_time()
        messages = _watched(listener, SECONDS)
        took_s = time.monotonic() - begin_s
        router, view = cpu_s(network.router.pid) - router_s, time.process_time() - view_s
        live = _live(listener)
        missed = sum(row.missed_warnings for row in _rows(listener))
    crowd.terminate()
    head = (
        "robots",
        "of them live",
        "all live after, s",
        "messages /s",
        "warnings missed",
        "router, % of a core",
        "view",
    )
    table = Table("Many robots, one view", head)
    shares = 100 * router / took_s, 100 * view / took_s
    table.rows.append((str(robots), live, joined_s, messages / took_s, missed, *shares))
    table.notes.append(
        f"The robots are one process; each sends a status and a warning a second. The view looks five times a second. "
        f"The router has {memory_mb(network.router.pid):.0f} MB."
    )
    return table


def _watched(listener: FleetListener, seconds: float) -> int:
    """Watch for some seconds; return the number of messages."""
    until_s = time.monotonic() + seconds
    count = 0
    while time.monotonic() < until_s:
        time.sleep(LOOK_S)
        count += len(listener.take(0))
        _rows(listener)
    return count


def _rows(listener: FleetListener) -> list:
    return [row for row in listener.state.rows(time.monotonic()) if row.robot.startswith("c")]


def _live(listener: FleetListener) -> int:
    return sum(row.state == LIVE for row in _rows(listener))
