"""What the `status` messages of a run say about its streams."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class StreamHealth:
    """One stream over a run, as of its last `status` message.

    Attributes:
        stream: Its name, for example ``left.wrench``.
        health: The worst health that a `status` message stated since the first reading, because every stream begins as
            STALE; the last one where no reading came. 0 OK, 1 WARN, 2 ERROR, 3 STALE.
        samples: Readings.
        bad: Damaged frames.
        lost: Readings that are missing by the device's own numbering.
        dropped: Readings that were dropped because the device sent too many.
        reconnects: Times that the link came up again.
    """

    stream: str
    health: int
    samples: int
    bad: int
    lost: int
    dropped: int
    reconnects: int


def with_status(found: Mapping[str, StreamHealth], body: Mapping[str, Any]) -> dict[str, StreamHealth]:
    """Return the health of every stream after another `status` message, by name."""
    return {
        name: StreamHealth(
            name,
            max(stream["health"], found[name].health if name in found and found[name].samples else 0),
            *(stream[count] or 0 for count in ("samples", "bad", "lost", "dropped", "reconnects")),
        )
        for name, stream in body["streams"].items()
    }
