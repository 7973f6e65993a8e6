"""The line to the gripper: polled once it opens, lost together with the lease, written to in the call of a request."""

from __future__ import annotations

from typing import Any

import pytest

from slipd.events import Request, Write

MS = 1_000_000

Run = Any


class TestGripperLine:
    def test_the_gripper_is_polled_as_soon_as_its_line_opens(self, run: Run) -> None:
        written = [output for _, output in run.out if isinstance(output, Write)]
        assert {output.link for output in written} == {"gripper"}
        run.serve_gripper(200)
        bodies = run.published("gripper")
        assert len(bodies) >= 5
        assert bodies[-1]["width_m"] == pytest.approx(0.085)
        assert (bodies[-1]["active"], bodies[-1]["echo_ok"]) == (False, None)

    def test_loss_of_the_line_is_published_and_ends_the_lease(self, run: Run) -> None:
        run.serve_gripper(100)
        assert run.ask("lease.acquire", ttl_ms=200)["ok"]
        run.down("gripper")
        assert run.published("gripper")[-1]["active"] is None
        assert run.ask("status")["result"]["lease"]["held"] is False

    def test_a_command_is_written_in_the_call_that_brings_its_request(self, run: Run) -> None:
        run.serve_gripper(100)
        run.ask("lease.acquire", ttl_ms=200)
        run.wait(6)  # no poll is under way, and the gripper's own pause is over
        envelope = {"v": 1, "id": "once", "boot": "b00t", "deadline_ns": run.t_ns + MS}
        out = run.feed(Request(b"ann", envelope | {"op": "gripper.activate", "drop": True}))
        assert [type(output).__name__ for output in out] == ["Reply", "Write"]
