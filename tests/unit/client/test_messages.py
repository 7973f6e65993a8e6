"""Maps and typed messages of the wire, and what of them is refused."""

from __future__ import annotations

import contextlib
import math
import struct
import tracemalloc
from typing import Any

import msgpack
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slipd_client.clock import DRIFT_PPM, ServerClock
from slipd_client.messages import (
    LEVELS,
    MESSAGE_LIMITS,
    REQUEST_LIMITS,
    SEVERITY,
    Limits,
    MessageError,
    decode,
    encode,
)
from slipd_client.messages.codec import read, typed_message
from slipd_client.messages.typed import (
    Message,
    Slip,
    SlipLevel,
)

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


@settings(max_examples=30)
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
        with pytest.raises(MessageError, match=r"^malformed"):
            decode(data[:end])


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
    with pytest.raises(MessageError, match=r"^malformed"):
        decode(data)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_number_that_is_none_is_refused_with_its_place(value: float) -> None:
    with pytest.raises(MessageError) as caught:
        decode(encode({"force_n": 1.0, "inner": {"list": [0.0, value]}}))
    assert (caught.value.code, caught.value.field) == ("not_finite", "inner.list.1")


@pytest.mark.parametrize("header", [b"\xdc", b"\xde"], ids=["lists", "maps"])
@pytest.mark.parametrize(("limits", "allowed"), [(REQUEST_LIMITS, 4e6), (MESSAGE_LIMITS, 64e6)])
def test_a_nest_of_large_headers_takes_little_memory(header: bytes, limits: Limits, allowed: float) -> None:
    one = header + struct.pack(">H", limits.items) + (b"" if header == b"\xdc" else b"\xa1a")
    data = (b"\x81\xa1a" + one * limits.data_bytes)[: limits.data_bytes]
    tracemalloc.start()
    with pytest.raises(MessageError):
        decode(data, limits)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < allowed


@pytest.mark.parametrize("leaf", [b"\x01", b"\x90", b"\x80", b"\xa0", b"\x81\xa0\x01"])
def test_a_bush_of_short_lists_is_not_read_to_its_end(leaf: bytes) -> None:
    """Of entries that are few in each list and many in all: some 7 ms of a daemon's loop otherwise."""
    bush = b"\x81\xa1a\xdc\x00\x28" + (b"\x95" + (b"\xdc\x00\x14" + leaf * 20) * 5) * 40
    assert len(bush) <= REQUEST_LIMITS.data_bytes
    with pytest.raises(MessageError, match="at most 256 entries"):
        decode(bush)


HEAD = {"v": 1, "seq": 4, "boot": "b", "t_ns": 7, "timestamp": 1.5, "frame": "left_pad", "config_id": "c"}


def message(topic: str, **fields: Any) -> Any:
    return typed_message(*read([topic.encode(), encode(HEAD | fields)]))


def test_a_verdict_has_its_fields_as_numbers_words_and_tuples() -> None:
    slip = message(
        "slip.left", finger="left", level="warning", reasons=["rotation"], mu=1, centroid_m=[0.001, 0], age_s=0.5
    )
    assert isinstance(slip, Slip)
    assert (slip.level, slip.reasons, slip.mu, slip.centroid_m) == (SlipLevel.WARNING, ("rotation",), 1.0, (0.001, 0.0))
    assert (slip.seq, slip.boot, slip.t_ns, slip.frame) == (4, "b", 7, "left_pad")
    assert (slip.reading_age_s, slip.spin_nm, type(slip.mu)) == (0.5, None, float)


def test_fields_and_topics_that_are_not_known_stand_in_the_map() -> None:
    assert message("wrench.left", finger="left", later=[1]).raw["later"] == [1]
    other = message("later.topic", more=1)
    assert (type(other), other.topic, other.raw["more"]) == (Message, "later.topic", 1)


@pytest.mark.parametrize(
    ("topic", "needed"),
    [
        ("slip.left", {"finger": "left", "level": "stable"}),
        ("wrench.left", {"finger": "left"}),
        ("tactile.left", {"finger": "left", "rows": 1, "cols": 1}),
        ("warning", {"finger": "left", "level": "stable", "previous": "unknown", "rising": False}),
        ("grasp", {"level": "unknown"}),
        ("motion", {"safety": 1.2, "wanted_acceleration_mps2": 3.0}),
        ("gripper", {}),
        ("status", {}),
    ],
)
def test_what_an_older_daemon_does_not_send_is_none_and_the_rest_must_be_there(
    topic: str, needed: dict[str, Any]
) -> None:
    assert message(topic, frame=None, timestamp=None, **needed).frame is None
    for name in needed:
        with pytest.raises(MessageError, match=f"^missing_field: {name}"):
            message(topic, **{other: value for other, value in needed.items() if other != name})


@pytest.mark.parametrize(
    ("topic", "fields", "complaint"),
    [
        *(
            ("slip.left", fields, f"^bad_type: .*{complaint}")
            for fields, complaint in (
                ({"level": "fine"}, "level must be one of no_contact, stable"),
                ({"level": 3}, "level"),
                ({"level": ["stable"]}, "level"),
                ({"finger": 1}, "finger must be a string"),
                ({"mu": "0.5"}, "mu must be a number"),
                ({"mu": True}, "mu must be a number"),
                ({"tare_id": 1.0}, "tare_id must be an integer"),
                ({"reasons": "stale"}, "reasons must be a list of strings"),
                ({"reasons": [1]}, "reasons.0 must be a string"),
                ({"centroid_m": [0.0]}, "centroid_m must be a list of two numbers"),
                ({"centroid_m": [0.0, None]}, "centroid_m.1 must be a number"),
                ({"timestamp": "now"}, "timestamp"),
            )
        ),
        ("status", {"fingers": []}, "fingers must be a map"),
        ("status", {"fingers": {"left": 1}}, "fingers.left must be a map"),
        ("status", {"lease": {"held": 1}}, "lease.held must be true or false"),
        ("status", {"fingers": {"left": {"level": "fine"}}}, "fingers.left.level must be one of"),
        ("status", {"streams": {"left.wrench": {"health": 9}}}, "streams.left.wrench.health must be one of 0, 1, 2, 3"),
        ("status", {"streams": {"left.wrench": {}}}, "missing_field: streams.left.wrench.health is missing"),
    ],
)
def test_a_known_field_of_another_kind_is_refused_with_its_name(
    topic: str, fields: dict[str, Any], complaint: str
) -> None:
    with pytest.raises(MessageError, match=complaint):
        message(topic, **({"finger": "left", "level": "stable"} | fields))


def test_ages_are_told_in_the_clock_of_this_machine_or_by_one_that_is_known() -> None:
    class Ahead:
        def local_ns(self, server_ns: int) -> int:
            return server_ns - 10**12

    told = message("gripper")
    assert told.age_s > 0
    assert told.age_by(Ahead()) - told.age_s == pytest.approx(1000.0, abs=10.0)


def test_levels_have_the_words_of_the_wire_and_an_order_in_which_unknown_is_not_no_slip() -> None:
    assert [str(level) for level in SlipLevel] == list(LEVELS)
    assert [level for level in SlipLevel if level.alarming] == ["warning", "slipping"]
    assert sorted(LEVELS, key=SEVERITY.__getitem__) == [
        *("no_contact", "stable", "unknown", "caution", "warning", "slipping")
    ]


SECOND = 10**9


def test_the_clock_of_a_daemon_is_unknown_before_the_first_reply_and_after_another_daemon() -> None:
    clock = ServerClock()
    for change, known in ((lambda: None, False), (lambda: clock.observe(0, 10, 5), True), (clock.forget, False)):
        change()
        answers = clock.error_ns(0), clock.local_ns(0), clock.earliest_ns(0)
        assert [answer is not None for answer in answers] == [known] * 3


def test_the_bounds_of_a_clock_are_rounded_away_from_what_is_known() -> None:
    clock = ServerClock()
    clock.observe(0, 3, 10)  # the other clock shows 6 to 11 more, with the drift of 3 ns
    assert (clock.error_ns(3), clock.local_ns(11), clock.earliest_ns(3)) == (3, 3, 9)
    assert (clock.error_ns(3 + SECOND), clock.earliest_ns(3 + SECOND)) == (200_003, SECOND + 9 - 200_000)


def test_a_clock_that_steps_is_believed_anew() -> None:
    clock = ServerClock()
    clock.observe(0, 1_000, 500)
    clock.observe(2_000, 4_000, 50 * SECOND)
    assert abs(clock.local_ns(50 * SECOND) - 3_000) <= clock.error_ns(4_000)


@settings(max_examples=40)
@given(
    offset_ns=st.integers(-(10**15), 10**15),
    ppm=st.integers(-DRIFT_PPM // 2, DRIFT_PPM // 2),
    ways=st.lists(st.tuples(*[st.integers(0, SECOND)] * 3), min_size=1, max_size=20),
)
def test_the_bounds_of_a_clock_hold_whatever_the_line_does(
    offset_ns: int, ppm: int, ways: list[tuple[int, int, int]]
) -> None:
    def shown_ns(now_ns: int) -> int:
        return now_ns + now_ns * ppm // 1_000_000 + offset_ns

    clock, now_ns = ServerClock(), 0
    for pause_ns, there_ns, back_ns in ways:
        sent_ns = now_ns + pause_ns
        now_ns = sent_ns + there_ns + back_ns
        clock.observe(sent_ns, now_ns, shown_ns(sent_ns + there_ns))
        later_ns = now_ns + pause_ns
        assert abs(clock.local_ns(shown_ns(later_ns)) - later_ns) <= clock.error_ns(later_ns) + 2
        assert clock.earliest_ns(later_ns) <= shown_ns(later_ns) + 2
