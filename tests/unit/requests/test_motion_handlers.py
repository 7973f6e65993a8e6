"""Requests to check a motion: what is wrong with one is named by its row, and nothing is known without an arm."""

from __future__ import annotations

from typing import Any

import pytest
from engine_rig import RIG, Run
from grasp_table import grasp_table
from run_courses import ask, count, follow, newest, tick

from slipd_client.messages import CHECK_LIMITS, MessageError, decode, encode, request_limits

ROW = [0.0, 0.0, 0.0, -9.8, *[0.0] * 6]


def rows(count: int, *others: tuple[int, Any]) -> list[Any]:
    """Rows of a motion that stands still; others take the place of some."""
    found: list[Any] = [[0.01 * k, *ROW[1:]] for k in range(count)]
    for at, row in others:
        found[at] = row
    return found


CASES: list[tuple[dict[str, Any], str, str]] = [
    ({}, "missing_field", "points"),
    ({"points": rows(2), "acceleration_mps2": [0.0, 0.0, 1.0]}, "missing_field", "points"),
    ({"points": []}, "out_of_range", "points"),
    ({"points": rows(2001)}, "out_of_range", "points"),
    ({"points": 1}, "bad_type", "points"),
    ({"points": rows(5, (3, ROW[:9]))}, "bad_type", "points.3"),
    ({"points": rows(5, (3, [True, *ROW[1:]]))}, "bad_type", "points.3"),
    ({"points": rows(5, (2, "row"))}, "bad_type", "points.2"),
    ({"points": rows(5, (4, [float("nan"), *ROW[1:]]))}, "not_finite", "points.4"),
    ({"points": rows(5, (3, [0.02, *ROW[1:]]))}, "out_of_range", "points.3"),
    ({"points": rows(5, (1, [0.01, 0.0, 0.0, 50.0, *ROW[4:]]))}, "out_of_range", "points.1"),
    ({"acceleration_mps2": [0.0, 0.0, 50.0]}, "out_of_range", "acceleration_mps2"),
    ({"acceleration_mps2": [0.0, 1.0]}, "bad_type", "acceleration_mps2"),
]


def test_a_wrong_motion_is_refused_and_its_first_wrong_row_is_named() -> None:
    run, bare = Run(RIG + grasp_table()), Run(RIG)
    for fields, code, field in CASES:
        error = run.ask("motion.check", **fields)["error"]
        assert (error["code"], error["field"]) == (code, field), (fields, error)
        assert field != "points.3" or "row 3" in error["message"]
    known = run.ask("motion.check", points=rows(2000))["result"]["unknown"]
    assert known.startswith("the motion of the arm is not known")
    follow(run, [count("motion", 0), tick, newest("motion", unknown=known)])
    without_grasp = ask("motion.check", ("not_ready", ""), acceleration_mps2=[0.0, 0.0, 1.0])
    follow(bare, [without_grasp, tick, count("motion", 0)])


def test_only_a_request_of_this_op_may_be_large() -> None:
    body = {"v": 1, "id": 1, "op": "motion.check", "points": rows(2000)}
    data = encode(body)
    assert decode(data, request_limits(data)) == body
    assert len(data) < CHECK_LIMITS.data_bytes
    other = encode(body | {"op": "status"})
    with pytest.raises(MessageError, match="at most 16384 bytes"):
        decode(other, request_limits(other))
