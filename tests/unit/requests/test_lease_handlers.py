"""Who holds the lease, and what its end does; engine and real bytes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from slipd.requests.idempotency import MOST_CLIENTS, PER_CLIENT

MS = 1_000_000

Run = Any


class TestLease:
    def test_one_client_holds_the_lease_until_its_last_nanosecond(self, run: Run) -> None:
        assert run.ask("lease.acquire", ttl_ms=200)["result"] == {"ttl_ms": 200}
        assert run.refusal("lease.acquire", client=b"ben", ttl_ms=200) == ("lease_held", "")
        assert run.refusal("lease.acquire", ttl_ms=1001) == ("out_of_range", "ttl_ms")
        run.wait(150)
        assert run.ask("lease.renew")["result"] == {}
        run.t_ns += 200 * MS - 1
        assert run.ask("status")["result"]["lease"] == {"held": True, "expires_in_s": pytest.approx(1e-9)}
        assert run.refusal("lease.renew", client=b"ben") == ("no_lease", "")
        run.t_ns += 1
        assert run.refusal("lease.renew") == ("no_lease", "")
        assert run.refusal("lease.acquire", client=b"ben", ttl_ms=200) is None
        assert run.ask("lease.release", client=b"ben")["result"] == {}

    def test_the_end_of_a_lease_moves_nothing(self, run: Run) -> None:
        run.bring_up()
        run.writes()
        run.ask("gripper.close", force_n=10.0)
        run.serve_gripper(50)
        assert len(run.writes()) == 1
        run.ask("lease.release")
        run.serve_gripper(2000)
        assert run.writes() == []

    def test_urgent_requests_of_the_holder_are_served_in_a_crowd_of_clients(self, run: Run) -> None:
        """More clients than are kept, and as many requests of the holder as are kept of one client."""
        run.ask("lease.acquire", ttl_ms=200)
        for _ in range(PER_CLIENT):
            run.ask("tare.get", finger="left", deadline_ns=run.t_ns + 400 * MS)
        for number in range(MOST_CLIENTS):
            run.ask("tare.get", client=b"%d" % number, finger="left", deadline_ns=run.t_ns + 400 * MS)
        assert run.refusal("tare.get", client=b"newcomer", finger="left") == ("busy", "")
        assert run.refusal("tare.get", finger="left") == ("busy", "")
        assert run.refusal("gripper.stop", client=b"newcomer") == ("busy", "")
        assert run.refusal("lease.renew") is None
        for op in ("grip.hold", "gripper.stop"):
            assert run.refusal(op) != ("busy", "")


class TestEndOfTheLease:
    @pytest.mark.parametrize("lease_end", ["hold", "stop"])
    @pytest.mark.parametrize("moving", [True, False])
    def test_A5_the_end_of_a_lease_is_published_within_a_tick_and_opens_nothing(
        self, make_run: Callable[[str], Run], rig: str, lease_end: str, moving: bool
    ) -> None:
        run = make_run(rig + f'lease_end = "{lease_end}"\n')
        run.up()
        run.bring_up()
        run.ask("gripper.close", force_n=5.0)
        run.gripper.found = 0 if moving else 2
        run.serve_gripper(100)
        run.writes()
        run.let_lease_be()
        run.ask("lease.renew")
        ends_ns = run.t_ns + 200 * MS
        before = len(run.published("gripper")), len(run.published("status"))
        run.serve_gripper(195)
        assert {body["lease"]["held"] for body in run.published("gripper")[before[0] :]} == {True}
        run.serve_gripper(10)
        ended = next(body for body in run.published("gripper")[before[0] :] if not body["lease"]["held"])
        assert ended["t_ns"] - ends_ns < 5 * MS
        assert run.published("status")[-1]["lease"] == {"held": False, "expires_in_s": None}
        run.serve_gripper(100)
        assert len(run.writes()) == (lease_end == "stop" and moving)
        assert run.gripper.command.position == 255
        assert run.gripper.command.go is not (lease_end == "stop" and moving)

    def test_a_lease_ends_before_the_next_client_gets_it(self, run: Run) -> None:
        run.lease()
        run.wait(201)
        assert run.refusal("lease.acquire", client=b"ben", ttl_ms=200) is None
        assert [body["lease"]["held"] for body in run.published("gripper")] == [False]
