"""Raw strain gauges: the documented frame, the matrix, and every status and sequence number."""

from __future__ import annotations

import numpy as np
import pytest
from readings import Case, documented, fields

from slipd.devices import gauges
from slipd.devices.shared import checksums

COUNTS = (100, -200, 300_000, -4, 5, 6)
MATRIX = np.diag([1e-3, 2e-3, 4e-3, 1e-6, 2e-6, 4e-6]) + 1e-7
OFFSET = [10.0, 20.0, 30.0, 40.0, 50.0, 60.0]
FORCE = [*(MATRIX @ (np.array(COUNTS) - OFFSET))]
RAIL = 1 << 31
SEQUENCE = (65_534, 65_536, 65_537, 65_537, 65_540, 65_539, 70_000, 0)


def frame(number: int, status: int = 0, time_us: int = 0, rail: tuple[int, ...] = (6, 0)) -> bytes:
    """Return a frame whose count at a place is ``rail``."""
    place, count = rail
    return gauges.encode_frame((*COUNTS[:place], count, *COUNTS[place + 1 :])[:6], number, time_us, status)


def of_version(number: int) -> bytes:
    body = bytes((number,)) + frame(1)[3:-2]
    return frame(1)[:2] + body + checksums.x25(body).to_bytes(2, "little")


CASES = {
    "without a matrix, counts are returned": Case(frame(0), [{"force_n": COUNTS[:3], "torque_nm": COUNTS[3:]}]),
    "the matrix converts counts minus offset": Case(
        frame(0),
        [{"force_n": FORCE[:3], "torque_nm": FORCE[3:]}],
        options={"matrix": MATRIX.tolist(), "offset": OFFSET},
    ),
    "every status bit has its word": Case(
        b"".join(frame(bit, 1 << bit) for bit in range(7)) + frame(7, 0x7F),
        fields("status", [("overload",)] * 6 + [("invalid",), ("overload", "invalid")]),
    ),
    "a frame with the reserved bit is rejected": Case(frame(1, 0x80), [], {"bad": 1, "bad_bytes": 36}),
    "a count at the end of its range is overload": Case(
        b"".join(frame(n, rail=(n % 6, (RAIL - 1, -RAIL)[n // 6])) for n in range(12)),
        fields("status", [("overload",)] * 12),
    ),
    "version 1 is read": Case(of_version(1), fields("status", [()])),
    "another version is refused": Case(of_version(2), [], {"bad": 1, "bad_bytes": 36}),
    "gap, duplicate, restart and wrap are distinguished": Case(
        b"".join(frame(number, time_us=number) for number in SEQUENCE),
        fields("device_time_ns", [1000 * number for number in (65_534, 65_536, 65_537, 65_540, 70_000, 0)]),
        {"lost": 1 + 2 + 4459, "duplicates": 2, "restarts": 1},
    ),
    "the device time is returned as sent and wraps": Case(
        b"".join(frame(step, time_us=(1 << 32) - 1 + step) for step in range(3)),
        fields("device_time_ns", [((1 << 32) - 1) * 1000, 0, 1000]),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_F2_N3_D2_D3_a_stream_gives_these_readings_and_counts(name: str) -> None:
    CASES[name].check(gauges.Decoder)


def test_the_documented_frame_is_encoded_and_read() -> None:
    frame = gauges.encode_frame((1000, -2000, 8_388_607, 0, -1, 70_000), 258, 1_001_875, 0b100)
    assert frame == documented("gauges")
    Case(frame, [{"device_time_ns": 1_001_875_000, "status": ("overload",)}]).check(gauges.Decoder)
