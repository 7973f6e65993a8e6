"""What a grasp does with the object, and what the object is called."""

from __future__ import annotations

from typing import Literal

HoldWord = Literal["empty", "held", "slipping", "lost", "unknown"]


class HoldState:
    """Follows from the levels of both fingers what the grasp does with the object.

    A parallel gripper holds an object only while both pads press on it. So one pad that is known to be free is enough
    to know that nothing is held; that both press must be known of both.

    Attributes:
        word: The state at the last `update`.
        since_ns: When it began, CLOCK_MONOTONIC; 0 before the first `update`. A loss keeps its time over moments in
            which nothing is known.
    """

    def __init__(self) -> None:
        self.word: HoldWord = "unknown"
        self.since_ns = 0
        self._holding = False  # an object was held, and its end was not known since
        self._lost_ns = 0  # when it was lost; 0 while it was not
        self._releasing = False  # opening was commanded since the pads last pressed without

    def update(self, levels: tuple[str, str], *, releasing: bool, t_ns: int) -> None:
        """Update with what is known at ``t_ns``.

        Args:
            levels: Levels of both fingers.
            releasing: A release was commanded and is not confirmed yet.
            t_ns: Now.
        """
        word = self._next(levels, releasing=releasing)
        if word == self.word and self.since_ns:
            return
        if word == "lost":
            self._lost_ns = self._lost_ns or t_ns
        self.word, self.since_ns = word, self._lost_ns if word == "lost" else t_ns

    def _next(self, levels: tuple[str, str], *, releasing: bool) -> HoldWord:
        self._releasing = self._releasing or releasing
        if "no_contact" in levels:
            if self._holding and not self._releasing:
                return "lost"
            return "unknown" if "unknown" in levels else "empty"
        if "slipping" not in levels and "unknown" in levels:
            return "unknown"
        self._holding, self._releasing, self._lost_ns = True, releasing, 0
        return "slipping" if "slipping" in levels else "held"


class NamedObject:
    """Keeps the name of the object in the grip, as clients state it: friction is learned for each name.

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
