"""The packets of Weiss Robotics controllers: DSACON32m, WTS modules, WSG grippers.

A packet is ``AA AA AA``, id (u8), length of the payload (u16, little-endian), payload, checksum (u16, little-endian).
The controllers differ in whether the checksum covers the preamble, in whether a packet without payload has one, and
in the numbers of their errors. Source: the public drivers of the three.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from slipd.devices.framing import Frames
from slipd.devices.health import DecoderHealth

PREAMBLE = b"\xaa\xaa\xaa"

BEHIND_PREAMBLE = 0xFFFF
"""Seed of a checksum that begins at the id (DSACON32m)."""
WITH_PREAMBLE = 0x50F5
"""What the preamble makes of that seed: for a checksum that begins at the preamble (WTS, WSG)."""

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
"""By number, as WTS and WSG count; from 12 on DSACON32m counts otherwise."""


def status_word(code: int, words: tuple[str, ...] = STATUS_WORDS) -> str:
    """Return what a status or error number of a reply means, for people."""
    return words[code] if code < len(words) else f"status {code}"


def _entry(byte: int) -> int:
    value = byte << 8
    for _ in range(8):
        value = value << 1 & 0xFFFF ^ (0x1021 if value & 0x8000 else 0)
    return value


_TABLE = tuple(_entry(byte) for byte in range(256))
_PERIOD = 13
_SETTLED = 2  # bytes at the end that are not folded
_WORTH_FOLDING = 2  # blocks that are walked as fast as they are folded


def checksum(data: bytes, seed: int = BEHIND_PREAMBLE) -> int:
    """Return the checksum of ``data``; that of data followed by its own checksum, low byte first, is 0.

    It is no CRC: the table is that of a CCITT shifting left, but is walked shifting right. A step of that walk taken
    16 times does what it does in 3: bytes 13 apart enter alike. So the bytes may be folded 13 by 13 before the walk,
    and so the same damage to two bytes 13, 26, … apart is never seen: of two flipped bits one pair in 60 passes, of
    other even numbers one in 2^12. All damage within one byte and every odd number of flipped bits is found.
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
    """A packet whose checksum holds."""

    id: int
    payload: bytes


def encode(packet_id: int, payload: bytes, seed: int, *, bare: bool = False) -> bytes:
    """Return a packet as it is sent.

    Args:
        packet_id: Its id, 0 to 255.
        payload: At most 65,535 bytes.
        seed: Of the checksum: `BEHIND_PREAMBLE` or `WITH_PREAMBLE`.
        bare: Without payload there is no checksum.
    """
    body = bytes((packet_id,)) + len(payload).to_bytes(2, "little") + payload
    if bare and not payload:
        return PREAMBLE + body
    return PREAMBLE + body + checksum(body, seed).to_bytes(2, "little")


class Packets(Frames):
    """Finds the packets in a stream.

    Args:
        seed: Of the checksum: `BEHIND_PREAMBLE` or `WITH_PREAMBLE`.
        admits: ``admits(id, size, begun)`` says whether there is such a packet, given the length of its payload and
            as much of the payload as has come. It bounds what is waited for: a length that is wrong must be refused,
            and what it refuses it must go on to refuse when more has come.
        typical: Length of an ordinary packet, bytes: damage is counted in packets of it.
        health: Receives ``bad`` and ``bad_bytes``.
        bare: A packet without payload has no checksum.
        text: Bytes that are no damage when they stand between packets.
    """

    def __init__(
        self,
        seed: int,
        admits: Callable[[int, int, bytes], bool],
        typical: int,
        health: DecoderHealth,
        *,
        bare: bool = False,
        text: bytes = b"",
    ) -> None:
        super().__init__(PREAMBLE, self._packet_length, typical, health, text=text)
        self._seed = seed
        self._admits = admits
        self._bare = bare

    def packets(self, data: bytes) -> list[Packet]:
        """Take the next bytes of the stream and return the packets they complete."""
        buffer, found = self.receive(data)
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
        if not self._admits(buffer[at + 3], size, buffer[payload_at:end]):
            return -1
        if self._bare and size == 0:
            return _HEAD_LENGTH
        end += _CRC_LENGTH
        if end > len(buffer):
            return 0
        sent = int.from_bytes(buffer[end - 2 : end], "little")  # other sums than the right one leave a residue of 0 too
        return end - at if checksum(buffer[at + len(PREAMBLE) : end - 2], self._seed) == sent else -1

    @staticmethod
    def _size(buffer: bytes, at: int) -> int:
        return int.from_bytes(buffer[at + 4 : at + 6], "little")
