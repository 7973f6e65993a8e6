"""Modbus RTU frames: requests of the master, and their answers.

They cover the functions that slipd uses: read holding (3) and input (4) registers, and write registers (16). Source:
Modbus application protocol V1.1b3; Modbus over serial line V1.02.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from slipd.devices.shared import checksums

READ_HOLDING = 3
READ_INPUT = 4
WRITE = 16

MAX_FRAME = 256
"""Longest frame of the protocol, bytes; no buffer needs to be longer."""

_MOST_READ, _MOST_WRITTEN = 125, 123
ERROR_FLAG = 0x80
_EXCEPTION_LENGTH = 5
CRC_LENGTH = 2


@dataclass(frozen=True, slots=True)
class Request:
    """Request of the master.

    Attributes:
        unit: Address of the device, 1 to 247.
        function: `READ_HOLDING`, `READ_INPUT` or `WRITE`.
        address: First register to read or write.
        count: Number of registers to read, 1 to 125; 0 for a write.
        registers: Values to write, 1 to 123 of 16 bits each; empty for a read.
    """

    unit: int
    function: int
    address: int
    count: int = 0
    registers: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if self.function not in (READ_HOLDING, READ_INPUT, WRITE):
            raise ValueError(f"function must be 3, 4 or 16, got {self.function}")
        most_read, most_written = (0, _MOST_WRITTEN) if self.function == WRITE else (_MOST_READ, 0)
        for name, number, most in (("count", self.count, most_read), ("registers", len(self.registers), most_written)):
            if not min(most, 1) <= number <= most:
                raise ValueError(f"{name} of function {self.function} must be {min(most, 1)} to {most}, got {number}")


@dataclass(frozen=True, slots=True)
class Reply:
    """Answer of a device.

    Attributes:
        registers: Values read; empty for a write.
        error: Exception code if the device refused the request; 0 if it did not.
        length: Length of the frame, bytes.
    """

    registers: tuple[int, ...]
    error: int
    length: int


def encode_request(request: Request) -> bytes:
    """Return the frame of a request."""
    written = len(request.registers)
    body = struct.pack(">BBHH", request.unit, request.function, request.address, request.count or written)
    if written:
        body += struct.pack(f">B{written}H", 2 * written, *request.registers)
    return with_checksum(body)


def find_reply(received: bytes, request: Request) -> Reply | None:
    """Return the answer to ``request`` among the bytes received since it was sent; None if there is none.

    Bytes before and after the answer are skipped.
    """
    head = reply_head(request)
    length = len(head) + 2 * request.count + CRC_LENGTH
    frame = _find_valid(received, head, length)
    if frame:
        return Reply(struct.unpack_from(f">{request.count}H", frame, len(head)), 0, length)
    frame = _find_valid(received, bytes((request.unit, request.function | ERROR_FLAG)), _EXCEPTION_LENGTH)
    return Reply((), frame[2], _EXCEPTION_LENGTH) if frame else None


def with_checksum(body: bytes) -> bytes:
    """Return a frame: the body and its checksum."""
    return body + checksums.modbus(body).to_bytes(CRC_LENGTH, "little")


def checksum_matches(frame: bytes) -> bool:
    """Return whether a frame ends with its checksum."""
    return checksums.modbus(frame[:-CRC_LENGTH]) == int.from_bytes(frame[-CRC_LENGTH:], "little")


def reply_head(request: Request) -> bytes:
    """Return the bytes before the registers in the answer to ``request``."""
    if request.count:
        return bytes((request.unit, request.function, 2 * request.count))
    return struct.pack(">BBHH", request.unit, request.function, request.address, len(request.registers))


def _find_valid(received: bytes, head: bytes, length: int) -> bytes:
    at = received.find(head)
    while 0 <= at <= len(received) - length:
        frame = received[at : at + length]
        if checksum_matches(frame):
            return frame
        at = received.find(head, at + 1)
    return b""
