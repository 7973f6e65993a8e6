"""``slipctl fleet`` as a process: JSON, a terminal, and TLS as docs/fleet.md sets it up; robots are real sessions."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from client_peers import PATIENCE_S, Publisher, until
from documented_commands import commands
from project import DOCS, ROOT
from terminals import PseudoTerminal
from zenoh_peers import Router, free_endpoint, session

from slipd_client.fleet import fleet_command
from slipd_client.fleet.robot_bridge import BridgePublisher
from slipd_client.messages import encode

Start = Callable[..., "subprocess.Popen[str]"]


class Robot(ExitStack):
    """A robot of the fleet, as its bridge is, while its ``with`` statement runs."""

    def __init__(self, endpoint: str, name: str) -> None:
        super().__init__()
        self._publisher = BridgePublisher(self.enter_context(session(endpoint)), "slipd", name)
        self._publisher.set_daemon_alive(True)
        self._seq = 0

    def reports(self, level: str) -> None:
        self._seq += 1
        body = {"v": 1, "seq": self._seq, "boot": "b", "t_ns": time.monotonic_ns()}
        self._publisher.put("status", encode(body | {"fingers": {"left": {"level": level}}, "streams": {}}))


def test_one_look_shows_every_robot_also_those_that_spoke_before(slipctl: Start, router: Router) -> None:
    def shown() -> dict[str, dict[str, str]]:
        process = slipctl("fleet", "--connect", router.endpoint, "--once", "--json")
        robots = json.loads(process.communicate(timeout=PATIENCE_S)[0])["robots"]
        return {each["robot"]: each["fingers"] for each in robots}

    with Robot(router.endpoint, "arm1") as arm1, Robot(router.endpoint, "arm2") as arm2:
        arm1.reports("stable")
        arm2.reports("caution")
        until(lambda: shown() == {"arm1": {"left": "stable"}, "arm2": {"left": "caution"}})


def test_one_look_without_a_router_ends_with_an_error(
    monkeypatch: pytest.MonkeyPatch, call: Callable[..., tuple[int, str, str]]
) -> None:
    monkeypatch.setattr(fleet_command, "ROUTER_S", 0.0)
    endpoint = free_endpoint()
    code, _, errors = call("fleet", "--connect", endpoint, "--once")
    assert (code, errors.splitlines()[-1]) == (
        1,
        f"slipctl: no Zenoh router at {endpoint} for 0 s: is it running?",
    )


def test_a_terminal_shows_the_most_urgent_robot_first_and_is_itself_the_router() -> None:
    endpoint = free_endpoint()
    command = [sys.executable, "-m", "slipd_client.slipctl", "fleet", "--listen", endpoint]
    variables = os.environ | {"TERM": "xterm", "LANG": "C.UTF-8", "LC_ALL": "C.UTF-8"}
    with (
        PseudoTerminal(100, 12) as terminal,
        subprocess.Popen(command, stdin=terminal.slave, stdout=terminal.slave, env=variables) as process,
        ExitStack() as stack,
    ):
        stack.callback(process.kill)
        terminal.wait_for(lambda lines: lines[0] == "fleet slipd  0 robots")
        with Robot(endpoint, "arm1") as arm1, Robot(endpoint, "arm2") as arm2:

            def urgent_first(lines: list[str]) -> bool:
                names = [line.partition(" ")[0] for line in lines[2:4]]
                return "2 live  1 warning" in lines[0] and names == ["arm2", "arm1"]

            terminal.wait_for(urgent_first, lambda: (arm1.reports("stable"), arm2.reports("warning")))
        terminal.wait_for(lambda lines: lines[0] == "fleet slipd  2 robots  2 gone")
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE_S) == 130


PAGE = DOCS / "fleet.md"
EXAMPLES = ROOT / "clients" / "examples" / "fleet"


class SecureFleet:
    """Bridges of one publishing daemon, and views, with the certificates and configurations of the page, on loopback.

    Attributes:
        folder: Where the files are.
        router, robot, access: Configurations of the router and of arm3, and lines for that of the router.
    """

    def __init__(self, publisher: Publisher, slipctl: Start, folder: Path) -> None:
        self._publisher, self._slipctl, self.folder = publisher, slipctl, folder
        folder.mkdir()
        self._place = free_endpoint().removeprefix("tcp/")
        self.router, self.robot, access = (
            (EXAMPLES / f"{name}.json5").read_text(encoding="utf-8") for name in ("router", "robot", "access_control")
        )
        self.access = access[access.index("access_control") :]
        self._makers = [command.words for command in commands(PAGE) if command.words[0] == "openssl"]
        self.certify(*self._makers)

    def certify(self, *makers: tuple[str, ...], name: str = "arm3") -> None:
        """Make certificates; without commands, another one like that of arm3."""
        host = self._place.partition(":")[0]
        for words in makers or self._makers[-1:]:
            here = [word.replace("10.0.0.1", host).replace("arm3", name) for word in words]
            subprocess.run(here, cwd=self.folder, check=True, capture_output=True)

    def view(self, config: str) -> Any:
        return self._slipctl("fleet", "--json", "--zenoh-config", self._written("view", config))

    def bridge(self, robot: str, config: str, **variables: str) -> Any:
        command = ("serve", "fleet", "--robot", robot, "--zenoh-config", self._written(robot, config))
        return self._slipctl("--publish", self._publisher.endpoint, *command, env=os.environ | variables)

    def shown_when_live(self, view: Any, robot: str) -> dict[str, dict[str, Any]]:
        """Publish ``status`` until a view shows a robot as live; return what it shows then, by robot."""
        shown: dict[str, dict[str, Any]] = {}

        def look() -> bool:
            self._publisher.send("status", fingers={"left": {"level": "stable"}}, streams={})
            shown.update({each["robot"]: each for each in json.loads(view.stdout.readline())["robots"]})
            return shown.get(robot, {}).get("state") == "live"

        until(look)
        return shown

    def _written(self, name: str, config: str) -> str:
        path = self.folder / f"{name}.json5"
        config = config.replace("10.0.0.1:7447", self._place)
        path.write_text(re.sub(r'"(\w+\.(?:pem|key))"', rf'"{self.folder}/\1"', config), encoding="utf-8")
        return str(path)


@pytest.fixture
def fleet(publisher: Publisher, slipctl: Start, tmp_path: Path) -> SecureFleet:
    if shutil.which("openssl") is None:
        pytest.skip("needs openssl")
    return SecureFleet(publisher, slipctl, tmp_path / "files")


@pytest.mark.long
def test_a_robot_with_a_certificate_of_the_fleet_gets_in_and_others_do_not(
    fleet: SecureFleet, publisher: Publisher, slipctl: Start, tmp_path: Path
) -> None:
    view = fleet.view(fleet.router)
    assert json.loads(view.stdout.readline())["robots"] == []
    nameless = re.sub(r", enable_mtls.*?(?= })", "", fleet.robot)
    assert 'tls: { root_ca_certificate: "ca.pem" }' in nameless
    elsewhere = SecureFleet(publisher, slipctl, tmp_path / "elsewhere").folder
    forged = fleet.robot.replace("arm3.", f"{elsewhere}/arm3.")
    configs = {"nameless": nameless, "forged": forged, "open": fleet.robot.replace("tls/", "tcp/")}
    strangers = [fleet.bridge(robot, config, RUST_LOG="zenoh=warn") for robot, config in configs.items()]
    for stranger in strangers:
        assert stranger.stderr.readline().startswith("slipctl: no Zenoh router at ")
    assert any("CertificateRequired" in line for line in strangers[0].stdout), "why it was turned away"
    assert fleet.bridge("arm3", fleet.robot).stdout.readline().startswith("fleet: slipd/arm3 at ")
    shown = fleet.shown_when_live(view, "arm3")
    assert {robot: each["fingers"] for robot, each in shown.items()} == {"arm3": {"left": "stable"}}
    assert {stranger.poll() for stranger in strangers} == {None}, "they go on trying"


@pytest.mark.long
def test_a_robot_publishes_under_its_own_name_only_and_a_view_hears_all(fleet: SecureFleet) -> None:
    fleet.certify(name="office")
    office = fleet.robot.replace("arm3", "office")
    view = fleet.view(fleet.router.replace("{", f"{{\n{fleet.access}", 1))
    assert json.loads(view.stdout.readline())["robots"] == []
    for robot, config in (("arm4", fleet.robot), ("arm3", fleet.robot), ("arm5", office)):
        assert fleet.bridge(robot, config).stdout.readline().startswith(f"fleet: slipd/{robot} at ")
    for each in (view, fleet.view(office), view):
        assert fleet.shown_when_live(each, "arm3").keys() == {"arm3"}
