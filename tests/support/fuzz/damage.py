"""Damage of a frame on a bad line: bytes changed, added, lost or reordered."""

from __future__ import annotations

from random import Random

MOST_BYTES = 4
"""Bytes that one mishap adds, takes or overwrites at most; longer ones are what truncation is for."""

HEADER = 10
"""A length field stands among the first bytes of a frame, where it has one."""

EXTREMES = (b"\x00", b"\x01", b"\x7f", b"\x80", b"\xfe", b"\xff")


def damage(unit: bytes, other: bytes, rng: Random) -> bytes:
    """A reading after one mishap, chosen at random; ``other`` is a reading of the same device.

    What comes out is neither of the two: a header that all readings share can make one of both whole again.
    """
    at, count, header = rng.randrange(len(unit)), rng.randint(1, MOST_BYTES), rng.randrange(min(HEADER, len(unit)))
    cut, other_cut = rng.randint(1, len(unit) - 1), rng.randint(1, len(other) - 1)
    noise = rng.randbytes(count)
    damaged = rng.choice(
        (
            _flipped(unit, rng),
            unit[:at] + noise + unit[at + count :],
            unit[:at] + noise + unit[at:],
            unit[:at] + unit[at + count :],
            unit[: at + count] + unit[at:],  # bytes come twice
            unit[:cut],
            unit[cut:],
            unit[:cut] + other[other_cut:],
            unit[:header] + rng.choice(EXTREMES) + unit[header + 1 :],
        )
    )
    return damage(unit, other, rng) if damaged in (unit, other) else damaged


def _flipped(unit: bytes, rng: Random) -> bytes:
    """One to three bits are turned."""
    damaged = bytearray(unit)
    for _ in range(rng.randint(1, 3)):
        bit = rng.randrange(8 * len(damaged))
        damaged[bit >> 3] ^= 1 << (bit & 7)
    return bytes(damaged)
