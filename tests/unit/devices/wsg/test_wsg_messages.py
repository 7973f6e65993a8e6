"""Packets of WSG grippers: worked frames, every code, and implausible replies."""

from __future__ import annotations

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slipd.devices.shared import weiss_packets as weiss
from slipd.devices.wsg import Decoder
from slipd.devices.wsg import wsg_messages as wire
from slipd.devices.wsg.wsg_messages import Limits, Reply
from slipd.tools.sim import emulated_wsg as sim

LIMITS = Limits(110.0, 5.0, 420.0, 100.0, 5000.0, 5.0, 80.0, 120.0)


def floats(*numbers: float) -> bytes:
    return struct.pack(f"<{len(numbers)}f", *numbers)


@pytest.mark.parametrize(
    ("made", "sent"),
    [
        (wire.encode(0x06), "AA AA AA 06 00 00 97 26"),
        (wire.encode(0x01, b"\x12\x34"), "AA AA AA 01 02 00 12 34 6D 66"),
        (wire.SEARCH_REFERENCE, "AA AA AA 20 01 00 00 8F 83"),
        (wire.ACKNOWLEDGEMENT, "AA AA AA 24 03 00 61 63 6B DC B9"),
        (wire.encode(wire.STOP), "AA AA AA 22 00 00 0E 76"),
        (wire.encode(0x23), "AA AA AA 23 00 00 AC 1C"),
        (wire.encode(wire.DISCONNECT), "AA AA AA 07 00 00 35 4C"),
        (wire.set_force(20.0), "AA AA AA 32 04 00 00 00 A0 41 F5 22"),
        (sim.encode_reply(wire.SET_FORCE), "AA AA AA 32 02 00 00 00 9C 93"),
        (wire.encode(wire.GET_FORCE), "AA AA AA 33 00 00 2C 70"),
        (wire.encode(0x25, floats(40, 50)), "AA AA AA 25 08 00 00 00 20 42 00 00 48 42 83 5C"),
        (sim.encode_reply(0x25, wire.PENDING), "AA AA AA 25 02 00 1A 00 6D 48"),
        (sim.encode_reply(0x25), "AA AA AA 25 02 00 00 00 22 87"),
        (sim.encode_reply(0x25, 18), "AA AA AA 25 02 00 12 00 E4 C9"),
        (wire.encode(0x26, floats(80, 100)), "AA AA AA 26 08 00 00 00 A0 42 00 00 C8 42 96 91"),
        (wire.encode(0x21, b"\x02" + floats(60, 100)), "AA AA AA 21 09 00 02 00 00 70 42 00 00 C8 42 63 CB"),
        (wire.encode(wire.FORCE, bytes(3)), "AA AA AA 45 03 00 00 00 00 17 E3"),
        (wire.update_request(wire.FORCE, 20), "AA AA AA 45 03 00 01 14 00 99 7E"),
        (sim.encode_number(wire.FORCE, 12.5), "AA AA AA 45 06 00 00 00 00 00 48 41 9A 9D"),
        (sim.encode_state({"referenced", "target_reached"}), "AA AA AA 40 06 00 00 00 81 00 00 00 67 BD"),
        (sim.encode_grasping("holding"), "AA AA AA 41 03 00 00 00 04 5A 02"),
        (wire.update_request(wire.WIDTH, 20), "AA AA AA 43 03 00 01 14 00 36 8D"),
        (wire.encode(wire.SYSTEM), "AA AA AA 50 00 00 DB 87"),
        (wire.encode(wire.LIMITS), "AA AA AA 53 00 00 3D 38"),
        (wire.ALLOW_OVERDRIVE, "AA AA AA 37 01 00 01 04 8D"),
    ],
)
def test_worked_frames_are_written(made: bytes, sent: str) -> None:
    assert made == bytes.fromhex(sent)


def read(data: bytes) -> list[Reply]:
    return Decoder().messages(data)


def test_worked_replies_are_read() -> None:
    force, state, done = read(
        bytes.fromhex(
            "AA AA AA 45 06 00 00 00 00 00 48 41 9A 9D AA AA AA 40 06 00 00 00 81 00 00 00 67 BD"
            "AA AA AA 32 02 00 00 00 9C 93"
        )
    )
    assert (force.id, force.status, wire.parse_number(force.data)) == (wire.FORCE, wire.OK, 12.5)
    assert wire.parse_state(state.data) == {"referenced", "target_reached"}
    assert done == Reply(wire.SET_FORCE, wire.OK, b"")


def test_limits_and_serial_number_are_little_endian() -> None:
    """Bytes from the field tables of the public drivers, not from a gripper."""
    limits = "0000DC42 0000A040 0000D243 0000C842 00409C45 0000A040 0000A042 0000F042"
    assert wire.parse_limits(bytes.fromhex(limits)) == (110.0, 5.0, 420.0, 100.0, 5000.0, 5.0, 80.0, 120.0)
    assert wire.SYSTEM_FIELDS.unpack(bytes.fromhex("01 00 34 12 78 56 34 92"))[3] == 0x92345678


def test_every_status_has_a_word_and_comes_without_data() -> None:
    for status in range(1, 31):
        assert not weiss.status_word(status).startswith("status")
        for reply_id, size in wire.REPLY_SIZES.items():
            assert read(sim.encode_reply(reply_id, status)) == [Reply(reply_id, status, b"")]
            assert size == 0 or read(sim.encode_reply(reply_id, status, bytes(size))) == []


def test_every_state_bit_has_one_word() -> None:
    assert sorted(wire.STATE_BITS) == [*range(10), *range(12, 21)]
    for bit, word in wire.STATE_BITS.items():
        assert wire.parse_state((1 << bit).to_bytes(4, "little")) == {word}
    assert wire.parse_state((1 << 10 | 1 << 11 | 0x7FF << 21).to_bytes(4, "little")) == set()
    assert {*wire.FAULTS, *wire.NOTICES} <= set(wire.STATE_BITS.values())


@pytest.mark.parametrize(
    "packet",
    [
        sim.encode_reply(0x25),
        sim.encode_reply(wire.HOME, 31),
        sim.encode_reply(wire.WIDTH),
        sim.encode_reply(wire.HOME, wire.OK, b"\0"),
        wire.encode(wire.HOME, b"\0"),
        sim.encode_number(wire.WIDTH, math.nan),
        sim.encode_number(wire.FORCE, -math.inf),
        sim.encode_number(wire.GET_FORCE, 1001.0),
        sim.encode_reply(wire.GRASPING, wire.OK, b"\x08"),
        sim.encode_limits(LIMITS._replace(max_acceleration=math.nan)),
        sim.encode_limits(LIMITS._replace(stroke_mm=0.0)),
        sim.encode_limits(LIMITS._replace(max_speed=5.0)),
        sim.encode_limits(LIMITS._replace(nominal_force=5.0)),
        sim.encode_limits(LIMITS._replace(nominal_force=1e4)),
        sim.encode_limits(LIMITS._replace(overdrive_force=1e4)),
        wire.encode(wire.WIDTH, bytes(60_000)),
        weiss.encode(wire.HOME, bytes(2), weiss.SEED_AFTER_PREAMBLE),
    ],
)
def test_an_implausible_reply_is_rejected(packet: bytes) -> None:
    replies = Decoder()
    assert replies.messages(packet) == []
    assert replies.messages(sim.encode_reply(wire.HOME)) == [Reply(wire.HOME, wire.OK, b"")]


@given(st.floats(0.0, 1000.0))
def test_a_number_on_the_wire_never_exceeds_the_intended_one(number: float) -> None:
    sent = wire.at_most(number)
    assert struct.unpack("<f", struct.pack("<f", sent))[0] == sent
    assert sent <= number <= sent * (1 + 1.3e-7) + 1.5e-45
