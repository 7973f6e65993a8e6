"""Requests made to take long, or much memory, or to lie about their length."""

from __future__ import annotations

import msgpack

LONGEST_BYTES = 16 * 1024


def packed_map(pairs: list[bytes]) -> bytes:
    return b"\xde" + len(pairs).to_bytes(2, "big") + b"".join(pairs)


def _nest(header: bytes) -> bytes:
    return header * (LONGEST_BYTES // len(header))


def _leaves(leaf: bytes, most: int = LONGEST_BYTES - 64) -> bytes:
    """A map of lists of lists of one leaf: as many values as fit, each within the limits of a list."""
    inner = b"\xdc\x00\x40" + leaf * 64
    outer = b"\xdc\x00\x40" + inner * 64
    pairs = []
    left = most
    for number in range(60):
        key = msgpack.packb(f"k{number}")
        room = left - len(key) - 3
        count = min(64, room // len(inner))
        if count < 1:
            break
        value = outer if count == 64 else b"\xdc" + count.to_bytes(2, "big") + inner * count
        pairs.append(key + value)
        left -= len(key) + len(value)
    return packed_map(pairs)


def _keys() -> bytes:
    """Maps of maps with many short keys."""
    inner = b"\xde\x00\x40" + b"".join(bytes((0xA2, 65 + n % 26, 65 + n // 26, 0xC0)) for n in range(64))
    count = (LONGEST_BYTES - 64) // (len(inner) + 3)
    return packed_map([msgpack.packb(f"m{number}") + inner for number in range(count)])


BOMBS: tuple[bytes, ...] = (
    *(_nest(header) for header in (b"\x91", b"\x81\xa1a", b"\xdc\x00\x40", b"\xdc\xff\xff", b"\xdd\x00\x00\xff\xff")),
    *(_nest(header) for header in (b"\xdd\xff\xff\xff\xff", b"\xde\x00\x40\xa1a", b"\xdf\xff\xff\xff\xff", b"\x9f")),
    *(
        _leaves(leaf)
        for leaf in (b"\x00", b"\xc0", b"\x90", b"\x80", b"\xa0", b"\xcb" + bytes(8), b"\xc4\x00", b"\xff")
    ),
    _keys(),
    msgpack.packb({"v": 1, "id": 1, "op": "hello", "pad": ["x" * 1000] * 16}),
    msgpack.packb({"v": 1, "id": 1, "op": "x" * 1024}),
    msgpack.packb({"v": 1, "id": "i" * 1024, "op": "hello"}),
    msgpack.packb({"v": "v" * 1024, "id": 1, "op": "hello"}),
    msgpack.packb({"v": 1, "id": 1, "op": "hello", "é" * 500: 1}),
    msgpack.packb({"v": 1, "id": 1, "op": "hello", "pad": "x" * 1025}),
    msgpack.packb({str(number): number for number in range(65)}),
    b"\xc6\xff\xff\xff\xff" + bytes(1000),
    b"\xdb\xff\xff\xff\xff" + bytes(1000),
    b"\xc9\xff\xff\xff\xff\x05" + bytes(1000),
    b"\xd9\xff" + b"\xff" * 255,
    bytes(LONGEST_BYTES + 1),
    b"\x80" * (LONGEST_BYTES + 1),
    msgpack.packb({"v": 1, "pad": [b"x" * 1000] * 20}),
)
"""Messages made to take long, or much memory, or to lie about their length; each at most a little too large."""
