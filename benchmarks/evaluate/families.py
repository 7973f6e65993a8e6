"""The families of grasps: each is a seeded random draw of object, contact, friction, loads and noise.

Seeds of `DEVELOPMENT` are for everyone who tunes slipd. Those of `EVALUATION` are for the report alone: whoever looks
at single runs of them, or tunes on them, spoils the figures.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from evaluate import loads_that_hold, loads_that_slip
from evaluate.draw import Random
from evaluate.scene import Scene

DEVELOPMENT = range(100_000)
EVALUATION = range(1_000_000, 1_100_000)

FAMILIES: dict[str, Callable[[Random], Scene]] = {
    "hold": loads_that_hold.hold,
    "lift": loads_that_hold.lift,
    "shake": loads_that_hold.shake,
    "vibrate": loads_that_hold.vibrate,
    "collide": loads_that_hold.collide,
    "tighten": loads_that_hold.tighten,
    "set down": loads_that_hold.set_down,
    "grip closes": loads_that_hold.grip_closes,
    "pull released": loads_that_hold.pull_released,
    "swing": loads_that_hold.swing,
    "micro-slip": loads_that_hold.micro_slip,
    "actuation noise": loads_that_hold.actuation_noise,
    "change of grip": loads_that_hold.change_of_grip,
    "change of load": loads_that_hold.change_of_load,
    "ramp": loads_that_slip.ramp,
    "pour": loads_that_slip.pour,
    "torsion": loads_that_slip.torsion,
    "combined": loads_that_slip.combined_ramp,
    "loosen": loads_that_slip.loosen,
    "edge": loads_that_slip.edge,
    "few taxels": loads_that_slip.few_taxels,
    "far pole": loads_that_slip.far_pole,
    "partial slip": loads_that_slip.partial_slip,
    "creep": loads_that_slip.creep,
    "flat creep": loads_that_slip.flat_creep,
    "sudden weight": loads_that_slip.sudden_weight,
    "wet patch": loads_that_slip.wet_patch,
    "second slip": loads_that_slip.second_slip,
}

PERTURBATIONS = ("actuation noise", "change of grip", "change of load")
"""The classes of the CEA benchmark."""


def draw(family: str, seed: int) -> Scene:
    """Draw a grasp of a family; in grasps that hold, the contact of every second one moves with the object.

    Raises:
        KeyError: There is no such family.
    """
    scene = FAMILIES[family](np.random.default_rng((zlib.crc32(family.encode()), seed)))
    if seed % 2 and scene.kind != "slips":
        return replace(scene, patch=replace(scene.patch, moves_with_object=True))
    return scene
