"""Bota frames: worked frames, incomplete and damaged streams, and damage that a 16-bit checksum alone misses."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from slipd.devices import bota
from slipd.devices.shared import checksums
from slipd.tools.sim import emulated_bota as sim

WORKED = bytes.fromhex(
    "AA 00 00 00 00 C0 3F 00 00 10 C0 00 00 20 41 00 00 00 3E 00 00 00 BF 00 00 00 3D 40 E2 01 00 00 00 FC 41 10 C6"
)
OVERLOAD = bytes.fromhex(
    "AA 02 00 00 00 16 44 00 00 10 C0 00 00 20 41 00 00 00 3E 00 00 00 BF 00 00 00 3D 22 E7 01 00 00 00 FC 41 95 65"
)
"""Both computed from the maker's field table; none was taken from a sensor."""


def frames(count: int, seed: int = 0) -> list[bytes]:
    rng = np.random.default_rng(seed)
    return [bota.encode_frame(rng.normal(size=3), rng.normal(size=3), 1000 * number) for number in range(count)]


def payload_frame(payload: bytes) -> bytes:
    """Return a valid frame with the given 34 bytes between header and checksum."""
    return b"\xaa" + payload + checksums.x25(payload).to_bytes(2, "little")


def times_us(samples: list[bota.WrenchSample]) -> list[int]:
    return [sample.device_time_ns // 1000 for sample in samples if sample.device_time_ns is not None]


def test_worked_frame_is_written() -> None:
    force, torque = (1.5, -2.25, 10.0), (0.125, -0.5, 0.03125)
    assert bota.encode_frame(force, torque, 123_456, temperature_c=31.5) == WORKED
    assert bota.encode_frame((600, *force[1:]), torque, 124_706, temperature_c=31.5, status=2) == OVERLOAD


@pytest.mark.parametrize("status", [0, 1, 2, 4, 8, 15])
def test_out_of_sync_a_frame_with_known_status_bits_is_accepted_and_rubout_is_no_text(status: int) -> None:
    decoder = bota.Decoder()
    (sample,) = decoder.receive(b"\x7f" + bota.encode_frame((1, 2, 3), (4, 5, 6), 7, status=status), 0)
    assert (len(sample.status), decoder.health.bad_bytes) == (status.bit_count(), 1)


@pytest.mark.parametrize("status", range(16))
def test_every_status_bit_has_its_name(status: int) -> None:
    (sample,) = bota.Decoder().receive(bota.encode_frame((0, 0, 0), (0, 0, 0), 0, status=status), 0)
    names = ("skipped", "overload", "invalid", "raw")
    assert sample.status == tuple(name for bit, name in enumerate(names) if status & 1 << bit)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf")])
@pytest.mark.parametrize("place", range(6))
def test_a_value_that_is_not_finite_makes_the_reading_invalid(value: float, place: int) -> None:
    values = [1.0] * 6
    values[place] = value
    (sample,) = bota.Decoder().receive(bota.encode_frame(values[:3], values[3:], 0), 0)
    assert sample.status == ("invalid",)


def test_device_time_is_returned_as_sent_and_wraps() -> None:
    stream = b"".join(bota.encode_frame((0, 0, 0), (0, 0, 0), (1 << 32) + step) for step in (-1, 0, 1))
    assert times_us(bota.Decoder().receive(stream, 0)) == [(1 << 32) - 1, 0, 1]


def test_text_between_frames_is_no_damage() -> None:
    decoder = bota.Decoder()
    stream = sim.encode_banner() + sim.encode_ack("C").join(frames(3))
    assert len(decoder.receive(stream, 0)) == 3
    assert (decoder.health.good, decoder.health.bad, decoder.health.bad_bytes) == (3, 0, 0)


def test_half_a_frame_and_then_silence_costs_only_itself() -> None:
    one, *rest = frames(4)
    decoder = bota.Decoder()
    assert decoder.receive(one[:25], 0) == []
    assert times_us(decoder.receive(b"".join(rest), 10**12)) == [1000, 2000, 3000]
    assert (decoder.health.bad, decoder.health.bad_bytes) == (1, 25)


def test_a_frame_full_of_false_headers_is_found_from_any_start() -> None:
    one = payload_frame(b"\0\0" + b"\xaa" * 24 + bytes(4) + b"\xaa" * 4)
    for start in range(37):
        decoder = bota.Decoder()
        assert len(decoder.receive((one * 4)[start:], 0)) == (4 if start == 0 else 3)


def test_out_of_sync_a_frame_with_reserved_bits_is_accepted_only_by_its_successor() -> None:
    strange = [bota.encode_frame((0, 0, 0), (0, 0, 0), time, status=0x1000) for time in range(3)]
    decoder = bota.Decoder()
    assert times_us(decoder.receive(b"\0" * 5 + b"".join(strange), 0)) == [1, 2]
    assert decoder.health.bad == 2
    assert times_us(bota.Decoder().receive(strange[0], 0)) == [0]


def test_readings_own_their_memory() -> None:
    decoder = bota.Decoder()
    first, second = (decoder.receive(WORKED, 0)[0] for _ in range(2))
    first.force_n[:] = 0
    assert second.force_n[0] == 1.5


def test_a_frame_of_wrong_shape_is_refused() -> None:
    with pytest.raises(struct.error):
        bota.encode_frame((1, 2), (1, 2, 3), 0)
