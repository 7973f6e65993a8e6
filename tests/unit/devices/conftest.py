"""Fixture of the decoders' tests: one stream split in every way."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

SplitCheck = Callable[..., list[tuple[Any, ...]]]


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
