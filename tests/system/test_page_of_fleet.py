"""The page of `slipctl fleet --page` in a real browser, with robots that report, slip and vanish."""

from __future__ import annotations

import contextlib
import json
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from typing import Any

import pytest
from browser import MISSING, Browser

pytest.importorskip("zenoh", reason="needs eclipse-zenoh, the extra `fleet`")

from rig_parts import first_line, part
from zenoh_peers import free_endpoint, session

from slipd_client.fleet.robot_bridge import BridgePublisher
from slipd_client.messages import encode

pytestmark = pytest.mark.process

Fleet = tuple[str, "dict[str, Robot]"]
needs_browser = pytest.mark.skipif(bool(MISSING), reason=MISSING)


class Robot:
    """A robot that reports its level ten times a second."""

    def __init__(self, endpoint: str, name: str, boot: str = "b") -> None:
        self.level = "stable"
        self.endpoint = endpoint
        self._boot = boot
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._report, args=(endpoint, name))
        self._thread.start()

    def _report(self, endpoint: str, name: str) -> None:
        with session(endpoint) as here:
            publisher = BridgePublisher(here, "plant", name)
            publisher.set_daemon_alive(True)
            seq = 0
            while not self._ended.wait(0.1):
                seq += 1
                header: dict[str, Any] = {"v": 1, "seq": seq, "boot": self._boot, "t_ns": time.monotonic_ns()}
                stream = {"health": 1, "message": "<b>late</b>"}
                fingers = {"left": {"level": self.level, "reasons": []}}
                publisher.put("status", encode(header | {"fingers": fingers, "streams": {"left.pad": stream}}))

    def leaves(self) -> None:
        self._ended.set()
        self._thread.join()


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Fleet]:
    """The address of the page, and two robots."""
    endpoint = free_endpoint()
    fleet = ("fleet", "--fleet", "plant", "--listen", endpoint, "--page", "127.0.0.1:0")
    with (
        part(tmp_path_factory.mktemp("fleet"), "slipd_client.slipctl", *fleet) as process,
        contextlib.ExitStack() as stack,
    ):
        url = first_line(process).removeprefix("fleet: ")
        robots = {name: Robot(endpoint, name) for name in ("arm1", "arm2")}
        for robot in robots.values():
            stack.callback(robot.leaves)
        yield url, robots


@pytest.mark.parametrize("heads", [{}, {"Authorization": "Bearer wrong"}])
def test_the_data_of_the_page_need_its_token(fleet: Fleet, heads: dict[str, str]) -> None:
    request = urllib.request.Request(f"{fleet[0].partition('#')[0]}data/fleet.json", headers=heads)
    with pytest.raises(urllib.error.HTTPError, match="401"):
        urllib.request.urlopen(request)


def shows(*rows: list[Any]) -> str:
    """Return a condition: the table has these robots in this order, each with its state, level and health."""
    return f"""JSON.stringify([...document.querySelectorAll("#robot-rows tr")].map((row) => [row.dataset.robot,
        [...row.cells].slice(1, 4).map((cell) => cell.textContent)])) === JSON.stringify({json.dumps(rows)})"""


@needs_browser
def test_Z9_a_robot_that_the_view_no_longer_lists_leaves_the_page(fleet: Fleet, browser: Browser) -> None:
    """As where another displaced it: a row that stays would show its last level for ever."""
    browser.open(fleet[0])
    browser.until("slipd.rows.size === 2")
    browser.until("""(() => {
        const whole = window.fetch;
        window.fetch = async (...asked) => {
            const fleet = await (await whole(...asked)).json();
            return Response.json({ ...fleet, robots: fleet.robots.filter((robot) => robot.robot !== "arm2") });
        };
        return true;
    })()""")
    browser.until(shows(["arm1", ["live", "STABLE", "WARN"]]))
    browser.until("slipd.rows.size === 1")


@needs_browser
def test_the_page_shows_levels_names_that_clash_and_robots_that_vanish_the_most_urgent_first(
    fleet: Fleet, browser: Browser
) -> None:
    url, robots = fleet
    browser.leave()
    browser.open(url)
    calm = ["live", "STABLE", "WARN"]
    browser.until(shows(["arm1", calm], ["arm2", calm]))
    browser.until("""document.getElementById("facts").textContent.includes("2 of 2 robots are live")""")
    other = Robot(robots["arm2"].endpoint, "arm2", boot="c")
    try:
        said = browser.until(
            """(([, ...cells]) => cells.slice(0, 3).join(" ") === "clash UNKNOWN WARN" && cells[4])(
                [...slipd.rows.get("arm2").cells].map((cell) => cell.textContent))"""
        )
        assert said.startswith("two or more robots call themselves arm2: give each a name of its own")
    finally:
        other.leaves()
    browser.until(shows(["arm1", calm], ["arm2", calm]))
    robots["arm2"].level = "slipping"
    browser.until(shows(["arm2", ["live", "SLIPPING", "WARN"]], ["arm1", calm]))
    browser.until("""slipd.rows.get("arm2").cells[5].textContent.includes("left.pad: <b>late</b>")""")
    robots["arm1"].leaves()
    browser.until(shows(["arm2", ["live", "SLIPPING", "WARN"]], ["arm1", ["gone", "UNKNOWN", "unknown"]]))
