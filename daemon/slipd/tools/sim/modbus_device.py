"""The device's side of Modbus RTU: requests of the master are parsed, and answered or refused."""

from __future__ import annotations

import struct

from slipd.devices.shared import modbus


def encode_reply(request: modbus.Request, registers: tuple[int, ...] = ()) -> bytes:
    """Return the answer of a device that carried out ``request``, with the values of the registers it asks for."""
    return modbus.with_checksum(modbus.reply_head(request) + struct.pack(f">{len(registers)}H", *registers))


def encode_exception(request: modbus.Request, code: int) -> bytes:
    """Return the answer of a device that refuses ``request``."""
    return modbus.with_checksum(bytes((request.unit, request.function | modbus.ERROR_FLAG, code)))


def parse_requests(received: bytes, unit: int) -> tuple[list[modbus.Request], bytes]:
    """Return the requests to ``unit`` among the bytes a device received, and the bytes to keep for the next call."""
    requests: list[modbus.Request] = []
    at = received.find(unit)
    while at >= 0:
        length = _request_length(received, at)
        if at + length > len(received):
            return requests, received[at:]
        request = _parse_request(received[at : at + length])
        if request:
            requests.append(request)
        at = received.find(unit, at + (length if request else 1))
    return requests, b""


def _request_length(received: bytes, at: int) -> int:
    """Return the length of the request at ``at``, or of the part that shows it; 1 if there is none."""
    function = received[at + 1] if at + 1 < len(received) else modbus.READ_INPUT
    if function in (modbus.READ_HOLDING, modbus.READ_INPUT):
        return modbus.READ_LENGTH
    size_at = modbus.SIZE_AT.get(function)
    if size_at is None:
        return 1
    size = received[at + size_at] if at + size_at < len(received) else 0
    return size_at + 1 + size + modbus.CRC_LENGTH


def _parse_request(frame: bytes) -> modbus.Request | None:
    if len(frame) < modbus.READ_LENGTH or not modbus.checksum_matches(frame):
        return None
    unit, function = frame[:2]
    read_address, read_count = struct.unpack_from(">HH", frame, 2) if function != modbus.WRITE else (0, 0)
    write_address, count, registers = 0, 0, ()
    if function in modbus.SIZE_AT:
        size_at = modbus.SIZE_AT[function]
        write_address, count = struct.unpack_from(">HH", frame, size_at - 4)
        registers = struct.unpack_from(f">{frame[size_at] // 2}H", frame, size_at + 1)
    if count != len(registers):
        return None
    try:
        return modbus.Request(unit, function, read_address, read_count, write_address, registers)
    except ValueError:
        return None
