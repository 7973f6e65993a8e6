"""The two CRCs of the supported devices: CRC-16/X-25 and CRC-16/MODBUS.

A stream is checked at every byte that looks like a header, so its check must be cheap. CRC-16/X-25 is the bit-reversed
twin of the CCITT checksum that `binascii` computes in C: reverse the bits of every byte, compute, and reverse the
result. CRC-16/MODBUS has no such twin; its frames are few and short, so a table is fast enough.
"""

from __future__ import annotations

from binascii import crc_hqx
from collections.abc import Callable

from slipd.devices.shared.frame_scanner import NO_FRAME

_REVERSED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))

_X25_RESIDUE = 0x1D0F
"""Residue of any message followed by its own X-25 checksum (0xF0B8 with its bits reversed)."""


def x25(data: bytes) -> int:
    """Return CRC-16/X-25: poly 0x1021 reflected, init 0xFFFF, final xor 0xFFFF; sent low byte first."""
    crc = crc_hqx(data.translate(_REVERSED), 0xFFFF)
    return (_REVERSED[crc & 0xFF] << 8 | _REVERSED[crc >> 8]) ^ 0xFFFF


def x25_measure(first: int, length: int) -> Callable[[bytes, int], int]:
    """Return what measures frames of one length for `FrameScanner`.

    Their last two bytes are the CRC-16/X-25, low byte first, of those from ``first`` on.
    """

    def measure(buffer: bytes, at: int) -> int:
        crc = crc_hqx(buffer[at + first : at + length].translate(_REVERSED), 0xFFFF)
        return length if crc == _X25_RESIDUE else NO_FRAME

    return measure


def x25_all_match(data: bytes, starts: range, length: int) -> bool:
    """Return whether each of the pieces of one length that begin at ``starts`` ends with its CRC-16/X-25."""
    mirrored = data.translate(_REVERSED)
    for at in starts:  # noqa: SIM110 - a generator takes longer
        if crc_hqx(mirrored[at : at + length], 0xFFFF) != _X25_RESIDUE:
            return False
    return True


def _modbus_entry(value: int) -> int:
    for _ in range(8):
        value = value >> 1 ^ 0xA001 if value & 1 else value >> 1
    return value


_MODBUS = tuple(_modbus_entry(byte) for byte in range(256))


def modbus(data: bytes) -> int:
    """Return CRC-16/MODBUS: poly 0x8005 reflected, init 0xFFFF, no final xor; sent low byte first."""
    crc = 0xFFFF
    for byte in data:
        crc = _MODBUS[(crc ^ byte) & 0xFF] ^ crc >> 8
    return crc
