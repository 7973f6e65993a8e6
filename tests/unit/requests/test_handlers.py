"""Requests are checked, carried out at most once, and answered; engine and real bytes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

MS = 1_000_000
FULL = np.full((4, 4), 100)
EMPTY = np.zeros((4, 4), dtype=int)
Run = Any


class TestEnvelope:
    def test_hello_returns_boot_and_clock(self, run: Run) -> None:
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
            ({"id": ...}, ("missing_field", "id")),
            ({"id": [1]}, ("bad_type", "id")),
            ({"op": "grip"}, ("unknown_op", "op")),
            ({"boot": "old"}, ("wrong_boot", "boot")),
            ({"boot": ...}, ("missing_field", "boot")),
            ({"deadline_ns": 1}, ("deadline_passed", "deadline_ns")),
            ({"deadline_ns": 10**18}, ("deadline_too_far", "deadline_ns")),
            ({"ttl_ms": ...}, ("missing_field", "ttl_ms")),
            ({"ttl_ms": "200"}, ("bad_type", "ttl_ms")),
            ({"extra": 1}, ("unknown_field", "extra")),
        ],
    )
    def test_a_malformed_request_is_refused_and_changes_nothing(
        self, run: Run, fields: dict[str, Any], refusal: tuple[str, str]
    ) -> None:
        given = {"ttl_ms": 200} | fields
        assert run.refusal(given.pop("op", "lease.acquire"), **given) == refusal
        assert run.ask("status")["result"]["lease"] == {"held": False, "expires_in_s": None}

    def test_the_reply_to_status_has_the_fields_of_its_topic(self, run: Run) -> None:
        run.wrench(0.0)
        asked = run.ask("status")["result"]
        run.tick()
        published = run.published("status")[-1]
        assert set(published) == set(asked) | {"v", "seq", "boot", "t_ns", "timestamp", "frame", "config_id"}


class TestTare:
    def test_a_free_finger_is_tared_and_verified(self, run: Run) -> None:
        run.image(EMPTY)
        run.wrench(0.2, (0.1, 0.0))
        reply = run.ask("tare", finger="left", seconds=0.01)
        begun = {"finger": "left", "seconds": 0.01, "verified": True, "tare_id": 0, "tare_ids": {"wrench": 0}}
        assert reply["result"] == begun
        assert run.ask("tare.get", finger="left")["result"]["busy"] is True
        for _ in range(12):
            run.wrench(0.2, (0.1, 0.0))
        got = run.ask("tare.get", finger="left")["result"]
        assert (got["tare_id"], got["busy"], got["readings"]) == (1, False, 10)
        assert got["taken_t_ns"] == run.t_ns - 2 * MS
        assert got["offset"] == pytest.approx([0.1, 0.0, -0.2, 0.0, 0.0, 0.0], abs=1e-6)
        assert run.published("slip.left")[-1]["tare_id"] == 1

    def test_a_bias_that_looks_like_a_contact_can_be_tared_but_not_verified(self, make_run: Any, rig: str) -> None:
        run = make_run(rig, zeros=False)
        run.up()
        run.wrench(25.0, (3.0, 0.0))
        assert run.ask("tare", finger="left", seconds=0.01)["result"]["verified"] is False
        for _ in range(12):
            run.wrench(25.0, (3.0, 0.0))
        assert run.level() == ("no_contact", [])

    def test_a_tared_finger_in_contact_is_not_tared_again(self, run: Run) -> None:
        run.bring_up()
        run.wrench(5.0)
        assert run.refusal("tare", finger="left") == ("in_contact", "finger")
        run.wrench(0.0)
        allowed = run.ask("tare", finger="left")["result"]
        assert (allowed["seconds"], allowed["verified"]) == (0.5, True)

    def test_a_finger_whose_image_is_pressed_is_not_tared(self, run: Run) -> None:
        run.image(FULL)
        run.wrench(0.0)
        assert run.refusal("tare", finger="left") == ("in_contact", "finger")

    def test_a_pad_that_measures_the_force_is_tared_by_its_taxels(self, run: Run) -> None:
        run.exact = True
        run.skin(0.4, (0.2, 0.0))
        assert run.ask("tare", finger="right", seconds=0.1)["result"]["verified"] is True
        for _ in range(12):
            run.skin(0.4, (0.2, 0.0))
        got = run.ask("tare.get", finger="right")["result"]
        assert got["tare_id"] == 1
        assert got["offset"] == pytest.approx([1050.0, 1000.0, 1100.0] * 4)
        run.skin(5.0)
        assert run.refusal("tare", finger="right") == ("in_contact", "finger")

    def test_undo_restores_the_tare_before(self, run: Run) -> None:
        assert run.refusal("tare.undo", finger="left") == ("not_ready", "finger")
        run.bring_up()
        undone = run.ask("tare.undo", finger="left")["result"]
        assert undone == run.ask("tare.get", finger="left")["result"]
        assert (undone["tare_id"], undone["taken_t_ns"]) == (0, None)
        assert run.refusal("tare.undo", finger="left") == ("not_ready", "finger")

    def test_a_silent_finger_is_not_tared(self, run: Run) -> None:
        assert run.refusal("tare", finger="left") == ("not_ready", "finger")
        run.wrench(0.0)
        run.wait(100)
        run.tick()
        assert run.refusal("tare", finger="left") == ("not_ready", "finger")

    @pytest.mark.parametrize("seconds", [0, -1.0, 10.1, 1e300])
    def test_an_averaging_time_out_of_range_is_refused(self, run: Run, seconds: float) -> None:
        run.wrench(0.0)
        assert run.refusal("tare", finger="left", seconds=seconds) == ("out_of_range", "seconds")
        assert run.ask("tare.get", finger="left")["result"]["busy"] is False

    @pytest.mark.parametrize("op", ["tare", "tare.get", "tare.undo"])
    def test_an_unknown_finger_is_refused(self, run: Run, op: str) -> None:
        assert run.refusal(op, finger="middle") == ("unknown_finger", "finger")

    def test_readings_that_are_not_finite_stay_out_of_a_tare(self, run: Run) -> None:
        run.wrench(0.0)
        run.ask("tare", finger="left", seconds=0.02)
        for k in range(24):
            run.wrench(math.nan if k in (5, 11) else 0.3)
        got = run.ask("tare.get", finger="left")["result"]
        assert got["tare_id"] == 1
        assert got["offset"] == pytest.approx([0.0, 0.0, -0.3, 0.0, 0.0, 0.0], abs=1e-6)


class TestGravity:
    def test_gravity_is_set_for_a_finger_with_a_force_sensor(self, run: Run) -> None:
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
    def test_every_other_request_is_refused(self, run: Run, fields: dict[str, Any], refusal: tuple[str, str]) -> None:
        given = {"finger": "left", "gravity_mps2": [0.0, 0.0, -9.8]} | fields
        assert run.refusal("gravity.set", **given) == refusal


class TestAtMostOnce:
    def test_A2_a_repeated_request_gets_the_same_reply_and_is_carried_out_once(self, run: Run) -> None:
        first = run.ask("record.start", id="c-1", deadline_ns=run.t_ns + 400 * MS)
        deadline_ns = run.t_ns + 400 * MS
        run.wait(100)
        assert run.ask("record.start", id="c-1", deadline_ns=deadline_ns) == first
        assert run.refusal("record.stop", id="c-1") == ("repeated_id", "id")
        assert run.refusal("record.start", client=b"ben", id="c-1", deadline_ns=deadline_ns) == ("replayed", "")
        assert run.ask("status")["result"]["recording"]["running"] is True

    def test_A2_a_refused_request_stays_refused(self, run: Run) -> None:
        body = {"id": "c-1", "deadline_ns": run.t_ns + 400 * MS, "finger": "left"}
        refused = run.ask("tare", **body)
        assert refused["ok"] is False
        run.wrench(0.0)
        assert run.ask("tare", **body) == refused

    def test_A2_a_late_copy_is_refused(self, run: Run) -> None:
        body = {"id": "c-1", "deadline_ns": run.t_ns + 400 * MS}
        assert run.refusal("record.start", **body) is None
        run.wait(400)
        assert run.refusal("record.start", **body) == ("deadline_passed", "deadline_ns")

    def test_too_many_requests_are_refused_until_their_deadlines_have_passed(self, run: Run) -> None:
        found = {run.refusal("tare.get", finger="left") for _ in range(100)}
        assert found == {None, ("busy", "")}
        run.wait(101)
        assert run.refusal("tare.get", finger="left") is None

    def test_A1_a_request_captured_in_another_run_is_refused(self, run: Run) -> None:
        assert run.refusal("record.start", boot="before") == ("wrong_boot", "boot")
