"""What links reported: bytes received, and when they went up and down."""

from __future__ import annotations

from slipd.events import Bytes, Event, LinkDown, LinkUp


def received(events: list[Event], link: str = "left.wrench") -> bytes:
    """Return all bytes of a link."""
    return b"".join(event.data for event in events if isinstance(event, Bytes) and event.link == link)


def ups(events: list[Event]) -> int:
    """Return how often a link went up."""
    return sum(isinstance(event, LinkUp) for event in events)


def downs(events: list[Event]) -> list[str]:
    """Return why links went down."""
    return [event.reason for event in events if isinstance(event, LinkDown)]
