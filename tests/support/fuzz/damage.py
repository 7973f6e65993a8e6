"""Damage of a frame on a bad line: bytes changed, added, lost or reordered."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

MOST_BYTES = 4
"""Bytes that one mishap adds, takes or overwrites at most; longer ones are what truncation is for."""

HEADER = 10
"""A length field stands among the first bytes of a frame, where it has one."""

EXTREMES = bytes((0x00, 0x01, 0x7F, 0x80, 0xFE, 0xFF))


def flipped(unit: bytes, _: bytes, rng: Random) -> bytes:
    """One to three bits are turned."""
    damaged = bytearray(unit)
    for _ in range(1 + int(3 * rng.random())):
        bit = int(8 * len(damaged) * rng.random())
        damaged[bit >> 3] ^= 1 << (bit & 7)
    return bytes(damaged)


def overwritten(unit: bytes, _: bytes, rng: Random) -> bytes:
    """A burst of noise covers some bytes."""
    at, count = _place(unit, rng)
    return unit[:at] + rng.randbytes(count) + unit[at + count :]


def inserted(unit: bytes, _: bytes, rng: Random) -> bytes:
    """Bytes come that were never sent."""
    at, count = _place(unit, rng)
    return unit[:at] + rng.randbytes(count) + unit[at:]


def deleted(unit: bytes, _: bytes, rng: Random) -> bytes:
    """Bytes are lost."""
    at, count = _place(unit, rng)
    return unit[:at] + unit[at + count :]


def doubled(unit: bytes, _: bytes, rng: Random) -> bytes:
    """Bytes come twice."""
    at, count = _place(unit, rng)
    return unit[: at + count] + unit[at:]


def truncated(unit: bytes, _: bytes, rng: Random) -> bytes:
    """The end is lost."""
    return unit[: _cut(unit, rng)]


def beheaded(unit: bytes, _: bytes, rng: Random) -> bytes:
    """The beginning is lost."""
    return unit[_cut(unit, rng) :]


def spliced(unit: bytes, other: bytes, rng: Random) -> bytes:
    """The beginning of one reading and the end of another; neither is whole."""
    return unit[: _cut(unit, rng)] + other[_cut(other, rng) :]


def lying(unit: bytes, _: bytes, rng: Random) -> bytes:
    """A byte of the header, where lengths stand, says something extreme."""
    at = int(min(HEADER, len(unit)) * rng.random())
    return unit[:at] + EXTREMES[int(len(EXTREMES) * rng.random())].to_bytes(1, "big") + unit[at + 1 :]


KINDS: tuple[Callable[[bytes, bytes, Random], bytes], ...] = (
    flipped,
    overwritten,
    inserted,
    deleted,
    doubled,
    truncated,
    beheaded,
    spliced,
    lying,
)


def damage(unit: bytes, other: bytes, rng: Random) -> bytes:
    """A reading after one mishap, chosen at random; ``other`` is a reading of the same device.

    What comes out is neither of the two: a header that all readings share can make one of both whole again.
    """
    while True:
        damaged = KINDS[int(len(KINDS) * rng.random())](unit, other, rng)
        if damaged not in (unit, other):
            return damaged


def _place(unit: bytes, rng: Random) -> tuple[int, int]:
    return int(len(unit) * rng.random()), 1 + int(MOST_BYTES * rng.random())


def _cut(unit: bytes, rng: Random) -> int:
    """A place inside, neither before the first byte nor behind the last."""
    return 1 + int((len(unit) - 1) * rng.random())
