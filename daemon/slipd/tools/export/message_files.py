"""What the formats of an export have in common."""

from __future__ import annotations

from typing import Any, Protocol

Body = dict[str, Any]


class MessageFiles(Protocol):
    """Files of one export, while they are written."""

    def write(self, log_ns: int, topic: str, body: Body) -> None:
        """Write a message of slipd that was published at ``log_ns``, ns since 1970."""

    def finish(self) -> None:
        """Complete the files and close them."""

    def close(self) -> None:
        """Close the files as they are; does nothing after `finish`."""
