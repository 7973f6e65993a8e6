"""What is asked is done only for who may ask, only now, and never by halves; through the engine and real bytes."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

MS = 1_000_000
FULL = np.full((4, 4), 100)
EMPTY = np.zeros((4, 4), dtype=int)
Run = Any


def code(reply: dict[str, Any]) -> tuple[str, str] | None:
    """Code and field of a refusal; None where it was done."""
    assert set(reply) == {"v", "id", "t_ns", "ok", "result" if reply["ok"] else "error"}
    assert reply["v"] == 1
    if reply["ok"]:
        return None
    assert set(reply["error"]) == {"code", "message", "field"}
    assert reply["error"]["message"]
    return reply["error"]["code"], reply["error"]["field"]


def bring_up(run: Run, *, tare: bool = True) -> None:
    """Both fingers free and tared, the gripper active, its lease with ann."""
    for _ in range(3):
        run.image(EMPTY)
        run.wrench(0.0)
        run.skin(0.0)
    if tare:
        run.ask("tare", finger="left", seconds=0.01)
        for _ in range(20):
            run.wrench(0.0)
    assert code(run.ask("lease.acquire", ttl_ms=1000)) is None
    run.serve_gripper(50)
    assert code(run.ask("gripper.activate")) is None
    run.serve_gripper(100)
    run.wrench(0.0)
    run.skin(0.0)


def writes(run: Run) -> list[tuple[int, ...]]:
    """Registers that were written since the last call."""
    done, run.gripper.writes = run.gripper.writes, []
    return list(done)


class TestEnvelope:
    def test_hello_tells_what_every_other_request_needs(self, run: Run) -> None:
        reply = run.ask("hello", boot=..., deadline_ns=...)
        assert reply["result"] == {"boot": "b00t", "t_ns": run.t_ns, "version": 1, "fingers": ["left", "right"]}
        assert reply["t_ns"] == run.t_ns

    @pytest.mark.parametrize("request_id", ["c41f-7", 0, -5, 2**40, ""])
    def test_a_reply_repeats_the_id_of_its_request(self, run: Run, request_id: str | int) -> None:
        assert run.ask("status", id=request_id)["id"] == request_id
        assert run.ask("no.such.op", id=request_id)["id"] == request_id

    @pytest.mark.parametrize(
        ("fields", "refusal"),
        [
            ({"v": 2}, ("unsupported_version", "v")),
            ({"id": ...}, ("bad_type", "id")),
            ({"id": [1]}, ("bad_type", "id")),
            ({"op": "grip"}, ("unknown_op", "op")),
            ({"boot": "old"}, ("wrong_boot", "boot")),
            ({"boot": ...}, ("missing_field", "boot")),
            ({"deadline_ns": 1}, ("deadline_passed", "deadline_ns")),
            ({"deadline_ns": 10**18}, ("deadline_too_far", "deadline_ns")),
            ({"ttl_ms": ...}, ("missing_field", "ttl_ms")),
            ({"ttl_ms": "1000"}, ("bad_type", "ttl_ms")),
            ({"extra": 1}, ("unknown_field", "extra")),
        ],
    )
    def test_a_malformed_request_is_answered_and_does_nothing(
        self, run: Run, fields: dict[str, Any], refusal: tuple[str, str]
    ) -> None:
        given = {"ttl_ms": 1000} | fields
        assert code(run.ask(given.pop("op", "lease.acquire"), **given)) == refusal
        assert run.ask("status")["result"]["lease"] == {"held": False, "expires_in_s": None}

    def test_status_says_what_its_topic_says(self, run: Run) -> None:
        run.wrench(0.0)
        asked = run.ask("status")["result"]
        run.tick()
        told = run.told("status")[-1]
        assert set(told) == set(asked) | {"v", "seq", "boot", "t_ns", "timestamp", "frame", "config_id"}


class TestTare:
    def test_a_free_finger_is_tared_and_told_so(self, run: Run) -> None:
        run.image(EMPTY)
        run.wrench(0.2, (0.1, 0.0))
        reply = run.ask("tare", finger="left", seconds=0.01)
        assert reply["result"] == {"finger": "left", "seconds": 0.01, "verified": True, "tare_id": 0}
        assert run.ask("tare.get", finger="left")["result"]["busy"] is True
        for _ in range(12):
            run.wrench(0.2, (0.1, 0.0))
        got = run.ask("tare.get", finger="left")["result"]
        assert (got["tare_id"], got["busy"], got["readings"]) == (1, False, 10)
        assert got["taken_t_ns"] == run.t_ns - 2 * MS
        assert got["offset"] == pytest.approx([0.1, 0.0, -0.2, 0.0, 0.0, 0.0], abs=1e-6)
        assert run.told("slip.left")[-1]["tare_id"] == 1

    def test_a_bias_that_looks_like_a_contact_can_be_tared_but_not_verified(self, run: Run) -> None:
        run.wrench(25.0, (3.0, 0.0))
        assert run.ask("tare", finger="left", seconds=0.01)["result"]["verified"] is False
        for _ in range(12):
            run.wrench(25.0, (3.0, 0.0))
        assert run.level() == ("no_contact", [])

    def test_a_tared_finger_in_contact_is_not_tared(self, run: Run) -> None:
        bring_up(run)
        run.wrench(5.0)
        assert code(run.ask("tare", finger="left")) == ("in_contact", "finger")
        run.wrench(0.0)
        allowed = run.ask("tare", finger="left")["result"]
        assert (allowed["seconds"], allowed["verified"]) == (0.5, True)

    def test_a_finger_whose_image_is_pressed_is_not_tared(self, run: Run) -> None:
        run.image(FULL)
        run.wrench(0.0)
        assert code(run.ask("tare", finger="left")) == ("in_contact", "finger")

    def test_a_pad_that_is_the_force_sensor_is_tared_by_its_taxels(self, run: Run) -> None:
        run.skin(0.4, (0.2, 0.0))
        assert run.ask("tare", finger="right", seconds=0.1)["result"]["verified"] is True
        for _ in range(12):
            run.skin(0.4, (0.2, 0.0))
        got = run.ask("tare.get", finger="right")["result"]
        assert got["tare_id"] == 1
        assert got["offset"] == pytest.approx([1050.0, 1000.0, 1100.0] * 4)
        run.skin(5.0)
        assert code(run.ask("tare", finger="right")) == ("in_contact", "finger")

    def test_an_undone_tare_brings_the_one_before_back(self, run: Run) -> None:
        assert code(run.ask("tare.undo", finger="left")) == ("not_ready", "finger")
        bring_up(run)
        undone = run.ask("tare.undo", finger="left")["result"]
        assert undone == run.ask("tare.get", finger="left")["result"]
        assert (undone["tare_id"], undone["taken_t_ns"]) == (0, None)
        assert code(run.ask("tare.undo", finger="left")) == ("not_ready", "finger")

    def test_a_silent_finger_is_not_tared(self, run: Run) -> None:
        assert code(run.ask("tare", finger="left")) == ("not_ready", "finger")
        run.wrench(0.0)
        run.wait(100)
        run.tick()
        assert code(run.ask("tare", finger="left")) == ("not_ready", "finger")

    @pytest.mark.parametrize("seconds", [0, -1.0, 10.1, 1e300])
    def test_a_tare_takes_some_time_and_not_all_of_it(self, run: Run, seconds: float) -> None:
        run.wrench(0.0)
        assert code(run.ask("tare", finger="left", seconds=seconds)) == ("out_of_range", "seconds")
        assert run.ask("tare.get", finger="left")["result"]["busy"] is False

    @pytest.mark.parametrize("op", ["tare", "tare.get", "tare.undo"])
    def test_a_finger_that_is_not_there_is_told(self, run: Run, op: str) -> None:
        assert code(run.ask(op, finger="middle")) == ("unknown_finger", "finger")

    def test_nan_readings_do_not_enter_a_tare(self, run: Run) -> None:
        run.wrench(0.0)
        run.ask("tare", finger="left", seconds=0.02)
        for k in range(24):
            run.wrench(math.nan if k in (5, 11) else 0.3)
        got = run.ask("tare.get", finger="left")["result"]
        assert got["tare_id"] == 1
        assert got["offset"] == pytest.approx([0.0, 0.0, -0.3, 0.0, 0.0, 0.0], abs=1e-6)


class TestLease:
    def test_one_client_holds_it_until_its_last_nanosecond(self, run: Run) -> None:
        assert run.ask("lease.acquire", ttl_ms=200)["result"] == {"ttl_ms": 200}
        assert code(run.ask("lease.acquire", client=b"ben", ttl_ms=200)) == ("lease_held", "")
        run.t_ns += 200 * MS - 1
        assert run.ask("status")["result"]["lease"] == {"held": True, "expires_in_s": pytest.approx(1e-9)}
        assert code(run.ask("lease.renew", client=b"ben")) == ("no_lease", "")
        run.t_ns += 1
        assert code(run.ask("lease.renew")) == ("no_lease", "")
        assert code(run.ask("lease.acquire", client=b"ben", ttl_ms=200)) is None

    def test_its_end_moves_nothing(self, run: Run) -> None:
        bring_up(run)
        writes(run)
        run.ask("gripper.close", force_n=10.0)
        run.serve_gripper(50)
        assert len(writes(run)) == 1
        run.ask("lease.release")
        run.serve_gripper(2000)
        assert writes(run) == []

    @pytest.mark.parametrize("ttl_ms", [0, -1, 1001])
    def test_a_life_out_of_range_is_refused(self, run: Run, ttl_ms: int) -> None:
        assert code(run.ask("lease.acquire", ttl_ms=ttl_ms)) == ("out_of_range", "ttl_ms")

    def test_renewing_keeps_it(self, run: Run) -> None:
        run.ask("lease.acquire", ttl_ms=200)
        for _ in range(10):
            run.wait(150)
            assert run.ask("lease.renew")["result"] == {}
        assert run.ask("lease.release")["result"] == {}


MOVES: dict[str, dict[str, Any]] = {
    "grip.set": {"force_n": 5.0},
    "gripper.close": {"force_n": 5.0},
    "gripper.open": {"drop": True},
    "gripper.stop": {},
    "gripper.activate": {},
}


class TestGripper:
    @pytest.mark.parametrize("op", MOVES)
    def test_nobody_moves_it_without_the_lease(self, run: Run, op: str) -> None:
        bring_up(run)
        writes(run)
        assert code(run.ask(op, client=b"ben", **MOVES[op])) == ("no_lease", "")
        run.ask("lease.release")
        assert code(run.ask(op, **MOVES[op])) == ("no_lease", "")
        run.serve_gripper(100)
        assert writes(run) == []

    @pytest.mark.parametrize("op", [*MOVES, "lease.acquire", "lease.renew", "lease.release"])
    def test_a_rig_without_one_says_so(self, make_run: Callable[[str], Run], left: str, op: str) -> None:
        run = make_run(left)
        run.up()
        fields = {"ttl_ms": 100} if op == "lease.acquire" else MOVES.get(op, {})
        assert code(run.ask(op, **fields)) == ("no_gripper", "")

    def test_opening_without_one_is_no_question_of_contact(self, make_run: Callable[[str], Run], left: str) -> None:
        run = make_run(left)
        run.up()
        assert code(run.ask("gripper.open")) == ("no_gripper", "")

    @pytest.mark.parametrize("op", MOVES)
    def test_a_rig_without_a_limit_moves_nothing(
        self, make_run: Callable[[str], Run], left: str, gripper: str, op: str
    ) -> None:
        run = make_run(left + gripper.replace("max_force_n", "# max_force_n"))
        run.up()
        run.serve_gripper(50)
        assert code(run.ask("lease.acquire", ttl_ms=1000)) is None
        assert code(run.ask(op, **MOVES[op])) == ("no_limit", "")
        run.serve_gripper(100)
        assert writes(run) == []

    @pytest.mark.parametrize("op", set(MOVES) - {"gripper.activate"})
    def test_one_that_is_not_activated_moves_nothing(self, run: Run, op: str) -> None:
        run.ask("lease.acquire", ttl_ms=1000)
        run.serve_gripper(50)
        assert code(run.ask(op, **MOVES[op])) == ("not_active", "")
        run.serve_gripper(100)
        assert writes(run) == []

    def test_one_that_never_answered_is_not_activated_either(self, run: Run) -> None:
        run.ask("lease.acquire", ttl_ms=1000)
        assert code(run.ask("gripper.activate")) == ("no_gripper", "")

    def test_one_with_a_fault_moves_nothing(self, run: Run) -> None:
        bring_up(run)
        run.gripper.fault = 8
        run.serve_gripper(50)
        assert run.told("gripper")[-1]["fault"] == "over_temperature"
        assert code(run.ask("gripper.close", force_n=5.0)) == ("gripper_fault", "")

    def test_one_that_fell_silent_is_told(self, run: Run) -> None:
        bring_up(run)
        run.gripper.silent = True
        run.serve_gripper(500)
        assert code(run.ask("gripper.close", force_n=5.0)) == ("no_gripper", "")
        assert code(run.ask("gripper.stop")) == ("no_gripper", "")

    def test_a_grip_is_closed_with_the_force_below_what_was_asked(self, run: Run) -> None:
        bring_up(run)
        assert run.ask("gripper.close", force_n=10.05)["result"] == {"applied_n": pytest.approx(10.0)}
        run.serve_gripper(50)
        assert (run.gripper.told.position, run.gripper.told.force, run.gripper.told.go) == (255, 70, True)
        assert run.told("gripper")[-1]["force_command_n"] == pytest.approx(10.0)

    def test_a_grip_is_strengthened_where_it_is(self, run: Run) -> None:
        bring_up(run)
        run.ask("gripper.close", force_n=5.0, width_m=0.0)
        run.serve_gripper(50)
        assert code(run.ask("grip.set", force_n=12)) == ("not_ready", "force_n"), "nobody feels what it does"
        assert code(run.ask("grip.set", force_n=4)) is None, "to ease it is no danger of that kind"
        run.skin(5.0)
        run.wrench(5.0)
        assert run.ask("grip.set", force_n=12)["result"] == {"applied_n": pytest.approx(12.0)}
        run.serve_gripper(50)
        assert (run.gripper.told.position, run.gripper.told.force) == (255, 90)

    @pytest.mark.parametrize("force_n", [25.1, 2.9, -5.0, 0, 10**6, 1e308])
    @pytest.mark.parametrize("op", ["grip.set", "gripper.close"])
    def test_a_force_beyond_the_limits_is_refused_and_not_clamped(self, run: Run, op: str, force_n: float) -> None:
        bring_up(run)
        writes(run)
        assert code(run.ask(op, force_n=force_n)) == ("out_of_range", "force_n")
        run.serve_gripper(50)
        assert writes(run) == []

    @pytest.mark.parametrize("force_n", [math.nan, math.inf])
    def test_a_force_that_is_no_number_grips_with_nothing(self, run: Run, force_n: float) -> None:
        bring_up(run)
        writes(run)
        reply = run.ask("grip.set", force_n=force_n)
        assert code(reply) == ("not_finite", "force_n")
        run.serve_gripper(50)
        assert writes(run) == []

    def test_it_is_stopped_where_it_is(self, run: Run) -> None:
        bring_up(run)
        run.ask("gripper.close", force_n=5.0)
        run.serve_gripper(50)
        assert run.ask("gripper.stop")["result"] == {}
        run.serve_gripper(50)
        assert run.gripper.told.go is False
        assert run.gripper.told.activate is True

    def test_it_opens_when_every_finger_is_known_to_be_free(self, run: Run) -> None:
        bring_up(run)
        run.ask("gripper.close", force_n=5.0)
        run.serve_gripper(50)
        run.wrench(0.0)
        run.skin(0.0)
        assert run.ask("gripper.open")["result"] == {"applied_n": pytest.approx(3.0)}
        run.serve_gripper(50)
        assert (run.gripper.told.position, run.gripper.told.go) == (0, True)

    def in_contact(self, run: Run) -> None:
        run.wrench(5.0)

    def silent(self, run: Run) -> None:
        run.wait(100)
        run.tick()

    def unplugged(self, run: Run) -> None:
        run.down("right.pad")

    def overloaded(self, run: Run) -> None:
        run.wrench(0.0, status=2)

    def untared(self, run: Run) -> None:
        run.ask("tare.undo", finger="left")

    @pytest.mark.parametrize("state", ["in_contact", "silent", "unplugged", "overloaded", "untared"])
    def test_it_drops_nothing_unless_told_to(self, run: Run, state: str) -> None:
        """Unknown is not free."""
        bring_up(run)
        run.ask("gripper.close", force_n=5.0)
        run.serve_gripper(50)
        run.wait(50)  # the last image is old, so it says nothing
        run.wrench(0.0)
        run.skin(0.0)
        getattr(self, state)(run)
        writes(run)
        refused = run.ask("gripper.open")
        assert code(refused) == ("in_contact", "drop")
        assert ("right" if state == "unplugged" else "left") in refused["error"]["message"]
        assert code(run.ask("gripper.open", drop=False)) == ("in_contact", "drop")
        run.serve_gripper(20)
        assert writes(run) == []
        assert code(run.ask("gripper.open", drop=True)) is None
        run.serve_gripper(50)
        assert run.gripper.told.position == 0

    def test_closing_does_not_drop_either(self, run: Run) -> None:
        bring_up(run)
        run.gripper.position = 128
        run.serve_gripper(50)
        writes(run)
        assert code(run.ask("gripper.close", force_n=5.0, width_m=0.06)) == ("out_of_range", "width_m")
        run.serve_gripper(50)
        assert writes(run) == []

    def test_nothing_moves_that_nobody_asked_for(self, run: Run) -> None:
        """Readings, ticks, faults, losses and refusals write nothing to the gripper."""
        bring_up(run)
        run.ask("gripper.close", force_n=5.0)
        run.serve_gripper(50)
        writes(run)
        for k in range(60):
            run.wrench(10.0, (4.9, 0.0))
            run.image(FULL)
            run.skin(10.0, (4.0, 0.0))
            run.serve_gripper(5)
            if k == 20:
                run.down("left.wrench")
            if k == 30:
                run.up("left.wrench")
            if k == 40:
                run.tick(suspended_ns=10**12)
        assert writes(run) == []

    def test_a_replugged_gripper_is_not_told_what_was_pending(self, run: Run) -> None:
        bring_up(run)
        run.gripper.silent = True
        run.ask("gripper.close", force_n=5.0)
        run.down("gripper")
        run.gripper.silent = False
        writes(run)
        run.up("gripper")
        run.serve_gripper(200)
        assert writes(run) == []
        assert code(run.ask("grip.set", force_n=5.0)) == ("no_lease", "")


class TestGravity:
    def test_gravity_is_taken_for_a_finger_with_a_force_sensor(self, run: Run) -> None:
        reply = run.ask("gravity.set", finger="left", gravity_mps2=[0.0, 0.0, -9.8])
        assert reply["result"] == {"gravity": "none"}, "the config gives no mass"

    @pytest.mark.parametrize(
        ("fields", "refusal"),
        [
            ({"finger": "right"}, ("not_ready", "finger")),
            ({"finger": "middle"}, ("unknown_finger", "finger")),
            ({"gravity_mps2": [0.0, 0.0, -98.0]}, ("out_of_range", "gravity_mps2")),
            ({"gravity_mps2": [0.0, -9.8]}, ("bad_type", "gravity_mps2")),
            ({"gravity_mps2": -9.8}, ("bad_type", "gravity_mps2")),
            ({"gravity_mps2": [0.0, 0.0, "down"]}, ("bad_type", "gravity_mps2")),
            ({"gravity_mps2": [0.0, 0.0, True]}, ("bad_type", "gravity_mps2")),
            ({"gravity_mps2": ...}, ("missing_field", "gravity_mps2")),
        ],
    )
    def test_anything_else_is_refused(self, run: Run, fields: dict[str, Any], refusal: tuple[str, str]) -> None:
        given = {"finger": "left", "gravity_mps2": [0.0, 0.0, -9.8]} | fields
        assert code(run.ask("gravity.set", **given)) == refusal
