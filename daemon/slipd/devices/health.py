"""What a decoder counts, so that a bad line is seen before it matters."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class DecoderHealth:
    """What a decoder counts since it was made, and what it found out; the counters only rise.

    Attributes:
        good: Readings handed on.
        bad: Frames' worth of stream that was no valid frame.
        lost: Readings that the device's own numbering shows to be missing.
        bad_bytes: Bytes that belong to no valid frame.
        duplicates: Readings that came again, or after a newer one; they are not handed on.
        restarts: Times that the device's own numbering began anew.
        note: For people: how the bytes are read, or why they give no reading; "" for nothing.
    """

    good: int = 0
    bad: int = 0
    lost: int = 0
    bad_bytes: int = 0
    duplicates: int = 0
    restarts: int = 0
    note: str = ""
