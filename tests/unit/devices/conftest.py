"""Fixtures of the decoders' tests: one stream split in every way, and frames damaged on the line."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from typing import Any

import pytest

SplitCheck = Callable[..., list[tuple[Any, ...]]]
Damage = Callable[..., Iterator[bytes]]


def plain(sample: Any) -> tuple[Any, ...]:
    """Return the content of a sample as a comparable value."""
    fields = (getattr(sample, name) for name in sample.__slots__)
    return tuple(field.tolist() if hasattr(field, "tolist") else field for field in fields)


def outcome(make: Callable[[], Any], pieces: list[bytes]) -> tuple[list[tuple[Any, ...]], Any]:
    decoder = make()
    samples = [plain(sample) for piece in pieces for sample in decoder.receive(piece, 0)]
    return samples, decoder.health


@pytest.fixture
def same_for_every_split() -> SplitCheck:
    """Check that a stream gives the same samples and counts whole, cut at any byte, and in small pieces.

    A ``tail`` is appended to the stream, but not cut at every byte.
    """

    def check(make: Callable[[], Any], stream: bytes, tail: bytes = b"") -> list[tuple[Any, ...]]:
        cuts = range(1, len(stream))
        stream += tail
        whole = outcome(make, [stream])
        for at in cuts:
            assert outcome(make, [stream[:at], stream[at:]]) == whole, f"cut at {at}"
        for size in (1, 2, 3, 7, 36, 38):
            pieces = [stream[at : at + size] for at in range(0, len(stream), size)]
            assert outcome(make, pieces) == whole, f"in pieces of {size}"
        return whole[0]

    return check


@pytest.fixture
def damaged() -> Damage:
    """Yield copies of a frame, each with a bit flipped, a byte lost, or a byte added.

    With ``bursts`` some of them have three bytes overwritten instead, which weak checks often miss.
    """

    def copies(frame: bytes, count: int, *, bursts: bool = False) -> Iterator[bytes]:
        rng = random.Random(1)
        for _ in range(count):
            hit = bytearray(frame)
            at, kind = rng.randrange(len(hit)), rng.randrange(3 + bursts)
            if kind == 0:
                hit[at] ^= 1 << rng.randrange(8)
            elif kind == 1:
                del hit[at]
            elif kind == 2:
                hit.insert(at, rng.randrange(256))
            else:
                hit[at : at + 3] = rng.randbytes(len(hit[at : at + 3]))
            yield bytes(hit)

    return copies
