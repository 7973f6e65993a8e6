"""Watches the fleet as ``slipctl fleet`` does."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator

from zenoh_peers import session

from slipd_client.fleet.fleet_listener import FleetListener
from slipd_client.fleet.fleet_state import LIVE

FLEET = "slipd"
"""Name of the fleet that is measured."""

LOOK_S = 0.01


@contextlib.contextmanager
def watching(endpoint: str) -> Iterator[Callable[[], set[str]]]:
    """Watch while the block runs; yield what returns the robots that are live, after it has taken what arrived."""
    with session(endpoint) as here:
        listener = FleetListener(here, FLEET)

        def live() -> set[str]:
            listener.take(LOOK_S)
            return {row.robot for row in listener.state.rows(time.monotonic()) if row.state == LIVE}

        yield live
