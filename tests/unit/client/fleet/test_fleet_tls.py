"""TLS and access rules between bridges, router and views, by the commands of docs/fleet.md and its example."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from documented_commands import commands
from project import DOCS, ROOT

pytest.importorskip("zenoh", reason="needs eclipse-zenoh, the extra `fleet`")

from zenoh_peers import free_endpoint

if TYPE_CHECKING:
    from conftest import Publisher

PAGE = DOCS / "fleet.md"
EXAMPLES = ROOT / "clients" / "examples" / "fleet"
PATIENCE_S = 60.0

Start = Callable[..., "subprocess.Popen[str]"]

pytestmark = pytest.mark.skipif(shutil.which("openssl") is None, reason="needs openssl")


class Files:
    """The certificates and configurations of the page, for a router on loopback.

    Attributes:
        folder: Where they are.
        router: Configuration of the router.
        robot: That of arm3.
        access: Lines for that of the router.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir()
        self._place = free_endpoint().removeprefix("tcp/")
        self.router, self.robot, access = (
            (EXAMPLES / f"{name}.json5").read_text(encoding="utf-8") for name in ("router", "robot", "access_control")
        )
        self.access = access[access.index("access_control") :]
        self._makers = [command.words for command in commands(PAGE) if command.words[0] == "openssl"]
        for words in self._makers:
            self._run(words)

    def certify(self, name: str) -> None:
        """Make another certificate as that of arm3."""
        self._run(tuple(word.replace("arm3", name) for word in self._makers[-1]))

    def write(self, name: str, text: str) -> str:
        """Write a configuration and return its path."""
        text = text.replace("10.0.0.1:7447", self._place)
        path = self.folder / f"{name}.json5"
        path.write_text(re.sub(r'"(\w+\.(?:pem|key))"', rf'"{self.folder}/\1"', text), encoding="utf-8")
        return str(path)

    def _run(self, words: tuple[str, ...]) -> None:
        here = [word.replace("10.0.0.1", self._place.partition(":")[0]) for word in words]
        subprocess.run(here, cwd=self.folder, check=True, capture_output=True)


class Fleet:
    """Bridges of one publishing daemon, and views, as processes."""

    def __init__(self, publisher: Publisher, slipctl: Start, files: Files) -> None:
        self._publisher, self._slipctl, self._files = publisher, slipctl, files
        self._seq = 0

    def view(self, config: str) -> subprocess.Popen[str]:
        return self._slipctl("fleet", "--json", "--zenoh-config", self._files.write("view", config))

    def bridge(self, robot: str, config: str, **variables: str) -> subprocess.Popen[str]:
        options = ("--robot", robot, "--zenoh-config", self._files.write(robot, config))
        return self._slipctl(
            "--publish", self._publisher.endpoint, "serve", "fleet", *options, env=os.environ | variables
        )

    def until_live(self, view: subprocess.Popen[str], robot: str) -> dict[str, dict[str, Any]]:
        """Publish ``status`` until a view shows a robot as live; return what it shows then, by robot."""
        assert view.stdout is not None
        end_s = time.monotonic() + PATIENCE_S
        while True:
            self._seq += 1
            self._publisher.send("status", self._seq, fingers={"left": {"level": "stable"}}, streams={})
            shown = {each["robot"]: each for each in json.loads(view.stdout.readline())["robots"]}
            if shown.get(robot, {}).get("state") == "live":
                return shown
            assert time.monotonic() < end_s, shown


@pytest.fixture
def files(tmp_path: Path) -> Files:
    return Files(tmp_path / "files")


@pytest.fixture
def fleet(publisher: Publisher, slipctl: Start, files: Files) -> Fleet:
    return Fleet(publisher, slipctl, files)


def first_line(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline()


@pytest.mark.long
def test_a_robot_with_a_certificate_of_the_fleet_gets_in_and_others_do_not(
    fleet: Fleet, files: Files, tmp_path: Path
) -> None:
    view = fleet.view(files.router)
    assert json.loads(first_line(view))["robots"] == []
    nameless = re.sub(r", enable_mtls.*?(?= })", "", files.robot)
    assert 'tls: { root_ca_certificate: "ca.pem" }' in nameless
    elsewhere = Files(tmp_path / "elsewhere").folder
    forged = files.robot.replace("arm3.", f"{elsewhere}/arm3.")
    configs = {"nameless": nameless, "forged": forged, "open": files.robot.replace("tls/", "tcp/")}
    strangers = [fleet.bridge(robot, config, RUST_LOG="zenoh=warn") for robot, config in configs.items()]
    for stranger in strangers:
        assert stranger.stderr is not None
        assert stranger.stderr.readline().startswith("slipctl: no Zenoh router at ")
    assert strangers[0].stdout is not None
    assert any("CertificateRequired" in line for line in strangers[0].stdout), "why it was turned away"
    assert first_line(fleet.bridge("arm3", files.robot)).startswith("fleet: slipd/arm3 at ")
    shown = fleet.until_live(view, "arm3")
    assert {robot: each["fingers"] for robot, each in shown.items()} == {"arm3": {"left": "stable"}}
    assert {stranger.poll() for stranger in strangers} == {None}, "they go on trying"


@pytest.mark.long
def test_a_robot_publishes_under_its_own_name_only_and_a_view_hears_all(fleet: Fleet, files: Files) -> None:
    files.certify("office")
    view = fleet.view(files.router.replace("{", f"{{\n{files.access}", 1))
    assert json.loads(first_line(view))["robots"] == []
    for robot in ("arm4", "arm3"):
        assert first_line(fleet.bridge(robot, files.robot)).startswith(f"fleet: slipd/{robot} at ")
    assert first_line(fleet.bridge("arm5", files.robot.replace("arm3", "office"))).startswith("fleet: slipd/arm5 at ")
    assert fleet.until_live(view, "arm3").keys() == {"arm3"}
    assert fleet.until_live(fleet.view(files.robot.replace("arm3", "office")), "arm3").keys() == {"arm3"}
    assert fleet.until_live(view, "arm3").keys() == {"arm3"}
