"""One word for what the grasp does with the object: held, slipping, lost, empty, or unknown.

A parallel gripper holds an object only while both pads press on it. So one pad that is known to be free is enough to
know that nothing is held; that both press must be known of both.
"""

from __future__ import annotations

from typing import Literal

HoldWord = Literal["empty", "held", "slipping", "lost", "unknown"]


class HoldState:
    """Follows a grasp from the levels of its two fingers.

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

    def update(self, levels: tuple[str, str], *, releasing: bool, t_ns: int) -> bool:
        """Update with what is known at ``t_ns``; return whether the word changed.

        Args:
            levels: Levels of both fingers.
            releasing: A release was commanded and is not confirmed yet.
            t_ns: Now.
        """
        word = self._next(levels, releasing=releasing)
        changed = word != self.word or not self.since_ns
        if changed:
            if word == "lost":
                self._lost_ns = self._lost_ns or t_ns
            self.word, self.since_ns = word, self._lost_ns if word == "lost" else t_ns
        return changed

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
