"""Which recordings an evaluation takes: files, all of a folder, or one machine's share of them."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from slipd.errors import SlipdError


class Shard(NamedTuple):
    """One of several shares of the recordings, counted from 1."""

    number: int
    of: int

    @classmethod
    def parse(cls, text: str) -> Shard:
        """Return the share of a text such as ``2/8``.

        Raises:
            ValueError: It is no such text.
        """
        found = re.fullmatch(r"(\d{1,9})/(\d{1,9})", text)
        if found is None or not 1 <= int(found[1]) <= int(found[2]):
            raise ValueError(f"a shard is I/N with I from 1 to N, for example 2/8, got {text!r}")
        return cls(int(found[1]), int(found[2]))


EVERY = Shard(1, 1)
"""All recordings."""


def chosen(paths: Iterable[Path], shard: Shard = EVERY) -> list[Path]:
    """Return the recordings that are named, each once; of a folder all ``*.mcap`` in and below it, by name.

    The shards of the same recordings share none, and together they are all of them.

    Raises:
        SlipdError: A folder has no recording.
    """
    found: dict[Path, None] = {}
    for path in paths:
        if path.is_dir():
            inside = sorted(path.rglob("*.mcap"))
            if not inside:
                raise SlipdError(f"{path}: no recording (*.mcap) in this folder")
            found |= dict.fromkeys(inside)
        else:
            found[path] = None
    return list(found)[shard.number - 1 :: shard.of]
