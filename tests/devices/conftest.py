"""What every decoder's tests share: the same stream, split in every way."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

SplitCheck = Callable[[Callable[[], Any], bytes], list[tuple[Any, ...]]]


def plain(sample: Any) -> tuple[Any, ...]:
    """Return a sample's content as a value that can be compared."""
    fields = (getattr(sample, name) for name in sample.__slots__)
    return tuple(field.tolist() if hasattr(field, "tolist") else field for field in fields)


def outcome(make: Callable[[], Any], pieces: list[bytes]) -> tuple[list[tuple[Any, ...]], Any]:
    decoder = make()
    samples = [plain(sample) for piece in pieces for sample in decoder.receive(piece, 0)]
    return samples, decoder.health


@pytest.fixture
def same_for_every_split() -> SplitCheck:
    """Check that a stream gives the same samples and counters whole, cut at any byte, and byte by byte."""

    def check(make: Callable[[], Any], stream: bytes) -> list[tuple[Any, ...]]:
        whole = outcome(make, [stream])
        for at in range(1, len(stream)):
            assert outcome(make, [stream[:at], stream[at:]]) == whole, f"cut at {at}"
        for size in (1, 2, 3, 7, 36, 38):
            pieces = [stream[at : at + size] for at in range(0, len(stream), size)]
            assert outcome(make, pieces) == whole, f"in pieces of {size}"
        return whole[0]

    return check
