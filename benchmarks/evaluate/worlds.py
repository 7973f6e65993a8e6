"""Simulated worlds of the evaluation: the product's simulator, and one of other physics on which nothing is tuned."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from evaluate import families, playing
from evaluate.truth import Truth
from second_world import rubber_scene, rubber_trace


class World(NamedTuple):
    """How a world draws a scene of a family and a seed, plays it, and reports the truth of the trace."""

    draw: Callable[[str, int], Any]
    play: Callable[[Any], Any]
    truth_of: Callable[[Any, Any], Truth]


WORLDS = {
    "first": World(families.draw, playing.play, playing.truth_of),
    "second": World(rubber_scene.draw, rubber_trace.play, rubber_trace.truth_of),
}
