"""Pads in millimetres or kilometres, forces in µN or MN: the same contact in other units must get the same answer."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from bench.tables import Table
from chart.scenes import Scene, draw

from slipd.fusion import torque_limit, utilisation

SCENES, QUICK_SCENES = 15_000, 300
UNITS = (2.0**-10, 2.0**10, 1e-3, 1e3), (2.0**-20, 2.0**20, 1e-6, 1e6)
"""Of lengths and of forces. Powers of two round nothing, so no digit may change; the others round what they scale."""

WELL_INSIDE = 0.99
"""ρ up to which what rounding of the input does to the torque stays rounding."""

BEYOND = 1.5
U = 2.0**-53


def run(*, quick: bool = False) -> Table:
    """Asks every scene in every unit."""
    head = ("lengths times", "forces times", "scenes", "torque differs", "utilisation differs", "verdicts differ")
    table = Table("Friction limit: other units", head)
    scenes = list(_cases(QUICK_SCENES if quick else SCENES))
    plain = [_answers(scene, spin) for scene, spin in scenes]
    lengths, forces = UNITS
    for length, force in (*((length, 1.0) for length in lengths), *((1.0, force) for force in forces)):
        torque = use = 0.0
        verdicts = 0
        for (scene, spin), (limit, value) in zip(scenes, plain, strict=True):
            found_limit, found_value = _answers(*_scaled(scene, spin, length, force))
            rounded = 0.0 if _is_binary(length * force) else _rounding(scene)
            torque = max(torque, abs(found_limit / (length * force) - limit) / scene.torque_scale_nm - rounded)
            use = max(use, abs(found_value / value - 1.0) - rounded)
            verdicts += (found_value <= 1.0) != (value <= 1.0)
        table.rows.append((f"{length:g}", f"{force:g}", len(scenes), f"{torque:.1e}", f"{use:.1e}", verdicts))
    table.notes.append(
        f"Greatest difference of the torque limit, of the contact's own torque, and of the utilisation, of itself, on "
        f"scenes of all families with ρ ≤ {WELL_INSIDE:g}. Powers of two must change nothing; decimal factors round "
        "the input, and only differences beyond that effect are shown."
    )
    return table


def _cases(count: int) -> Iterator[tuple[Scene, float]]:
    """Scenes with a spin up to half beyond the limit."""
    rng = np.random.default_rng(count)
    for seed in range(count):
        scene = draw(seed)
        ratio = np.hypot(*scene.tangential) / (scene.mu * scene.loads.sum())
        if ratio <= WELL_INSIDE and scene.torque_scale_nm > 0.0:
            yield scene, rng.uniform(-BEYOND, BEYOND) * scene.torque_scale_nm


def _is_binary(factor: float) -> bool:
    return math.frexp(factor)[0] == 0.5


def _rounding(scene: Scene) -> float:
    """What half a unit in the last place of every input can do to either answer.

    Places and the point of reference move every lever by that of the farthest, against the contact's own torque; loads
    and force change the answer by some tens of it, for the pole is not far inside the friction circle.
    """
    reach = max(float(np.abs(places).max()) for places in (scene.x, scene.y, scene.about))
    return U * (8.0 * scene.mu * float(scene.loads.sum()) * reach / scene.torque_scale_nm + 64.0)


def _answers(scene: Scene, spin: float) -> tuple[float, float]:
    limit = torque_limit(scene.x, scene.y, scene.loads, scene.mu, scene.tangential, scene.about)
    used = utilisation(scene.x, scene.y, scene.loads, scene.mu, scene.tangential, spin, scene.about)
    return limit.torque_nm, used.value


def _scaled(scene: Scene, spin: float, length: float, force: float) -> tuple[Scene, float]:
    scaled = replace(
        scene,
        x=scene.x * length,
        y=scene.y * length,
        loads=scene.loads * force,
        tangential=scene.tangential * force,
        about=scene.about * length,
    )
    return scaled, spin * length * force
