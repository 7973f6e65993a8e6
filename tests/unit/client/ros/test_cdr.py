"""Our CDR bytes are those of another serializer, for every type and any value."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ros_peers import built, typestore

from slipd_client.ros.cdr import CdrEncoder, CdrError
from slipd_client.ros.conversion import TYPES
from slipd_client.ros.ros_types import RosField, RosType, type_from_text

STORE = typestore()
BITS = {"byte": (0, 127), "uint8": (0, 255), "int8": (-128, 127)}  # to rosbags, a byte has a sign
BITS |= {f"int{n}": (-(2 ** (n - 1)), 2 ** (n - 1) - 1) for n in (32, 64)}
BITS |= {f"uint{n}": (0, 2**n - 1) for n in (32, 64)}
TEXTS = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=9)


def values(field: RosField) -> st.SearchStrategy[Any]:
    single = singles(field.type)
    if field.length is None:
        return single
    length = {"max_size": 5} if field.length < 0 else {"min_size": field.length, "max_size": field.length}
    return st.lists(single, **length)


def singles(kind: str) -> st.SearchStrategy[Any]:
    if kind in TYPES:
        return messages(TYPES[kind])
    if kind == "string":
        return TEXTS
    if kind == "bool":
        return st.booleans()
    return st.integers(*BITS[kind]) if kind in BITS else st.floats(width=32 if kind == "float32" else 64)


def messages(kind: RosType) -> st.SearchStrategy[dict[str, Any]]:
    return st.fixed_dictionaries({field.name: values(field) for field in kind.fields})


@pytest.mark.parametrize("name", sorted(TYPES))
def test_the_bytes_of_any_message_are_those_of_rosbags(name: str) -> None:
    encoder = CdrEncoder(name, TYPES)

    @settings(max_examples=25)
    @given(messages(TYPES[name]))
    def check(value: dict[str, Any]) -> None:
        expected = bytes(STORE.serialize_cdr(built(STORE, name, value), TYPES[name].full_name))
        assert encoder.encode(value) == expected

    check()


POINT = type_from_text("t/Point", "string name\nuint8 kind\nfloat64[2] xy\nint64[] counts\nt/Tag[] tags")
TAG = type_from_text("t/Tag", "uint8 OK=0\nbool set")
GOOD: dict[str, Any] = {"name": "a", "kind": 7, "xy": [1.0, math.nan], "counts": [], "tags": [{"set": True}]}
ENCODER = CdrEncoder("t/Point", {"t/Point": POINT, "t/Tag": TAG})


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"kind": 256}, "kind: must be uint8: "),
        ({"kind": 1.0}, "kind: must be uint8: "),
        ({"kind": None}, "kind: must be uint8: "),
        ({"name": None}, "name: must be string: "),
        ({"name": "\ud800"}, "name: must be string: "),
        ({"xy": [1.0]}, "xy: must be float64[2]: got 1 entries"),
        ({"counts": None}, "counts: must be int64[]: "),
        ({"counts": [2**63]}, "counts: must be int64[]: "),
        ({"tags": [{}]}, "tags.set: is missing"),
        ({"tags": [{"set": True, "by": "me"}]}, "tags.by: not declared"),
        ({"colour": "red"}, "colour: not declared"),
    ],
)
def test_a_value_that_does_not_fit_is_refused_with_the_path_of_its_field(change: dict[str, Any], error: str) -> None:
    with pytest.raises(CdrError) as refused:
        ENCODER.encode(GOOD | change)
    assert str(refused.value).startswith(f"t/Point: {error}")


def test_a_type_without_fields_or_with_a_type_that_nobody_declares_is_refused() -> None:
    with pytest.raises(ValueError, match="t/Empty must have a field"):
        CdrEncoder("t/Empty", {"t/Empty": RosType("t/Empty", ())})
    with pytest.raises(KeyError):
        CdrEncoder("t/Point", {"t/Point": POINT})


def test_a_line_that_declares_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match=r"t/Odd: a line must be 'type name' or 'type NAME=value', got 'float64'"):
        type_from_text("t/Odd", "int32 x\nfloat64")
