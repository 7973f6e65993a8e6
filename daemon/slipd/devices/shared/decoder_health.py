"""Counters of a decoder, which show a bad line early."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class DecoderHealth:
    """Counts and findings of a decoder since it was made; the counters only rise.

    Attributes:
        good: Readings returned.
        bad: Invalid stream, in frames.
        lost: Readings that are missing according to the device's own sequence numbers.
        bad_bytes: Bytes that belong to no valid frame.
        duplicates: Readings that were repeated, or came after a newer one; they are dropped.
        restarts: Times that the device's own sequence numbers started again.
        note: For people: how the bytes are interpreted, or why they give no readings; "" if there is nothing to say.
        warning: What is wrong with the device although its readings count; "" if nothing is.
    """

    good: int = 0
    bad: int = 0
    lost: int = 0
    bad_bytes: int = 0
    duplicates: int = 0
    restarts: int = 0
    note: str = ""
    warning: str = ""
