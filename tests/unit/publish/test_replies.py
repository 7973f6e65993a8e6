"""Replies: the envelope, and the reply to a request that cannot be checked."""

from __future__ import annotations

from typing import Any

import pytest

from slipd.publish.replies import error_body, granted, refused
from slipd.types.permit import Refusal
from slipd_client.messages import decode, encode

REFUSAL = Refusal("malformed", "a request is one msgpack map", "")
ERROR = {"code": "malformed", "message": "a request is one msgpack map", "field": ""}


@pytest.mark.parametrize(
    ("number", "known"),
    [("a-1", "a-1"), (7, 7), (None, None), (True, None), (1.5, None), ([1], None), ({"a": 1}, None), (b"x", None)],
)
def test_an_error_repeats_only_an_id_that_is_a_string_or_an_integer(number: Any, known: str | int | None) -> None:
    body = error_body(number, REFUSAL)
    assert body == {"v": 1, "id": known, "ok": False, "error": ERROR}
    assert decode(encode(body)) == body


def test_a_reply_has_either_a_result_or_an_error() -> None:
    head = {"v": 1, "id": "a-1", "t_ns": 5}
    assert granted("a-1", {"ttl_ms": 200}, 5) == head | {"ok": True, "result": {"ttl_ms": 200}}
    assert refused("a-1", REFUSAL, 5) == head | {"ok": False, "error": ERROR}
