"""Messages of the XELA server: among garbage, with wrong values, times or numbers, and without its pads."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest
from readings import Case, fields

from slipd.devices import xela
from slipd.tools.sim.emulated_pads import encode_message

HUGE = 10**400
CALIBRATED = {"calibrated": True}
FORCES = np.linspace(-2, 2, 48).reshape(16, 3)


def pad(number: int, taxels: int = 16) -> np.ndarray:
    return np.random.default_rng(number).integers(0, 1 << 16, size=(taxels, 3))


def message(number: int, time_s: float = 1_700_000_000.25, **sensors: Any) -> bytes:
    return encode_message(number, {"1": pad(number)} | sensors, time_s)


def changed(**others: Any) -> bytes:
    """Return a good message with two sensors, with changed fields of the first; None removes a field."""
    body = json.loads(encode_message(1, {"1": pad(1), "2": pad(2)}, 1.0, {"1": pad(1), "2": pad(2)}))
    body["1"] = {key: value for key, value in (body["1"] | others).items() if value is not None}
    return json.dumps(body).encode()


def sources(*names: str) -> list[dict[str, Any]]:
    return fields("source", names)


NOTED_1_7_7 = b"""{"message": 983, "time": 1768296808.5623617, "sensors": 1, "type": "welcome",
"version": "1.7.7_161703", "1": {"time": 1768296808.5565615, "sensor": "1", "data": [33175, 33434, 37350],
"model": "uSPa11", "taxels": 1, "calibrated": [0.0031005585792, -0.0022188552824, 0.017302689426],
"extradots": [["1.0", "1.42", "21.62"]],
"special": [[33175, 33434, 37350, 0.0, 0, 0, 0, 0.0, 0, 0, 0, 0.0]], "temp": [0.0], "ups": [105.2]},
"complete": 1768296808.562364}"""
"""The message in the notes of a user of version 1.7.7 (see the docstring of the decoder), cut to one taxel."""

HALF = np.where(np.arange(16)[:, None] < 8, 0, pad(1))
TWO_DOTS = b'{"message":1,"time":1.2.3}'
WRONG_RAW: list[dict[str, Any]] = [
    {"taxels": 15},
    {"taxels": 17},
    {"taxels": None},
    {"taxels": "16"},
    {"taxels": 0, "data": ""},
    {"taxels": 16.0},
    {"data": None},
    {"data": ",".join(["12345"] * 48)},
    {"data": ",".join(["-1"] * 48)},
    {"data": ",".join(["0x1"] * 48)},
    {"data": ",".join([" 1"] * 48)},
    {"data": ",".join(["1"] * 48) + ","},
    {"data": [1.0] * 48},
    {"data": [True] * 48},
    {"data": [-1] * 48},
    {"data": [1 << 16] * 48},
    {"data": [1] * 47},
]
WRONG_FORCES = [[1.0] * 47, [1.0] * 49, 5, *([each] * 48 for each in ("1", True, None, math.nan, math.inf, 1e12, HUGE))]
CASES = {
    "what is encoded is decoded for every sensor": Case(
        encode_message(3, {"1": pad(1), "12": pad(2, 24)}, 1_700_000_000.25, {"12": FORCES, "1": -FORCES}),
        [
            {"source": "1", "values": pad(1), "device_time_ns": 1_700_000_000_250_000_000},
            {"source": "12", "values": pad(2, 24)},
        ],
    ),
    "a whole hand is read": Case(
        encode_message(7, {str(n): pad(n, 23) for n in range(1, 17)}, 1_700_000_000.25),
        fields("values", [pad(n, 23) for n in range(1, 17)]),
    ),
    "calibrated values are used if configured, and the server calibrates only the first": Case(
        encode_message(3, {"1": pad(1), "2": pad(2)}, 1.0, {"1": FORCES}),
        fields("values", [FORCES]),
        {"bad": 1},
        CALIBRATED,
    ),
    "integers reach from nil to the largest of sixteen bits": Case(
        changed(data=[0, 1, 65_535] * 16), fields("values", [[[0, 1, 65_535]] * 16, pad(2)])
    ),
    "a message that a user noted from version 1.7.7 is read": Case(
        NOTED_1_7_7, [{"values": [[33175, 33434, 37350]], "device_time_ns": 1_768_296_808_556_561_470}]
    ),
    "and its forces": Case(
        NOTED_1_7_7, fields("values", [[[0.0031005585792, -0.0022188552824, 0.017302689426]]]), options=CALIBRATED
    ),
    "numbers may lack the leading zero": Case(
        b'{"message":1,"1":{"taxels":1,"calibrated":[.5,-.25, .5]}}',
        fields("values", [[[0.5, -0.25, 0.5]]]),
        {},
        CALIBRATED,
    ),
    "a pad with fewer taxels than the model of the server is named": Case(
        message(1, **{"2": HALF}), sources("1"), {"bad": 1, "note": xela.NO_TAXELS.format("2", 8, 16)}
    ),
    "and until it has them": Case(
        message(1, **{"2": HALF}) + message(2, **{"2": pad(1)}), sources("1", "1", "2"), {"bad": 1}
    ),
    "a pad without a taxel below half of them is read": Case(
        message(1, **{"2": np.where(np.arange(16)[:, None] < 7, 0, pad(1))}), sources("1", "2")
    ),
    "a server that goes on without its pad is named": Case(
        message(1, 0.25) + message(2, 0.25, **{"1": pad(1)}), sources("1", "1"), {"warning": xela.REPEATED.format("1")}
    ),
    "and until it goes on with it": Case(
        message(1, 0.25) + message(2, 0.25, **{"1": pad(1)}) + message(3, 0.26, **{"1": pad(1)}), sources("1", "1", "1")
    ),
    "the welcome is skipped": Case(b'{"message":"Welcome"}' + message(1), sources("1")),
    **{
        f"a sensor with a wrong number of values is bad and its neighbour is not: {number}": Case(
            changed(**wrong), sources("2"), {"bad": 1}
        )
        for number, wrong in enumerate(WRONG_RAW)
    },
    **{
        f"calibrated values that are no forces are bad: {number}": Case(
            changed(calibrated=wrong), sources("2"), {"bad": 1}, CALIBRATED
        )
        for number, wrong in enumerate(WRONG_FORCES)
    },
    **{
        f"an impossible time is unknown: {str(time)[:20]}": Case(
            changed(time=time), fields("device_time_ns", [None, 1_000_000_000])
        )
        for time in (None, "1", -1, 1e300, math.nan, HUGE)
    },
    "a gap is counted, and the first number is 0": Case(message(0) + message(4), sources("1", "1"), {"lost": 3}),
    "a duplicate is dropped": Case(message(9) + message(9) + message(10), sources("1", "1"), {"duplicates": 1}),
    "a number that falls is a restart": Case(
        message(9) + message(1) + message(2) + message(4), sources(*"1111"), {"lost": 1, "restarts": 1}
    ),
    "a jump beyond the longest gap is a restart": Case(
        b'{"message":5}{"message":9000000000000000000}', [], {"restarts": 1}
    ),
    **{
        f"a number beyond 64 bits is bad: {number[:20]}": Case(
            b'{"message":5}{"message":%s}' % number.encode(), [], counts
        )
        for number, counts in (
            ("1" * 4000, {"bad": 1}),
            ("-1", {"bad": 1}),
            (str(1 << 63), {"bad": 1}),
            (str((1 << 63) - 1), {"restarts": 1}),
        )
    },
    **{
        f"an object without a number is bad: {body.decode()}": Case(body + message(1), sources("1"), counts)
        for body, counts in (
            (b"{}", {"bad": 1, "bad_bytes": 2}),
            (b'{"1":{}}', {"bad": 1, "bad_bytes": 8}),
            (b'{"message":1.5}', {"bad": 1}),
            (b'{"message":true}', {"bad": 1}),
            (b'{"message":null}', {"bad": 1}),
        )
    },
    "each stretch of garbage counts once": Case(
        b"xy" + message(1) + b"z" + message(2) + b" \r\n" + message(3),
        sources("1", "1", "1"),
        {"bad": 2, "bad_bytes": 3},
    ),
    **{
        f"a brace at the {place} of a message is garbage": Case(stream, sources("1", "1"), {"bad": 1, "bad_bytes": 1})
        for place, stream in (("begin", message(1) + b"{" + message(2)), ("end", message(1) + b"}" + message(2)))
    },
    "a number with two dots is garbage and delays nothing": Case(
        TWO_DOTS + message(2), sources("1"), {"bad": 1, "bad_bytes": len(TWO_DOTS)}
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_D3_a_stream_gives_these_images_and_counts(name: str) -> None:
    CASES[name].check(xela.Decoder)


def test_on_a_new_line_a_repeated_message_is_the_first() -> None:
    decoder = xela.Decoder()
    for _ in range(2):
        assert len(decoder.receive(message(1), 0)) == 1
        assert (decoder.health.warning, decoder.health.duplicates) == ("", 0)
        decoder.forget()
