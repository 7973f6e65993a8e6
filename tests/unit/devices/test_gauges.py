"""Raw strain gauges: the documented frame, the matrix, and impossible matrices."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from project import DOCS

from slipd.devices import gauges
from slipd.devices.shared import checksums
from slipd.devices.shared.device_interface import DecoderHealth

DOCUMENT = DOCS / "devices.md"
COUNTS = (100, -200, 300_000, -4, 5, 6)
MATRIX = np.diag([1e-3, 2e-3, 4e-3, 1e-6, 2e-6, 4e-6]) + 1e-7


def frame(number: int, status: int = 0) -> bytes:
    return gauges.encode_frame((number, *COUNTS[1:]), number, 1000 * number, status)


def numbers(samples: list[Any]) -> list[int]:
    return [int(sample.force_n[0]) for sample in samples]


def test_the_documented_frame_is_encoded() -> None:
    (block,) = re.findall(r"<!-- gauges frame -->\n+```\n(.*?)```", DOCUMENT.read_text(encoding="utf-8"), re.DOTALL)
    documented = bytes.fromhex("".join(line.split("|")[0] for line in block.splitlines()))
    assert gauges.encode_frame((1000, -2000, 8_388_607, 0, -1, 70_000), 258, 1_001_875, 0b100) == documented
    (sample,) = gauges.Decoder().receive(documented, 77)
    assert (sample.t_ns, sample.device_time_ns, sample.status) == (77, 1_001_875_000, ("overload",))


def test_by_default_the_counts_are_returned() -> None:
    (sample,) = gauges.Decoder().receive(gauges.encode_frame(COUNTS, 0, 0), 0)
    assert [*sample.force_n, *sample.torque_nm] == list(COUNTS)


def test_the_matrix_converts_counts_minus_offset_to_a_wrench() -> None:
    offset = [10.0, 20.0, 30.0, 40.0, 50.0, 60.0]
    (sample,) = gauges.Decoder(MATRIX.tolist(), offset).receive(gauges.encode_frame(COUNTS, 0, 0), 0)
    expected = MATRIX @ (np.array(COUNTS) - offset)
    assert [*sample.force_n, *sample.torque_nm] == pytest.approx(expected.tolist())


@pytest.mark.parametrize("bit", range(7))
def test_F2_every_status_bit_has_its_word(bit: int) -> None:
    (sample,) = gauges.Decoder().receive(frame(1, 1 << bit), 0)
    assert sample.status == (("overload",) if bit < 6 else ("invalid",))


def test_F2_both_words_may_occur_together_and_a_frame_with_the_reserved_bit_is_rejected() -> None:
    assert gauges.Decoder().receive(frame(1, 0x7F), 0)[0].status == ("overload", "invalid")
    assert gauges.Decoder().receive(frame(1, 0x80), 0) == []


@pytest.mark.parametrize("rail", [-(1 << 31), (1 << 31) - 1])
@pytest.mark.parametrize("channel", range(6))
def test_N3_a_count_at_the_end_of_its_range_is_overload(rail: int, channel: int) -> None:
    counts = list(COUNTS)
    counts[channel] = rail
    (sample,) = gauges.Decoder().receive(gauges.encode_frame(counts, 0, 0), 0)
    assert sample.status == ("overload",)


@given(st.lists(st.integers(-(1 << 31), (1 << 31) - 1), min_size=6, max_size=6), st.floats(-1e6, 1e6))
def test_N3_no_count_gives_a_value_that_is_not_finite(counts: list[int], entry: float) -> None:
    matrix = 1e6 * np.eye(6)
    matrix[0, 1:] = entry
    (sample,) = gauges.Decoder(matrix.tolist(), [-4e9] * 6).receive(gauges.encode_frame(counts, 0, 0), 0)
    assert np.isfinite(sample.force_n).all()
    assert np.isfinite(sample.torque_nm).all()


def test_D2_another_format_version_is_refused() -> None:
    other = bytearray(frame(1))
    other[2] = 2
    other[-2:] = checksums.x25(bytes(other[2:-2])).to_bytes(2, "little")
    decoder = gauges.Decoder()
    assert decoder.receive(bytes(other), 0) == []
    assert decoder.health == DecoderHealth(bad=1, bad_bytes=36)


def test_D3_gap_duplicate_restart_and_wrap_are_distinguished() -> None:
    decoder = gauges.Decoder()
    stream = (65_534, 65_536, 65_537, 65_537, 65_540, 65_539, 70_000, 0)
    samples = decoder.receive(b"".join(map(frame, stream)), 0)
    assert numbers(samples) == [65_534, 65_536, 65_537, 65_540, 70_000, 0]
    assert decoder.health == DecoderHealth(good=6, lost=1 + 2 + 4459, duplicates=2, restarts=1)


def test_the_device_time_is_returned_as_sent_and_wraps() -> None:
    stream = b"".join(gauges.encode_frame(COUNTS, step, (1 << 32) - 1 + step) for step in range(3))
    times = [sample.device_time_ns for sample in gauges.Decoder().receive(stream, 0)]
    assert times == [((1 << 32) - 1) * 1000, 0, 1000]
