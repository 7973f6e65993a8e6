"""A whole daemon, its bridge and the view of its fleet, each as a process of its own."""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from daemon_peers import until
from service_rig import Rig, client_of, start

pytest.importorskip("zenoh", reason="needs eclipse-zenoh, the extra `fleet`")

from zenoh_peers import free_endpoint, session

from slipd_client.fleet.fleet_listener import FleetListener
from slipd_client.fleet.fleet_state import SILENT_AFTER_S
from slipd_client.messages import decode

TOPICS = ("warning", "status", "slip.left", "wrench.left", "tactile.left")


@contextlib.contextmanager
def slipctl(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Run slipctl until the block ends."""
    command = [sys.executable, "-m", "slipd_client.slipctl", *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


class View:
    """What ``slipctl fleet --json`` prints, line by line, of a fleet of one robot."""

    def __init__(self) -> None:
        self.seen: list[dict[str, Any]] = []

    def shows(self, **expected: Any) -> Callable[[], bool]:
        """Return a condition: the newest line has these values."""
        return lambda: bool(self.seen) and expected.items() <= self.seen[-1].items()

    def read(self, process: subprocess.Popen[str]) -> None:
        """Read until the process ends."""
        assert process.stdout is not None
        for line in process.stdout:
            self.seen += json.loads(line)["robots"]


@contextlib.contextmanager
def viewing(*arguments: str) -> Iterator[View]:
    """Run ``slipctl fleet --json`` until the block ends."""
    view = View()
    with slipctl("fleet", "--json", *arguments) as process:
        reader = threading.Thread(target=view.read, args=(process,))
        reader.start()
        try:
            yield view
        finally:
            process.kill()
            reader.join()


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
async def test_the_warnings_of_a_daemon_reach_its_fleet_also_who_joins_after_its_end(rig: Rig) -> None:
    endpoint = free_endpoint()
    fleet = ("--fleet", "plant")
    with contextlib.ExitStack() as stack:
        daemon = stack.enter_context(start(rig.file))
        view = stack.enter_context(viewing(*fleet, "--listen", endpoint))
        client = client_of(daemon)
        arrived = stack.enter_context(subscribed(endpoint, "plant/arm1/*"))

        def crossed() -> list[dict[str, Any]]:
            return [body for key, body in arrived if key == "plant/arm1/warning"]

        def nothing_more_to_come() -> bool:
            return crossed()[-1:] == client.hear("warning")[-1:] != []

        publish = client.endpoints.publish
        with slipctl(
            "--publish", publish, "serve", "fleet", *fleet, "--robot", "arm1", "--connect", endpoint
        ) as bridge:
            await until(lambda: {f"plant/arm1/{topic}" for topic in TOPICS} <= {key for key, _ in arrived}, rig.send)
            await until(view.shows(state="live", level="stable", missed_warnings=0), rig.send)
            await until(view.shows(state="live", level="unknown", reasons=["stale"]))
            await until(nothing_more_to_come)
            assert crossed() == client.hear("warning")[-len(crossed()) :]

            daemon.kill()
            client.close()
            await until(view.shows(state="silent", missed_warnings=0))
            late = FleetListener(stack.enter_context(session(endpoint)), "plant")
            kept: list[int] = []

            def all_warnings_again() -> bool:
                kept.extend(message.seq for message in late.take(0) if message.topic == "warning")
                return kept == [body["seq"] for body in crossed()]

            def last_row() -> tuple[str, dict[str, str]] | None:
                return next(((row.state, row.fingers) for row in late.state.rows(0.0)), None)

            await until(all_warnings_again)
            await until(lambda: last_row() == ("silent", {"left": "unknown"}))

            bridge.kill()
            await until(view.shows(state="gone"))
    assert max(robot["age_s"] for robot in view.seen if robot["state"] == "live") <= SILENT_AFTER_S
