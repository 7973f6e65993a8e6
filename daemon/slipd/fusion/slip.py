"""Slip told by the drop of R from the static to the dynamic friction coefficient (paper, after eq. (4)).

R also falls when the grip is tightened, and the load falls when an object is set down. A drop counts as slip only when
the load itself gives way, quickly, and came from near the friction limit.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SlipSettings:
    """When a drop is a slip.

    Attributes:
        drop: Least relative fall of R and of the load, below the ratio of dynamic to static friction of most pairs.
        window_s: The fall happens within this time; setting an object down takes longer, s.
        armed_at: Least utilisation within the window: slip begins at 1, and the estimate of μ is a safe one.
        hold_s: A slip told stays told this long, s.
    """

    drop: float = 0.12
    window_s: float = 0.04
    armed_at: float = 0.7
    hold_s: float = 0.25


class SlipDetector:
    """Watches one load (the tangential force, or the spin) of one contact."""

    def __init__(self, settings: SlipSettings) -> None:
        self._settings = settings
        self._window: deque[tuple[float, float, float, float]] = deque()
        self._until_s = -math.inf

    def reset(self) -> None:
        """Forgets everything: the contact ended."""
        self._window.clear()
        self._until_s = -math.inf

    def update(self, t_s: float, load: float, normal_n: float, utilisation: float) -> bool:
        """Takes one reading.

        Args:
            t_s: Time of the reading, s, rising.
            load: |f_t| in N, or |m| in N·m.
            normal_n: f_n, N, positive.
            utilisation: λ of this reading; NaN where it is not known, which arms nothing.

        Returns:
            Whether the contact slips, or did within the last ``hold_s``.
        """
        settings, window = self._settings, self._window
        while window and window[0][0] < t_s - settings.window_s:
            window.popleft()
        kept = 1.0 - settings.drop
        ratio = load / normal_n
        if any(
            armed >= settings.armed_at and load <= kept * before and ratio <= kept * ratio_before
            for _, before, ratio_before, armed in window
        ):
            self._until_s = t_s + settings.hold_s
            window.clear()
        window.append((t_s, load, ratio, utilisation))
        return t_s < self._until_s
