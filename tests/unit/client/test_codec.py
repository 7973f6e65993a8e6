from __future__ import annotations

import contextlib
import math
import struct
import tracemalloc
from typing import Any

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slipd_client.messages import MESSAGE_LIMITS, REQUEST_LIMITS, Limits, MessageError, decode, encode

plain = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**64 - 1)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(max_size=20)
    | st.binary(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=12,
)


def depth(value: Any) -> int:
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return isinstance(value, (dict, list)) + max(map(depth, inner), default=0)


def refusal(data: bytes, limits: Limits = REQUEST_LIMITS) -> MessageError:
    with pytest.raises(MessageError) as caught:
        decode(data, limits)
    return caught.value


@given(st.dictionaries(st.text(max_size=8), plain, max_size=8).filter(lambda body: depth(body) <= 6))
def test_a_map_of_plain_values_comes_back_as_it_was(body: dict[str, Any]) -> None:
    assert decode(encode(body)) == body


@given(st.binary(max_size=200))
def test_arbitrary_bytes_are_a_map_or_refused(data: bytes) -> None:
    with contextlib.suppress(MessageError):
        assert isinstance(decode(data), dict)


def test_a_message_cut_short_anywhere_is_refused() -> None:
    data = encode({"finger": "left", "force_n": [1.0, -2.5, None], "status": {"ok": True, "code": 70_000}})
    for end in range(len(data)):
        assert refusal(data[:end]).code == "malformed"


@pytest.mark.parametrize(
    "data",
    [
        pytest.param(b"\x82\xa1a\x01\xa1a\x02", id="a key twice"),
        pytest.param(b"\x81\xa1m\x82\xa1a\x01\xa1a\x02", id="a key twice in an inner map"),
        pytest.param(b"\x80\xc0", id="trailing bytes"),
        pytest.param(b"\x80\x80", id="two maps"),
        pytest.param(b"", id="nothing"),
        pytest.param(b"\xc1", id="a byte that msgpack never uses"),
        pytest.param(b"\x93\x01\x02\x03", id="a list"),
        pytest.param(b"\xa4text", id="a text"),
        pytest.param(b"\x81\x01\x01", id="a number as key"),
        pytest.param(b"\x81\xc4\x01a\x01", id="bytes as key"),
        pytest.param(b"\x81\x80\x01", id="a map as key"),
        pytest.param(b"\x81\xa2\xff\xfe\x01", id="a key that is no UTF-8"),
        pytest.param(b"\x81\xa1a\xdd\xff\xff\xff\xff", id="a list of four billion"),
        pytest.param(b"\x81\xa1a\xdf\xff\xff\xff\xff", id="a map of four billion"),
        pytest.param(b"\x81\xa1a\xdb\xff\xff\xff\xff", id="a text of four billion"),
        pytest.param(b"\x81\xa1a\xc6\xff\xff\xff\xff", id="bytes of four billion"),
        pytest.param(b"\x81\xa1a\xc9\xff\xff\xff\xff\x05", id="an extension of four billion"),
        pytest.param(b"\x81\xa1a\xc7\x00\x05", id="an empty extension"),
        pytest.param(msgpack.packb({"a": msgpack.ExtType(5, b"x")}), id="an extension"),
        pytest.param(msgpack.packb({"a": msgpack.Timestamp(1, 2)}), id="a timestamp"),
        pytest.param(msgpack.packb({"a": "x" * 1025}), id="a long text"),
        pytest.param(msgpack.packb({"a": b"x" * 1025}), id="long bytes"),
        pytest.param(msgpack.packb({"a": [0] * 65}), id="a long list"),
        pytest.param(msgpack.packb({str(i): 0 for i in range(65)}), id="a wide map"),
        pytest.param(msgpack.packb({"a": [[[[[[0]]]]]]}), id="a deep nest"),
        pytest.param(msgpack.packb({str(i): "x" * 1000 for i in range(17)}), id="more than 16 KiB"),
    ],
)
def test_what_could_mislead_or_stall_the_reader_is_malformed(data: bytes) -> None:
    assert refusal(data).code == "malformed"


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_number_that_is_none_is_refused_with_its_place(value: float) -> None:
    error = refusal(encode({"force_n": 1.0, "inner": {"list": [0.0, value]}}))
    assert (error.code, error.field) == ("not_finite", "inner.list.1")


@pytest.mark.parametrize("header", [b"\xdc", b"\xde"], ids=["lists", "maps"])
@pytest.mark.parametrize(("limits", "allowed"), [(REQUEST_LIMITS, 4e6), (MESSAGE_LIMITS, 64e6)])
def test_a_nest_of_large_headers_takes_little_memory(header: bytes, limits: Limits, allowed: float) -> None:
    one = header + struct.pack(">H", limits.items) + (b"" if header == b"\xdc" else b"\xa1a")
    data = (b"\x81\xa1a" + one * limits.data_bytes)[: limits.data_bytes]
    tracemalloc.start()
    try:
        refusal(data, limits)
        assert tracemalloc.get_traced_memory()[1] < allowed
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("leaf", [b"\x01", b"\x90", b"\x80", b"\xa0", b"\x81\xa0\x01"])
def test_a_bush_of_short_lists_is_not_read_to_its_end(leaf: bytes) -> None:
    """Of entries that are few in each list and many in all: some 7 ms of a daemon's loop otherwise."""
    twig = b"\xdc\x00\x14" + leaf * 20
    bush = b"\x81\xa1a\xdc\x00\x28" + (b"\x95" + twig * 5) * 40
    assert len(bush) <= REQUEST_LIMITS.data_bytes
    with pytest.raises(MessageError, match="at most 256 entries"):
        decode(bush)
