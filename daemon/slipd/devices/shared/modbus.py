"""Modbus RTU frames: requests of the master, and their answers.

They cover the four functions that the supported devices use: read holding (3) and input (4) registers, write registers
(16), and both in one (23). Source: Modbus application protocol V1.1b3; Modbus over serial line V1.02.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from slipd.devices.shared import checksums

READ_HOLDING = 3
READ_INPUT = 4
WRITE = 16
READ_WRITE = 23

ILLEGAL_ADDRESS = 2

MAX_FRAME = 256
"""Longest frame of the protocol, bytes; no buffer needs to be longer."""

_MOST_READ = 125
_MOST_WRITTEN = {WRITE: 123, READ_WRITE: 121}
SIZE_AT = {WRITE: 6, READ_WRITE: 10}  # offset of the number of bytes that a request writes
ERROR_FLAG = 0x80
READ_LENGTH = 8
_EXCEPTION_LENGTH = 5
CRC_LENGTH = 2


@dataclass(frozen=True, slots=True)
class Request:
    """Request of the master.

    Attributes:
        unit: Address of the device, 1 to 247.
        function: `READ_HOLDING`, `READ_INPUT`, `WRITE` or `READ_WRITE`.
        read_address: First register to read.
        read_count: Number of registers to read, 1 to 125; 0 if the function reads nothing.
        write_address: First register to write.
        registers: Values to write, 16 bits each; empty if the function writes nothing.
    """

    unit: int
    function: int
    read_address: int = 0
    read_count: int = 0
    write_address: int = 0
    registers: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        reads = self.function in (READ_HOLDING, READ_INPUT, READ_WRITE)
        writes = self.function in _MOST_WRITTEN
        if not (reads or writes):
            raise ValueError(f"function must be 3, 4, 16 or 23, got {self.function}")
        if not (1 <= self.read_count <= _MOST_READ if reads else self.read_count == 0):
            raise ValueError(f"read_count must be 1 to {_MOST_READ}, or 0 for function 16, got {self.read_count}")
        most = _MOST_WRITTEN.get(self.function, 0)
        if not min(most, 1) <= len(self.registers) <= most:
            raise ValueError(
                f"registers of function {self.function} must be {min(most, 1)} to {most}, got {len(self.registers)}"
            )


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
    body = bytes((request.unit, request.function))
    if request.read_count:
        body += struct.pack(">HH", request.read_address, request.read_count)
    if request.registers:
        count = len(request.registers)
        body += struct.pack(f">HHB{count}H", request.write_address, count, 2 * count, *request.registers)
    return with_checksum(body)


def find_reply(received: bytes, request: Request) -> Reply | None:
    """Return the answer to ``request`` among the bytes received since it was sent; None if there is none.

    Bytes before and after the answer are skipped.
    """
    head = reply_head(request)
    length = len(head) + 2 * request.read_count + CRC_LENGTH
    frame = _find_valid(received, head, length)
    if frame:
        return Reply(struct.unpack_from(f">{request.read_count}H", frame, len(head)), 0, length)
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
    head = bytes((request.unit, request.function))
    if request.read_count:
        return head + bytes((2 * request.read_count,))
    return head + struct.pack(">HH", request.write_address, len(request.registers))


def _find_valid(received: bytes, head: bytes, length: int) -> bytes:
    at = received.find(head)
    while 0 <= at <= len(received) - length:
        frame = received[at : at + length]
        if checksum_matches(frame):
            return frame
        at = received.find(head, at + 1)
    return b""
