"""Packets of Weiss Robotics controllers: DSACON32m, WTS modules, WSG grippers.

A packet is ``AA AA AA``, id (u8), length of the payload (u16, little-endian), payload, checksum (u16, little-endian).
The controllers differ in whether the checksum covers the preamble, whether a packet without payload has a checksum, and
in their error numbers. Source: the public drivers of the three.
"""

from __future__ import annotations

from binascii import crc_hqx
from collections.abc import Callable
from typing import NamedTuple

from slipd.devices.shared.device_interface import DecoderHealth
from slipd.devices.shared.frame_scanner import NO_FRAME, FrameScanner

PREAMBLE = b"\xaa\xaa\xaa"

SEED_AFTER_PREAMBLE = 0xFFFF
"""Seed of a checksum over the bytes from the id on (DSACON32m)."""
SEED_WITH_PREAMBLE = 0x50F5
"""That seed after the preamble: for a checksum that includes the preamble (WTS, WSG)."""

_HEAD_LENGTH = 6
_CRC_LENGTH = 2

STATUS_WORDS = (
    "ok",
    "not available",
    "no sensor",
    "not initialised",
    "already running",
    "feature not supported",
    "inconsistent data",
    "timeout",
    "read error",
    "write error",
    "insufficient resources",
    "checksum error",
    "no parameter expected",
    "not enough parameters",
    "unknown command",
    "command format error",
    "access denied",
    "already open",
    "command failed",
    "command aborted",
    "invalid handle",
    "not found",
    "not open",
    "input/output error",
    "wrong parameter",
    "index out of bounds",
    "command pending",
    "overrun",
    "range error",
    "axis blocked",
    "file exists",
)
"""Meaning of each status number of WTS and WSG; the DSACON32m differs from 12 on."""


ALREADY_RUNNING = 4


def status_word(code: int, words: tuple[str, ...] = STATUS_WORDS) -> str:
    """Return the meaning of a status or error number, for people."""
    return words[code] if code < len(words) else f"status {code}"


_TABLE = tuple(crc_hqx(bytes((byte,)), 0) for byte in range(256))  # of CRC-16/CCITT, poly 0x1021
_PERIOD = 13
_SETTLED = 2  # bytes at the end that are not folded
_WORTH_FOLDING = 2  # at most this many blocks are processed bytewise as fast as folded


def checksum(data: bytes, seed: int = SEED_AFTER_PREAMBLE) -> int:
    """Return the checksum of ``data``; the checksum of data followed by its own checksum, low byte first, is 0.

    This is not a CRC: the table is that of a left-shifting CCITT, but the register shifts right. Sixteen such steps
    have the effect of three, so bytes that are 13 apart enter in the same way. Therefore the bytes can be folded in
    blocks of 13 before the loop; and therefore equal damage to two bytes 13, 26, … apart is not detected. One in 60
    pairs of flipped bits passes, and one in 2^12 of other even numbers. All damage within one byte and every odd number
    of flipped bits is detected.
    """
    count = len(data) - _SETTLED
    blocks = -(-count // _PERIOD)
    if blocks > _WORTH_FOLDING:
        number = int.from_bytes(data[:count], "big")
        number ^= int.from_bytes(seed.to_bytes(2, "little"), "big") << 8 * (count - 2)
        while blocks > 1:
            half = blocks // 2
            bits = 8 * _PERIOD * half
            number = number >> bits ^ number & (1 << bits) - 1
            blocks -= half
        data, seed = number.to_bytes(_PERIOD, "big") + data[count:], 0
    for byte in data:
        seed = _TABLE[(seed ^ byte) & 0xFF] ^ seed >> 8
    return seed


class Packet(NamedTuple):
    """A packet whose checksum matches."""

    id: int
    payload: bytes


def encode(packet_id: int, payload: bytes, seed: int, *, bare: bool = False) -> bytes:
    """Return a packet as it is sent.

    Args:
        packet_id: Its id, 0 to 255.
        payload: At most 65,535 bytes.
        seed: Seed of the checksum: `SEED_AFTER_PREAMBLE` or `SEED_WITH_PREAMBLE`.
        bare: Whether a packet without payload has no checksum.
    """
    body = bytes((packet_id,)) + len(payload).to_bytes(2, "little") + payload
    if bare and not payload:
        return PREAMBLE + body
    return PREAMBLE + body + checksum(body, seed).to_bytes(2, "little")


class PacketScanner(FrameScanner):
    """Find the packets in a stream.

    Args:
        seed: Seed of the checksum: `SEED_AFTER_PREAMBLE` or `SEED_WITH_PREAMBLE`.
        accepts: ``accepts(id, size, payload)`` returns whether such a packet exists, given the length of its payload
            and the part of the payload received so far. It limits how long the scanner waits: it must reject an
            impossible length, and must keep rejecting a packet when more of it arrives.
        typical: Length of an ordinary packet, bytes. Damage is counted in packets of this length.
        health: Receives ``bad`` and ``bad_bytes``.
        bare: Whether a packet without payload has no checksum.
        text: Bytes that are not counted as damage between packets.
    """

    def __init__(
        self,
        seed: int,
        accepts: Callable[[int, int, bytes], bool],
        typical: int,
        health: DecoderHealth,
        *,
        bare: bool = False,
        text: bytes = b"",
    ) -> None:
        super().__init__(PREAMBLE, self._packet_length, typical, health, text=text)
        self._seed = seed
        self._accepts = accepts
        self._bare = bare

    def packets(self, data: bytes, t_ns: int | None = None) -> list[Packet]:
        """Scan the next bytes of the stream, see `FrameScanner.receive`; return the packets they complete."""
        buffer, found = self.receive(data, t_ns)
        packets = []
        for at, _ in found:
            payload_at = at + _HEAD_LENGTH
            packets.append(Packet(buffer[at + 3], buffer[payload_at : payload_at + self._size(buffer, at)]))
        return packets

    def _packet_length(self, buffer: bytes, at: int) -> int:
        payload_at = at + _HEAD_LENGTH
        if payload_at > len(buffer):
            return 0
        size = self._size(buffer, at)
        end = payload_at + size
        if not self._accepts(buffer[at + 3], size, buffer[payload_at:end]):
            return NO_FRAME
        if self._bare and size == 0:
            return _HEAD_LENGTH
        end += _CRC_LENGTH
        if end > len(buffer):
            return 0
        sent = int.from_bytes(buffer[end - 2 : end], "little")  # a residue of 0 would also accept wrong sums
        return end - at if checksum(buffer[at + len(PREAMBLE) : end - 2], self._seed) == sent else NO_FRAME

    @staticmethod
    def _size(buffer: bytes, at: int) -> int:
        return int.from_bytes(buffer[at + 4 : at + 6], "little")
