"""Search for contacts on which a method fails, with differential evolution.

A contact is drawn from genes in [0, 1], and differential evolution maximises what goes wrong on it. Worlds differ in
what their genes may do: lengths, loads and distances run over decades, since that is where methods break. The right
answer is ours where its own bounds vouch for it, and the reference where they do not; ours itself is searched for wide
bounds, for bounds that miss the reference, and for what utilisation makes of a load on the limit.

    PYTHONPATH=tests/support:tests/lab python -m chart.adversarial hybr lm --world pole --seed 3

prints the worst finds as rows for ``chart.finds``, in as few digits as keep them bad.
"""

from __future__ import annotations

import argparse
import math
import warnings
from collections.abc import Callable, Sequence

import numpy as np
from chart.methods import METHODS, Method, ask, find
from chart.reference import exact_limit
from chart.scenes import MU, PITCH_M, Array, Scene, turning_about
from scipy.optimize import differential_evolution

from slipd.fusion import torque_limit, utilisation
from slipd.fusion.limit.solve import MAX_PASSES

TAXELS = 4
"""Unless said otherwise: few are enough for every failure known, and can be read."""

FORCE_GENES = 3

POPULATION, GENERATIONS = 4, 30
"""Scenes a gene, and generations: about two thousand scenes a search."""

VOUCHED = 1e-9
"""Of the torque scale: bounds of ours that are closer than this stand for the right answer."""

UNLIKELY = 1e-18
"""Added to errors before their logarithm."""

DIGITS = (2, 3, 4, 6, 9, 17)

Genes = Array
World = Callable[[Genes], Scene]
Badness = Callable[[Scene], float]


def _taxels(genes: Genes, decades: float) -> tuple[Array, Array, Array]:
    """Positions within ±3 pitches, loads over so many decades; the genes left over are the force's."""
    x, y, load = genes[:-FORCE_GENES].reshape(3, -1)
    return 6.0 * PITCH_M * (x - 0.5), 6.0 * PITCH_M * (y - 0.5), 10.0 ** (decades * (load - 1.0))


def _forced(name: str, x: Array, y: Array, loads: Array, missing: float, turn: float) -> Scene:
    """Under a force with 1 − ρ = missing, in the direction turn · 2π."""
    size, angle = (1.0 - missing) * MU * math.fsum(loads), 2.0 * math.pi * turn
    about = np.array((loads @ x, loads @ y)) / loads.sum()
    return Scene(name, x, y, loads, MU, size * np.array((math.cos(angle), math.sin(angle))), about)


def plain(genes: Genes) -> Scene:
    """Nothing extreme: loads within a decade, ρ up to 0.9."""
    return _forced("plain", *_taxels(genes, 1.0), missing=1.0 - 0.9 * genes[-1], turn=genes[-2])


def whole(genes: Genes) -> Scene:
    """Small whole numbers: where coincidences are."""
    x, y, load = np.floor(genes[:-FORCE_GENES].reshape(3, -1) * 5.0).clip(0.0, 4.0)
    fx, fy = np.round(genes[-2:] * 8.0 - 4.0) / 4.0
    loads = 1.0 + load
    about = np.array((loads @ x, loads @ y)) / loads.sum()
    return Scene("whole", x * PITCH_M, y * PITCH_M, loads, MU, np.array((fx, fy)), about * PITCH_M)


def pole(genes: Genes) -> Scene:
    """The pole 1 to 1e-14 pitches beside a taxel, loads within two decades."""
    x, y, loads = _taxels(genes, 2.0)
    angle, distance = 2.0 * math.pi * genes[-2], PITCH_M * 10.0 ** (-14.0 * genes[-1])
    return turning_about(
        "pole", x, y, loads, np.array((x[0] + distance * math.cos(angle), y[0] + distance * math.sin(angle)))
    )


def far(genes: Genes) -> Scene:
    """1 − ρ from 1 to 1e-14, loads within two decades."""
    return _forced("far", *_taxels(genes, 2.0), missing=10.0 ** (-14.0 * genes[-1]), turn=genes[-2])


def decades(genes: Genes) -> Scene:
    """Loads over twelve decades, and 1 − ρ as well."""
    return _forced("decades", *_taxels(genes, 12.0), missing=10.0 ** (-12.0 * genes[-1]), turn=genes[-2])


def thin(genes: Genes) -> Scene:
    """All but a line, along x: width 1 to 1e-12, a force anywhere."""
    x, y, loads = _taxels(genes, 1.0)
    return _forced(
        "thin", x, y * 10.0 ** (-12.0 * genes[-3]), loads, missing=10.0 ** (-3.0 * genes[-1]), turn=genes[-2]
    )


def apart(genes: Genes) -> Scene:
    """Clusters in clusters: from taxel to taxel nearer to the origin by the same factor, down to 1e-12 in all."""
    x, y, loads = _taxels(genes, 3.0)
    near = 10.0 ** (-12.0 * genes[-3] * np.linspace(0.0, 1.0, x.size))
    return _forced("apart", x * near, y * near, loads, missing=10.0 ** (-6.0 * genes[-1]), turn=genes[-2])


WORLDS: dict[str, World] = {w.__name__: w for w in (plain, whole, pole, far, decades, thin, apart)}


def error_of(method: Method) -> Badness:
    """The error of its limit beyond the bounds of what is right, of the torque scale; 0 where it says it failed."""

    def badness(scene: Scene) -> float:
        ours = _ours(scene)
        lower, upper = ours.lower_nm, ours.upper_nm
        if not upper - lower <= VOUCHED * scene.torque_scale_nm:
            lower = upper = exact_limit(scene)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = ask(method, scene)[0]
        return max(lower - found, found - upper, 0.0) / scene.torque_scale_nm if math.isfinite(found) else 0.0

    return badness


def refusal_of(method: Method) -> Badness:
    """1 where it gives no answer, or raises."""

    def badness(scene: Scene) -> float:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return float(ask(method, scene)[1] != "")

    return badness


def gap(scene: Scene) -> float:
    """Distance of ours' bounds, of the torque scale."""
    found = _ours(scene)
    return (found.upper_nm - found.lower_nm) / scene.torque_scale_nm


def passes(scene: Scene) -> float:
    """How many passes ours takes until its bounds vouch for the answer; one more than the most where they never do."""
    fewest, enough = 0, MAX_PASSES + 1
    while enough - fewest > 1:
        tried = (fewest + enough) // 2
        found = torque_limit(scene.x, scene.y, scene.loads, scene.mu, scene.tangential, scene.about, passes=tried)
        if found.upper_nm - found.lower_nm <= VOUCHED * scene.torque_scale_nm:
            enough = tried
        else:
            fewest = tried
    return float(enough)


def missed(scene: Scene) -> float:
    """How far the reference lies outside ours' bounds, of the torque scale."""
    found, right = _ours(scene), exact_limit(scene)
    return max(found.lower_nm - right, right - found.upper_nm, 0.0) / scene.torque_scale_nm


def utilisation_gap(scene: Scene) -> float:
    """Distance of the bounds of the utilisation of the force and half the torque that it leaves."""
    used = _used(scene, 0.5 * _ours(scene).torque_nm)
    return used.upper - used.lower


def utilisation_missed(scene: Scene) -> float:
    """How far 1 lies outside the utilisation's bounds for a load on the limit, beyond what the limit's bounds leave."""
    found = _ours(scene)
    low, high = _used(scene, found.lower_nm), _used(scene, found.upper_nm)
    return max(low.lower - 1.0, 1.0 - high.upper, 0.0)


OURS: dict[str, Badness] = {f.__name__: f for f in (gap, passes, missed, utilisation_gap, utilisation_missed)}


def _ours(scene: Scene):
    return torque_limit(scene.x, scene.y, scene.loads, scene.mu, scene.tangential, scene.about)


def _used(scene: Scene, spin: float):
    return utilisation(scene.x, scene.y, scene.loads, scene.mu, scene.tangential, spin, scene.about)


def possible(scene: Scene) -> bool:
    """Whether there is a limit, and a torque to measure errors by."""
    inside = math.hypot(*scene.tangential) < scene.mu * math.fsum(scene.loads)
    return inside and scene.torque_scale_nm > 1e-15 * scene.mu * math.fsum(scene.loads) * PITCH_M


def search(
    badness: Badness, world: World, seed: int, generations: int = GENERATIONS, taxels: int = TAXELS
) -> tuple[float, Scene]:
    """The worst contact found, in as few digits as leave it within a factor 2 as bad, and how bad that is."""

    def cost(genes: Genes) -> float:
        scene = world(genes)
        return -math.log10(badness(scene) + UNLIKELY) if possible(scene) else -math.log10(UNLIKELY)

    genes = [(0.0, 1.0)] * (3 * taxels + FORCE_GENES)
    found = differential_evolution(
        cost, genes, maxiter=generations, popsize=POPULATION, tol=0.0, polish=False, seed=seed
    )
    return shortened(badness, world(found.x))


def shortened(badness: Badness, scene: Scene) -> tuple[float, Scene]:
    """The scene with the fewest digits that is still within a factor 2 as bad."""
    bad = badness(scene)
    for digits in DIGITS:
        short = _rounded(scene, digits)
        if possible(short) and (now := badness(short)) >= 0.5 * bad:
            return now, short
    return bad, scene


def _rounded(scene: Scene, digits: int) -> Scene:
    x, y, loads, force = (
        np.array([float(f"{value:.{digits - 1}e}") for value in array])
        for array in (scene.x, scene.y, scene.loads, scene.tangential)
    )
    about = np.array((loads @ x, loads @ y)) / loads.sum()
    return Scene(scene.family, x, y, loads, scene.mu, force, about)


def as_row(what: str, bad: float, scene: Scene) -> str:
    """The find as a line of ``chart.finds``."""
    x, y, loads, force = (a.tolist() for a in (scene.x, scene.y, scene.loads, scene.tangential))
    told = f'found("{what}: {scene.family}", "", {x}, {y}, {loads}, {tuple(force)}, {exact_limit(scene)!r}),'
    return f"{told}  # {bad:.2e}"


def main(arguments: Sequence[str] | None = None) -> None:
    """Search and print."""
    names = [method.short for method in METHODS]
    parser = argparse.ArgumentParser(description="Search for contacts that make a method fail.")
    parser.add_argument("what", nargs="*", default=names, help=f"of {', '.join((*names, *OURS))}")
    parser.add_argument("--world", action="append", choices=list(WORLDS), help="default: all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--generations", type=int, default=GENERATIONS)
    parser.add_argument("--taxels", type=int, default=TAXELS)
    parser.add_argument("--refused", action="store_true", help="contacts without an answer, not with a wrong one")
    options = parser.parse_args(arguments)
    for what in options.what:
        for world in options.world or WORLDS:
            badness = OURS[what] if what in OURS else (refusal_of if options.refused else error_of)(find(what))
            bad, scene = search(badness, WORLDS[world], options.seed, options.generations, options.taxels)
            print(as_row(what, bad, scene) if bad > 0.0 else f"# {what}: {world}: nothing", flush=True)


if __name__ == "__main__":
    main()
