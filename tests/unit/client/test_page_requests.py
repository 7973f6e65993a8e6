"""What people may request on the page, and what they read where it is refused."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from slipd_client.page.requests_of_page import PageRequests

if TYPE_CHECKING:
    from conftest import Daemon


async def test_the_grip_force_is_changed_under_a_lease(daemon: Daemon) -> None:
    daemon.handlers["grip.adjust"] = lambda request: {"applied_n": 11.0 + request["delta_n"]}
    requests = PageRequests(daemon.endpoint)
    reply = await requests.carry_out('{"do": "adjust", "delta_n": -1}')
    assert reply == {"ok": True, "text": "grip force -1 N: the gripper was sent 10.0 N on each pad"}
    assert [op for op in daemon.ops if op != "hello"] == ["lease.acquire", "grip.adjust", "lease.release"]


async def test_a_tare_reports_what_was_taken(daemon: Daemon) -> None:
    daemon.handlers["tare"] = lambda _: {
        "finger": "left",
        "seconds": 0.01,
        "verified": False,
        "tare_id": 3,
        "tare_ids": {"wrench": 3},
    }
    taken = {"taken_t_ns": 1, "readings": 9, "offset": [0.0], "by": "page", "finger": "left", "stream": "wrench"}
    daemon.handlers["tare.get"] = lambda _: taken | {"tare_id": 4, "busy": False}
    reply = await PageRequests(daemon.endpoint).carry_out('{"do": "tare", "finger": "left"}')
    assert reply == {
        "ok": True,
        "text": "left: zero taken of wrench (tare 4); the daemon does not know whether anything touched the finger",
    }


async def test_a_refusal_is_shown_in_the_words_of_the_daemon(daemon: Daemon) -> None:
    daemon.handlers["lease.acquire"] = lambda _: {
        "error": {"code": "lease_held", "message": "another client holds the lease", "field": ""}
    }
    reply = await PageRequests(daemon.endpoint).carry_out('{"do": "adjust", "delta_n": 1}')
    assert reply == {"ok": False, "text": "lease_held: another client holds the lease"}


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "[" * 4000,
        "1",
        "{}",
        '{"do": "gripper.open"}',
        '{"do": "adjust"}',
        '{"do": "adjust", "delta_n": 2}',
        '{"do": "adjust", "delta_n": "1"}',
        '{"do": "adjust", "delta_n": NaN}',
        '{"do": "adjust", "delta_n": [1]}',
        '{"do": "tare"}',
        '{"do": "tare", "finger": 1}',
        '{"do": ["tare"], "finger": "left"}',
    ],
)
async def test_a_page_can_request_nothing_else(text: str, daemon: Daemon) -> None:
    reply = await PageRequests(daemon.endpoint).carry_out(text)
    assert reply["ok"] is False
    assert daemon.ops == []


async def test_a_key_that_may_only_read_is_known_before_the_first_request(daemon: Daemon) -> None:
    requests = PageRequests(daemon.endpoint)
    assert await requests.permission() == ""
    daemon.handlers["hello"] = lambda _: {
        "error": {"code": "read_only", "message": "this key may read but not request", "field": ""}
    }
    assert await requests.permission() == "read_only: this key may read but not request"


async def test_without_a_daemon_a_request_says_so(requests: str) -> None:
    page = PageRequests(requests)
    assert await page.permission() == ""
    reply = await page.carry_out('{"do": "tare", "finger": "left"}')
    assert reply["ok"] is False
    assert "Is slipd running?" in reply["text"]
