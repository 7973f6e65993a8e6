from __future__ import annotations

import io
import os
from collections.abc import Iterator
from typing import IO

import pytest


@pytest.fixture
def person(monkeypatch: pytest.MonkeyPatch) -> Iterator[IO[str]]:
    """What somebody at the standard input types into; each line arrives at once."""
    read, write = os.pipe()
    with io.open(read) as stdin, io.open(write, "w", buffering=1) as typed:  # noqa: UP020 - sys.stdin is a file of io
        monkeypatch.setattr("sys.stdin", stdin)
        yield typed
