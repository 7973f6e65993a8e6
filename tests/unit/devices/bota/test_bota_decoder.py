"""Bota frames: every status bit, values that are not finite, text between frames, and frames that may be noise."""

from __future__ import annotations

import math
from typing import Any

import pytest
from readings import Case, fields

from slipd.devices import bota
from slipd.tools.sim import emulated_wrenches as sim

LAST_US = (1 << 32) - 1
NAMES = ("skipped", "overload", "invalid", "raw")


def frame(time_us: int = 0, status: int = 0, wrong: tuple[int, float] = (6, 0.0)) -> bytes:
    """Return a frame with the value ``wrong`` at a place."""
    values = [1.0, -2.0, 3.0, 0.1, -0.2, 0.3, 0.0]
    values[wrong[0]] = wrong[1]
    return bota.encode_frame(values[:3], values[3:6], time_us, status=status)


def case(stream: bytes, wanted: list[dict[str, Any]], **counts: int) -> Case:
    return Case(stream, wanted, counts | {"temperature_c": 25.0})


CASES = {
    "every status bit has its name": case(
        b"".join(frame(status=status) for status in range(16)),
        fields("status", [tuple(NAMES[bit] for bit in range(4) if status >> bit & 1) for status in range(16)]),
    ),
    "a value that is not finite makes the reading invalid": case(
        b"".join(frame(wrong=(place, value)) for place in range(6) for value in (math.nan, math.inf, -math.inf)),
        fields("status", [("invalid",)] * 18),
    ),
    "the device time is returned as sent and wraps": case(
        frame(LAST_US) + frame(LAST_US + 1) + frame(LAST_US + 2), fields("device_time_ns", [LAST_US * 1000, 0, 1000])
    ),
    "text between frames is no damage": case(
        sim.encode_banner() + sim.encode_ack("C").join(frame(n) for n in range(3)), fields("status", [()] * 3)
    ),
    "rubout is no text, and out of sync a frame with known status bits is accepted": case(
        b"\x7f" + frame(status=15), fields("status", [NAMES]), bad=1, bad_bytes=1
    ),
    "half a frame costs only itself": case(
        frame(1)[:25] + frame(2) + frame(3), fields("device_time_ns", [2000, 3000]), bad=1, bad_bytes=25
    ),
    "out of sync a frame with reserved bits is accepted only by its successor": case(
        bytes(5) + b"".join(frame(n, 0x1000) for n in range(3)),
        fields("device_time_ns", [1000, 2000]),
        bad=2,
        bad_bytes=5,
    ),
    "at the start of a stream it is accepted": case(frame(0, 0x1000), fields("status", [()])),
}


@pytest.mark.parametrize("name", CASES)
def test_N3_a_stream_gives_these_readings_and_counts(name: str) -> None:
    CASES[name].check(bota.Decoder)
