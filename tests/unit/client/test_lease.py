"""A lease in its block: renewed, lost, given back."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest

from slipd_client.errors import LeaseLost, RequestRefused
from slipd_client.grip import GripClient

if TYPE_CHECKING:
    from conftest import Daemon

PATIENCE_S = 10.0


def refuse(code: str, message: str = "no") -> Callable[[Any], dict[str, Any]]:
    return lambda _: {"error": {"code": code, "message": message, "field": ""}}


def test_a_lease_is_given_back_at_the_end_of_the_block(daemon: Daemon) -> None:
    with GripClient(daemon.endpoint) as client, client.lease(150):
        client.grip_set(5.0)
    assert daemon.requests[1]["ttl_ms"] == 150
    assert [op for op in daemon.ops if op != "lease.renew"] == ["hello", "lease.acquire", "grip.set", "lease.release"]


def test_a_lease_renews_itself_while_the_block_runs(daemon: Daemon, often: int) -> None:
    with GripClient(daemon.endpoint) as client, client.lease(often) as lease:
        until_s = time.monotonic() + PATIENCE_S
        while daemon.ops.count("lease.renew") < 3:
            client.status()
            lease.wait(0.001)
            assert time.monotonic() < until_s
        assert (lease.lost, lease.why) == (False, "")
    assert daemon.ops[-1] == "lease.release"


def test_a_lease_that_is_refused_its_renewal_is_lost_at_once(daemon: Daemon, often: int) -> None:
    daemon.handlers["lease.renew"] = refuse("no_lease", "it has ended")
    with GripClient(daemon.endpoint) as client, client.lease(often) as lease:
        with pytest.raises(LeaseLost, match="it has ended"):
            lease.wait(PATIENCE_S)
        assert (lease.lost, lease.why) == (True, "no_lease: it has ended")
        for move in (lambda: client.grip_set(5.0), client.gripper_stop, client.fault_ack):
            with pytest.raises(LeaseLost):
                move()
        client.status()
    assert not {"grip.set", "gripper.stop", "fault.ack", "lease.release"} & set(daemon.ops)


def test_a_renewal_that_the_daemon_is_too_busy_for_is_asked_again(daemon: Daemon, often: int) -> None:
    answers = iter([{"error": {"code": "busy", "message": "ask more slowly"}}] * 2)
    daemon.handlers["lease.renew"] = lambda _: next(answers, {})
    with GripClient(daemon.endpoint) as client, client.lease(often) as lease:
        until_s = time.monotonic() + PATIENCE_S
        while daemon.ops.count("lease.renew") < 4:
            lease.wait(0.001)
            assert time.monotonic() < until_s


@pytest.mark.parametrize("code", ["no_lease", "wrong_boot"])
def test_a_refusal_for_want_of_the_lease_ends_it(daemon: Daemon, code: str) -> None:
    daemon.handlers["grip.set"] = refuse(code)
    with GripClient(daemon.endpoint) as client, client.lease(60_000) as lease:
        with pytest.raises(RequestRefused, match=code):
            client.grip_set(5.0)
        assert lease.lost


def test_a_lease_that_was_not_renewed_in_time_is_lost_without_a_word_of_the_daemon(daemon: Daemon) -> None:
    daemon.handlers["lease.renew"] = lambda _: None
    with GripClient(daemon.endpoint) as client, client.lease(30) as lease:
        with pytest.raises(LeaseLost):
            lease.wait(PATIENCE_S)
        with pytest.raises(LeaseLost, match="keeps its force"):
            client.grip_set(5.0)


def test_a_lease_of_a_thread_that_is_no_more_is_renewed_no_more(daemon: Daemon, often: int) -> None:
    with GripClient(daemon.endpoint) as client:
        lease = client.lease(often)
        owner = threading.Thread(target=lease.__enter__)
        owner.start()
        owner.join()
        until_s = time.monotonic() + PATIENCE_S
        while any(thread.name == "slipd-lease" for thread in threading.enumerate()):
            assert time.monotonic() < until_s
            time.sleep(0.001)
        lease.__exit__(None, None, None)


def test_a_connection_that_is_closed_within_the_block_loses_the_lease(daemon: Daemon, often: int) -> None:
    client = GripClient(daemon.endpoint)
    with client.lease(often) as lease:
        client.disconnect()
        with pytest.raises(LeaseLost, match="closed"):
            lease.wait(PATIENCE_S)


def test_one_client_holds_one_lease(daemon: Daemon) -> None:
    with GripClient(daemon.endpoint) as client, client.lease():
        with pytest.raises(ValueError, match="one at a time"), client.lease():
            pytest.fail("the block ran")
        assert daemon.ops.count("lease.acquire") == 1
    assert daemon.ops.count("lease.release") == 1


def test_a_lease_is_given_back_when_the_block_fails(daemon: Daemon) -> None:
    daemon.handlers["grip.set"] = refuse("no_limit")
    with GripClient(daemon.endpoint) as client, pytest.raises(RequestRefused, match="no_limit"), client.lease():
        client.grip_set(5.0)
    assert daemon.ops[-1] == "lease.release"


def test_a_lease_that_has_ended_by_itself_is_no_error_to_give_back(daemon: Daemon) -> None:
    daemon.handlers["lease.release"] = refuse("no_lease")
    with GripClient(daemon.endpoint) as client, client.lease():
        pass
    assert daemon.ops[-1] == "lease.release"


def test_a_lease_that_is_refused_runs_no_block_and_releases_nothing(daemon: Daemon) -> None:
    daemon.handlers["lease.acquire"] = refuse("lease_held")
    with GripClient(daemon.endpoint) as client, pytest.raises(RequestRefused, match="lease_held"), client.lease():
        pytest.fail("the block ran")
    assert "lease.release" not in daemon.ops
