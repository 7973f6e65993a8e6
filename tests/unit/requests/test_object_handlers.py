"""Clients name the object; another name needs the lease, as friction is learned for each."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

Run = Any


def test_the_reply_and_status_have_the_name_who_gave_it_and_the_friction_in_use(run: Run) -> None:
    run.lease()
    result = run.ask("object.set", name="mug-2")["result"]
    assert result["object_name"] == "mug-2"
    known = {finger: (body["mu"], body["mu_source"]) for finger, body in result["fingers"].items()}
    assert known == {"left": (0.5, "config"), "right": (0.5, "config")}
    status = run.ask("status")["result"]
    assert (status["object_name"], status["object_by"], status["object_t_ns"]) == ("mug-2", "ann", run.t_ns)
    assert run.refusal("object.set", name=None) is None
    assert run.ask("status")["result"]["object_name"] is None


@pytest.mark.parametrize("name", ["mug", "Box_2.b-c", "7", "x" * 64])
def test_a_name_is_letters_digits_and_three_signs(run: Run, name: str) -> None:
    run.lease()
    assert run.ask("object.set", name=name)["result"]["object_name"] == name


@pytest.mark.parametrize(
    ("fields", "refusal"),
    [
        ({"name": ""}, ("out_of_range", "name")),
        ({"name": "x" * 65}, ("out_of_range", "name")),
        ({"name": "a mug"}, ("out_of_range", "name")),
        ({"name": "mug\n"}, ("out_of_range", "name")),
        ({"name": ".mug"}, ("out_of_range", "name")),
        ({"name": "Größe"}, ("out_of_range", "name")),
        ({"name": 3}, ("bad_type", "name")),
        ({}, ("missing_field", "name")),
        ({"name": "mug", "finger": "left"}, ("unknown_field", "finger")),
    ],
)
def test_every_other_request_is_refused(run: Run, fields: dict[str, Any], refusal: tuple[str, str]) -> None:
    run.lease()
    error = run.ask("object.set", **fields)["error"]
    assert (error["code"], error["field"]) == refusal
    if fields == {"name": "a mug"}:
        rule = "name must have 1 to 64 letters, digits, `.`, `_` and `-`, the first a letter or digit, got 'a mug'"
        assert error["message"] == rule
    assert run.ask("status")["result"]["object_name"] is None


def test_nil_is_allowed_only_where_the_schema_says_so(run: Run) -> None:
    run.lease()
    assert run.refusal("friction.set", finger=None, mu_s=0.4) == ("bad_type", "finger")


def test_only_the_lease_holder_may_give_another_name(run: Run) -> None:
    assert run.refusal("object.set", name="mug") == ("no_lease", "")
    run.lease()
    assert run.refusal("object.set", client=b"ben", name="mug") == ("no_lease", "")
    assert run.refusal("object.set", name="mug") is None
    assert run.refusal("object.set", client=b"ben", name="box") == ("no_lease", "")
    assert run.refusal("object.set", client=b"ben", name=None) == ("no_lease", ""), "it would forget what was learned"
    assert run.refusal("object.set", client=b"ben", name="mug") is None, "the same is no change"


def test_a_refusal_says_whether_the_lease_can_be_had(run: Run) -> None:
    asked = [("object.set", {"name": "mug"}), ("friction.set", {"finger": "left", "mu_s": 0.6})]
    for op, fields in asked:
        assert run.ask(op, **fields)["error"]["message"].endswith(": acquire the lease first (lease.acquire)")
    run.lease()
    for op, fields in asked:
        assert run.ask(op, client=b"ben", **fields)["error"]["message"].endswith(": another client holds the lease")


def test_a_config_may_allow_every_client_to_name_the_object(make_run: Callable[[str], Run], left: str) -> None:
    run = make_run(left + "\n[requests]\nfriction_without_lease = true\n")
    run.up()
    assert run.refusal("object.set", client=b"ben", name="mug") is None
