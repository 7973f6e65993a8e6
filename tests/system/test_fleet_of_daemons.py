"""A whole daemon, its bridge and the view of its fleet, each as a process of its own."""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from loop_waits import eventually
from service_rig import Rig, started

pytest.importorskip("zenoh", reason="needs eclipse-zenoh, the extra `fleet`")

from zenoh_peers import free_endpoint, session

from slipd_client.fleet.fleet_network import FleetListener
from slipd_client.fleet.fleet_state import SILENT_AFTER_S
from slipd_client.messages import decode

TOPICS = ("warning", "status", "slip.left", "wrench.left", "tactile.left")


@contextlib.contextmanager
def slipctl(output: Path, *arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run slipctl until the block ends; what it prints goes into a file."""
    command = [sys.executable, "-m", "slipd_client.slipctl", *arguments]
    with output.open("wb") as file, subprocess.Popen(command, stdout=file) as process:
        try:
            yield process
        finally:
            process.kill()


@contextlib.contextmanager
def subscribed(endpoint: str, key: str) -> Iterator[list[tuple[str, dict[str, Any]]]]:
    """Subscribe as any Zenoh program does; yield the key and the decoded message of everything that arrives."""
    arrived: list[tuple[str, dict[str, Any]]] = []
    with session(endpoint) as here:
        here.declare_subscriber(
            key, lambda sample: arrived.append((str(sample.key_expr), decode(sample.payload.to_bytes())))
        )
        yield arrived


@pytest.mark.process
async def test_the_warnings_of_a_daemon_reach_its_fleet_also_who_joins_after_its_end(rig: Rig, tmp_path: Path) -> None:
    endpoint = free_endpoint()
    fleet, view = ("--fleet", "plant"), tmp_path / "view"

    def seen() -> list[dict[str, Any]]:
        """What the view printed of the robot, line by line."""
        return [row for line in view.read_text().split("\n")[:-1] for row in json.loads(line)["robots"]]

    def shows(**expected: Any) -> Callable[[], bool]:
        """Return a condition: the newest line has these values."""
        return lambda: expected.items() <= next(reversed(seen()), {}).items()

    with contextlib.ExitStack() as stack:
        daemon, client = stack.enter_context(started(rig.file))
        stack.enter_context(slipctl(view, "fleet", "--json", *fleet, "--listen", endpoint))
        arrived = stack.enter_context(subscribed(endpoint, "plant/arm1/*"))

        def crossed() -> list[dict[str, Any]]:
            return [body for key, body in arrived if key == "plant/arm1/warning"]

        def nothing_more_to_come() -> bool:
            return crossed()[-1:] == client.hear("warning")[-1:] != []

        serve = ("--publish", client.endpoints.publish, "serve", "fleet", *fleet)
        with slipctl(tmp_path / "bridge", *serve, "--robot", "arm1", "--connect", endpoint) as bridge:
            await eventually(
                lambda: {f"plant/arm1/{topic}" for topic in TOPICS} <= {key for key, _ in arrived}, rig.send
            )
            await eventually(shows(state="live", level="stable", missed_warnings=0), rig.send)
            await eventually(shows(state="live", level="unknown", reasons=["stale"]))
            await eventually(nothing_more_to_come)
            assert crossed() == client.hear("warning")[-len(crossed()) :]

            daemon.kill()
            await eventually(shows(state="silent", missed_warnings=0))
            late = FleetListener(stack.enter_context(session(endpoint)), "plant")
            kept: list[int] = []

            def all_warnings_again() -> bool:
                kept.extend(message.seq for message in late.receive(0) if message.topic == "warning")
                return kept == [body["seq"] for body in crossed()]

            def last_row() -> tuple[str, dict[str, str]] | None:
                return next(((row.state, row.fingers) for row in late.state.rows(0.0)), None)

            await eventually(all_warnings_again)
            await eventually(lambda: last_row() == ("silent", {"left": "unknown"}))

            bridge.kill()
            await eventually(shows(state="gone"))
    assert max(robot["age_s"] for robot in seen() if robot["state"] == "live") <= SILENT_AFTER_S
