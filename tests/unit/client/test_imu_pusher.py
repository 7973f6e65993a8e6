"""The example that pushes a serial IMU: packets in any split, between noise, become readings that slipd decodes."""

from __future__ import annotations

import struct

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st
from imu_pusher import Packets, readings

from slipd.devices.external import Decoder


def packet(kind: int, *numbers: int) -> bytes:
    """Return a packet as the maker's guide has it; the fourth number is the temperature."""
    begin = struct.pack("<BB4h", 0x55, kind, *numbers, 2500)
    return begin + bytes([sum(begin) & 0xFF])


AT_REST = packet(0x51, 0, 0, 2048) + packet(0x52, 0, 164, 0)  # 1 g upwards along Z, 10 °/s about Y
DECOY = b"\x55\x51\x00" + packet(0x53, 1, 2, 3)[:-1] + b"\x00"


@given(st.binary(max_size=30), st.lists(st.integers(0, 60), max_size=6))
def test_packets_are_found_in_any_split_and_after_any_noise(noise: bytes, cuts: list[int]) -> None:
    data = noise + bytes(11) + DECOY + bytes(11) + 3 * AT_REST
    packets, newest, found = Packets(), {}, []
    for begin, end in zip([0, *sorted(cuts)], [*sorted(cuts), len(data)], strict=True):
        found += list(readings(data[begin:end], packets, newest))
    assert found[-1]["gravity_mps2"] == pytest.approx([0.0, 0.0, -9.80665])
    assert found[-1]["angular_velocity_radps"] == pytest.approx([0.0, 0.1747, 0.0], abs=1e-4)
    assert len(found) >= 3
    (sample,) = Decoder().receive(msgpack.packb({"stream": "arm", "t_ns": 1, "seq": 0, **found[-1]}), 0)
    assert sample.gravity_mps2 == pytest.approx([0.0, 0.0, -9.80665])
