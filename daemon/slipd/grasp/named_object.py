"""The name of the object that is gripped, or about to be, as clients state it."""

from __future__ import annotations


class NamedObject:
    """Keeps the name, for which friction is learned.

    Attributes:
        name: Name of the object; None: none is named.
        set_by: Client that named it, or took its name back; None: no client of this run did.
        set_t_ns: When that client did, CLOCK_MONOTONIC; None likewise.
    """

    def __init__(self) -> None:
        self.name: str | None = None
        self.set_by: str | None = None
        self.set_t_ns: int | None = None

    def set(self, name: str | None, by: str, t_ns: int) -> None:
        """Use the name that a client states, for every finger and the rest of the run."""
        self.name, self.set_by, self.set_t_ns = name, by, t_ns
