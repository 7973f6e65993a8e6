"""Modbus frames: published bytes, any split, and pymodbus as an independent peer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from gripper_registers import read_requests
from hypothesis import given
from hypothesis import strategies as st
from pymodbus.framer import FramerRTU
from pymodbus.pdu import DecodePDU, ExceptionResponse, ModbusPDU
from pymodbus.pdu import register_message as peer

from slipd.devices.shared import modbus
from slipd.devices.shared.modbus import Request
from slipd.tools.sim import emulated_robotiq_2f as sim

POLL = Request(9, modbus.READ_INPUT, 2000, 3)
WORKED = [
    (Request(9, modbus.WRITE, address=1000, registers=(0, 0, 0)), "09 10 03 E8 00 03 06 00 00 00 00 00 00 73 30"),
    (
        Request(9, modbus.WRITE, address=1000, registers=(256, 0, 0)),
        "09 10 03 E8 00 03 06 01 00 00 00 00 00 72 E1",
    ),
    (POLL, "09 04 07 D0 00 03 B1 CE"),
    (Request(9, modbus.READ_HOLDING, 2000, 3), "09 03 07 D0 00 03 04 0E"),
]
"""From the maker's manual, but for the first, which was computed."""

units, words, counts = st.integers(1, 247), st.integers(0, 0xFFFF), st.integers(1, 125)
read_functions = st.sampled_from([modbus.READ_HOLDING, modbus.READ_INPUT])
requests = st.one_of(
    st.builds(Request, units, read_functions, words, counts),
    st.builds(
        lambda unit, at, registers: Request(unit, modbus.WRITE, address=at, registers=tuple(registers)),
        *(units, words, st.lists(words, min_size=1, max_size=123)),
    ),
)


@pytest.mark.parametrize(("request_", "worked"), WORKED)
def test_worked_requests_are_written_and_read(request_: Request, worked: str) -> None:
    assert modbus.encode_request(request_) == bytes.fromhex(worked)
    assert read_requests(bytes.fromhex(worked)) == [request_]


def test_worked_replies_are_found() -> None:
    written, status = bytes.fromhex("09 10 03 E8 00 03 01 30"), bytes.fromhex("09 04 06 B9 00 00 FF BD 00 5C 9A")
    assert modbus.find_reply(written, WORKED[0][0]) == modbus.Reply((), 0, 8)
    assert modbus.find_reply(status, POLL) == modbus.Reply((0xB900, 0x00FF, 0xBD00), 0, 11)


ASKED: dict[int, Callable[[Request], Any]] = {
    modbus.READ_HOLDING: lambda asked: peer.ReadHoldingRegistersRequest(
        dev_id=asked.unit, address=asked.address, count=asked.count
    ),
    modbus.READ_INPUT: lambda asked: peer.ReadInputRegistersRequest(
        dev_id=asked.unit, address=asked.address, count=asked.count
    ),
    modbus.WRITE: lambda asked: peer.WriteMultipleRegistersRequest(
        dev_id=asked.unit, address=asked.address, registers=list(asked.registers)
    ),
}
ANSWERED: dict[int, Callable[[Request, list[int]], Any]] = {
    modbus.READ_HOLDING: lambda asked, words: peer.ReadHoldingRegistersResponse(dev_id=asked.unit, registers=words),
    modbus.READ_INPUT: lambda asked, words: peer.ReadInputRegistersResponse(dev_id=asked.unit, registers=words),
    modbus.WRITE: lambda asked, _: peer.WriteMultipleRegistersResponse(
        dev_id=asked.unit, address=asked.address, count=len(asked.registers)
    ),
}


def by_the_peer(pdu: ModbusPDU) -> bytes:
    return FramerRTU(DecodePDU(False)).buildFrame(pdu)


@given(requests, st.data(), st.integers(1, 11))
def test_requests_replies_and_refusals_are_those_of_the_peer(request_: Request, data: st.DataObject, code: int) -> None:
    assert modbus.encode_request(request_) == by_the_peer(ASKED[request_.function](request_))
    count = request_.count
    registers = tuple(data.draw(st.lists(words, min_size=count, max_size=count)))
    frame = by_the_peer(ANSWERED[request_.function](request_, list(registers)))
    assert sim.encode_reply(request_, registers) == frame
    assert modbus.find_reply(frame, request_) == modbus.Reply(registers, 0, len(frame))
    frame = by_the_peer(ExceptionResponse(request_.function, code, request_.unit))
    assert sim.encode_exception(request_, code) == frame
    assert modbus.find_reply(frame, request_) == modbus.Reply((), code, 5)


OTHER_UNIT = modbus.encode_request(Request(10, modbus.READ_INPUT, 2000, 3))


@given(st.lists(requests, max_size=4), st.integers(1, 40), st.sampled_from((b"", b"\x00\x09\x63", OTHER_UNIT)))
def test_a_device_reads_its_requests_from_any_split_and_skips_all_else(
    sent: list[Request], size: int, between: bytes
) -> None:
    mine = [replace(request, unit=9) for request in sent]
    stream = b"".join(between + modbus.encode_request(request) for request in mine)
    assert read_requests(stream, size=size) == mine


def test_a_reply_is_found_in_noise_and_no_damaged_or_foreign_one_is() -> None:
    reply = sim.encode_reply(POLL, (1, 2, 3))
    assert modbus.find_reply(b"\x09\x04\x06" + reply + b"\x09", POLL) == modbus.Reply((1, 2, 3), 0, 11)
    odd = replace(POLL, unit=modbus.READ_INPUT | modbus.ERROR_FLAG)  # a refusal begins with two equal bytes
    assert modbus.find_reply(bytes((odd.unit,)) + sim.encode_exception(odd, 2), odd) == modbus.Reply((), 2, 5)
    force = Request(9, modbus.WRITE, address=1002, registers=(1,))
    assert modbus.find_reply(sim.encode_reply(force), WORKED[0][0]) is None
    for other in ({"unit": 8}, {"function": modbus.READ_HOLDING}, {"count": 2}):
        assert modbus.find_reply(reply, replace(POLL, **other)) is None
    damaged = [reply[:at] + bytes((reply[at] ^ 1 << bit,)) + reply[at + 1 :] for at in range(11) for bit in range(8)]
    for wrong in (*damaged, *(reply[:size] for size in range(11))):
        assert modbus.find_reply(wrong, POLL) is None


@pytest.mark.parametrize(
    "fields",
    [
        {"function": 6},
        {"function": modbus.READ_INPUT, "count": 0},
        {"function": modbus.READ_INPUT, "count": 126},
        {"function": modbus.WRITE},
        {"function": modbus.WRITE, "registers": (0,) * 124},
        {"function": modbus.WRITE, "registers": (0,), "count": 1},
        {"function": modbus.READ_INPUT, "count": 1, "registers": (0,)},
    ],
)
def test_a_request_that_fits_no_frame_is_refused(fields: dict[str, int]) -> None:
    with pytest.raises(ValueError, match="function"):
        Request(9, address=0, **fields)
