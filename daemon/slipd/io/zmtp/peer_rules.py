"""Limits that an endpoint sets for each of its peers."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PeerRules:
    """Limits for each peer of an endpoint.

    Attributes:
        kind: Socket type of the endpoint, as ZeroMQ names it.
        serves: Socket types that may connect.
        max_bytes: Longest frame, bytes.
        max_frames: Frames kept of one message; of a longer one, ``max_frames + 1`` are passed on, which shows its
            length.
        most_queued: Messages queued for a peer that does not read.
        drops_oldest: A full queue drops its oldest message, not the new one.
        messages_per_wake: Messages passed on before other tasks of the loop run.
    """

    kind: bytes
    serves: frozenset[bytes]
    max_bytes: int
    max_frames: int = 1
    most_queued: int = 0
    drops_oldest: bool = False
    messages_per_wake: int = 16
