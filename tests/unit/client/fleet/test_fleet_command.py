"""`slipctl fleet` as a process: a terminal, a log, JSON; robots are real sessions with real publishers."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator

import pytest
from terminals import PseudoTerminal

from slipd_client.messages import encode
from slipd_client.slipctl import main

pytest.importorskip("zenoh", reason="needs eclipse-zenoh, the extra `fleet`")

from zenoh_peers import Router, free_endpoint, session

from slipd_client.fleet import fleet_command
from slipd_client.fleet.robot_bridge import BridgePublisher

PATIENCE_S = 60.0

Start = Callable[..., "subprocess.Popen[str]"]


class Robot:
    """A robot of the fleet, as its bridge is."""

    def __init__(self, endpoint: str, name: str, boot: str = "b") -> None:
        self._boot = boot
        self._stack = contextlib.ExitStack()
        self._publisher = BridgePublisher(self._stack.enter_context(session(endpoint)), "slipd", name)
        self._publisher.set_daemon_alive(True)
        self._seq = 0

    def reports(self, level: str, health: int = 0) -> None:
        """Publish ``status``."""
        self._seq += 1
        header = {"v": 1, "seq": self._seq, "boot": self._boot, "t_ns": time.monotonic_ns()}
        stream = {"health": health, "message": "nothing arrives" if health else ""}
        body = header | {"fingers": {"left": {"level": level}}, "streams": {"left.pad": stream}}
        self._publisher.put("status", encode(body))

    def leaves(self) -> None:
        self._stack.close()


@pytest.fixture
def router() -> Iterator[Router]:
    with Router() as router:
        yield router


@pytest.fixture
def robots(router: Router) -> Iterator[dict[str, Robot]]:
    robots = {name: Robot(router.endpoint, name) for name in ("arm1", "arm2")}
    yield robots
    for robot in robots.values():
        robot.leaves()


def test_one_look_shows_every_robot_also_those_that_spoke_before(
    slipctl: Start, router: Router, robots: dict[str, Robot]
) -> None:
    robots["arm1"].reports("stable")
    robots["arm2"].reports("caution", health=3)
    command = ("fleet", "--connect", router.endpoint, "--once", "--json")
    deadline_s = time.monotonic() + PATIENCE_S
    while True:
        told = json.loads(slipctl(*command).communicate(timeout=PATIENCE_S)[0])
        if [robot["robot"] for robot in told["robots"]] and all(robot["fingers"] for robot in told["robots"]):
            break
        assert time.monotonic() < deadline_s
    assert sorted(robot["robot"] for robot in told["robots"]) == ["arm1", "arm2"]
    assert {robot["robot"]: robot["fingers"] for robot in told["robots"]} == {
        "arm1": {"left": "stable"},
        "arm2": {"left": "caution"},
    }


def test_one_look_without_a_router_ends_with_an_error(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(fleet_command, "ROUTER_S", 0.0)
    endpoint = free_endpoint()
    assert main(["fleet", "--connect", endpoint, "--once"]) == 1
    assert capsys.readouterr().err.endswith(f"slipctl: no Zenoh router at {endpoint} for 0 s: is it running?\n")


def test_a_terminal_shows_the_most_urgent_robot_first_and_is_itself_the_router() -> None:
    endpoint = free_endpoint()
    with PseudoTerminal(100, 12) as terminal:
        command = [sys.executable, "-m", "slipd_client.slipctl", "fleet", "--listen", endpoint]
        variables = os.environ | {"TERM": "xterm", "LANG": "C.UTF-8", "LC_ALL": "C.UTF-8"}
        with subprocess.Popen(command, stdin=terminal.slave, stdout=terminal.slave, env=variables) as process:
            try:
                terminal.wait_for(lambda lines: lines[0] == "fleet slipd  0 robots")
                robots = [Robot(endpoint, "arm1"), Robot(endpoint, "arm2")]

                def speak() -> None:
                    robots[0].reports("stable")
                    robots[1].reports("warning")

                def urgent_first(lines: list[str]) -> bool:
                    names = [line.partition(" ")[0] for line in lines[2:4]]
                    return "2 live  1 warning" in lines[0] and names == ["arm2", "arm1"]

                terminal.wait_for(urgent_first, speak)
                for robot in robots:
                    robot.leaves()
                terminal.wait_for(lambda lines: lines[0] == "fleet slipd  2 robots  2 gone")
            finally:
                process.send_signal(signal.SIGINT)
            assert process.wait(PATIENCE_S) == 130
