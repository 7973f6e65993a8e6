"""A session that floods the fleet delays neither the view nor the alarm of another robot; real Zenoh sessions."""

from __future__ import annotations

import time

import pytest

from slipd_client.fleet import fleet_listener
from slipd_client.fleet.fleet_listener import FairQueue
from slipd_client.messages import encode

pytest.importorskip("zenoh", reason="needs eclipse-zenoh, the extra `fleet`")

import zenoh
from zenoh_peers import Router, session

from slipd_client.fleet.fleet_listener import FleetListener
from slipd_client.fleet.robot_bridge import BridgePublisher

PATIENCE_S = 60.0
FLOOD = 30_000


def warning(seq: int, boot: str) -> bytes:
    body = {"finger": "left", "level": "slipping", "previous": "stable", "rising": True, "utilisation": None}
    return encode({"v": 1, "seq": seq, "boot": boot, "t_ns": seq} | body)


def arrive(publisher: zenoh.Session, view: zenoh.Session, name: str) -> None:
    """Wait until all that a session has published has arrived at the session of the view."""
    key = f"arrived/{name}"
    with_order = {"priority": zenoh.Priority.INTERACTIVE_HIGH, "congestion_control": zenoh.CongestionControl.BLOCK}
    until_s = time.monotonic() + PATIENCE_S
    with view.declare_subscriber(key, zenoh.handlers.FifoChannel(1)) as arrived:
        while arrived.try_recv() is None:
            publisher.put(key, b"", **with_order)  # again: the router may not know of the subscriber yet
            assert time.monotonic() < until_s, f"what {name} published did not arrive"
            time.sleep(0.01)


def test_Z9_an_alarm_is_read_before_the_flood_that_came_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """One look has time for all that arrived, however slow the machine is; the alarm arrived last."""
    with Router() as router, session(router.endpoint) as here, session(router.endpoint) as other:
        view = FleetListener(here, "slipd")
        honest = BridgePublisher(other, "slipd", "honest")
        with session(router.endpoint) as hostile:
            flood = BridgePublisher(hostile, "slipd", "flood")
            until_s = time.monotonic() + PATIENCE_S
            while len(view.state.rows(0.0)) < 2:
                view.take(0.05)
                assert time.monotonic() < until_s, "the robots were not seen"
            for seq in range(1, FLOOD + 1):
                flood.put("warning", warning(seq, "flood"))
            arrive(hostile, here, "flood")
            honest.put("warning", warning(1, "honest"))
            arrive(other, here, "honest")
            monkeypatch.setattr(fleet_listener, "WORK_S", PATIENCE_S)
            boots = [message.raw["boot"] for message in view.take(0.05)]
            assert boots.index("honest") <= 2
            assert boots.count("flood") > FLOOD / 2


def test_each_peer_has_its_turn_and_its_share() -> None:
    queue: FairQueue[str] = FairQueue(share=3, most_peers=2)
    gave_way = [queue.add("a", f"a{n}") for n in range(4)]
    assert gave_way == [False, False, False, True]
    queue.add("b", "b0")
    queue.add("c", "c0")
    queue.add("d", "d0")
    found = []
    while queue:
        found.append(queue.take())
    assert found == ["a1", "b0", "c0", "a2", "d0", "a3"], "c and d share one queue"
