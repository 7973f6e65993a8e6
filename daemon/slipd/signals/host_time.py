"""Times of readings that another process on this host states by CLOCK_MONOTONIC."""

from __future__ import annotations

OLDEST_HOST_NS = 10_000_000_000
"""Oldest time that another process may state: the longest wait of a reading for a stalled loop."""


def host_time(device_time_ns: int | None, receipt_ns: int) -> tuple[int, bool]:
    """Return the time of acquisition of a reading whose clock is the host's CLOCK_MONOTONIC.

    Returns:
        The stated time and True; the receipt and False if no time is stated, or one in the future or older than
        ``OLDEST_HOST_NS``.
    """
    if device_time_ns is not None and 0 <= receipt_ns - device_time_ns <= OLDEST_HOST_NS:
        return device_time_ns, True
    return receipt_ns, False
