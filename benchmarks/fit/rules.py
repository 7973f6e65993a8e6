"""The sources of evidence and the rules of slip, each with values of constants at which it never decides."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from math import inf
from types import ModuleType

LOAD: dict[str, Mapping[str, float]] = {
    "source: falls": {"load_drop.RECENT_S": -1.0},
    "source: slow falls": {"slow_fall.MOST_DROP": -inf},
    "source: jumps and overshoots": {"load_jump.BRIEF_S": -1.0},
    "fall: measured noise": {"load_blocks.SECOND": 0.0},
    "fall: coloured noise": {"load_blocks.ROUGH": 0.0},
    "fall: clip of the noise": {"load_blocks.STDS": inf},
    "fall: closing grip": {"load_blocks.CHANGES": inf},
    "aside": {"load_blocks.MOSTLY": inf},
    "tighter": {"load_blocks.TIGHTER": inf},
    "swings before": {"slide.SWINGS": 0.0},
    "carried": {"load_drop.NEAR": 0.0, "slow_fall.NEAR": 0.0},
    "fall: most": {"slide.MOST_DROP": inf},
    "fall: longer where odd": {"load_drop.ODD": 0.0},
    "fall: flat": {"load_drop.FLAT": inf},
    "fall: slight": {"load_drop.SLIGHT": inf},
    "fall: push": {"load_drop.BACK": inf},
    "fall: rise": {"load_drop.LEAST_RISE": -inf},
    "fall: long rise": {"load_drop.SHALLOW": 0.0},
    "fall: short rise": {"load_drop.SHALLOW": 1.0},
    "slow: slows down": {"slow_fall.SLOWER": inf},
    "slow: deep ones slower": {"slow_fall.SHALLOW": 1.0},
    "slow: noise of the rate": {"slow_fall.RATE_STDS": 0.0},
    "slow: swings back": {"slow_fall.BACK": inf},
    "slow: near the limit": {"slow_fall.FROM": 0.0},
    "slow: near the top": {"slow_fall.NEAR_TOP": 0.0},
    "slow: rise": {"slow_fall.LEAST_RISE": 0.0},
    "slow: steady": {"slow_fall.STEADY": -inf},
    "slow: push": {"slow_fall.PUSH": inf},
    "jump: rise": {"load_jump.JUMPED": 0.0},
    "jump: slight": {"load_jump.SLIGHT": inf},
    "jump: scatter": {"load_jump.SCATTER": inf},
    "jump: beyond": {"load_jump.NEAR": 1.0},
    "jump: loosened": {"load_jump.MOSTLY": inf},
    "jump: near the limit": {"load_jump.FROM": 0.0},
    "slide: settles and follows": {"slide.SETTLES_S": 0.0},
    "slide: ends by the load": {"slide.CHANGES": inf},
    "slide: noise of its end": {"slide.STDS": 0.0},
}  # fmt: skip
"""Of the load of a contact, in `slipd.fusion`; a constant that several files use is replaced in the one named."""
IMAGE: dict[str, Mapping[str, object]] = {
    "source: image, fitted": {"motion.image_fit.MOST_TILT": -1.0},
    "source: image and centroid": {"motion.image_fit.SURE_SHARE": inf},
    "kinds together": {"motion.evidence.TOGETHER_NS": -1},
    "image: slight forces": {"motion.image_blocks.SLIGHT_SHARE": inf},
    "image: same load": {"motion.evidence.SAME_SHARE": inf},
    "image: same centroid": {"motion.image_blocks.SAME_CENTROID_M": inf},
    "motion: lasts": {"motion.evidence.LASTS_NS": 0},
    "image: tilt, opening gap": {"motion.image_fit.MOST_TILT": inf},
    "image: along the load": {"motion.image_shift.ALONG": -inf},
    "image: each surprise": {"motion.shift_path.EACH_SURPRISE": -inf},
    "image: least noise": {"motion.evidence.LEAST_STD_M": 1e-9},
    "centroid: least share": {"motion.image_fit.LEAST_SHARE": 0.0},
    "centroid: sure share": {"motion.image_fit.SURE_SHARE": 0.0},
    "image, centroid: noise": {"fusion.level_hysteresis.CERTAIN_STDS": 0.0},
}
"""Of the image before a force sensor and of the high band, in `slipd.motion`."""


@contextmanager
def replaced(values: Mapping[str, object]) -> Iterator[None]:
    """Replace constants wherever they are used; compiled code keeps those with which it was compiled.

    Raises:
        AttributeError: There is no such constant.
    """
    undo: list[tuple[ModuleType, str, object]] = []
    for path, value in values.items():
        where, name = f"slipd.{path}".rsplit(".", 1)
        old = getattr(importlib.import_module(where), name)
        for key, module in list(sys.modules.items()):
            if key.startswith("slipd.") and vars(module).get(name) is old:
                undo.append((module, name, old))
                setattr(module, name, value)
    yield
    for module, name, old in undo:
        setattr(module, name, old)
