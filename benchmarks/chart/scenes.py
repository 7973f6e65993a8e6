"""Random contacts for every method: ordinary ones, and each family on which methods are known to fail.

A scene is what the friction limit is asked of. The families stand in one table, drawn from a seed: the chart, the
failure atlas, the long run over a million of them and the tests all draw from it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from slipd.types.arrays import Array

Random = np.random.Generator

MU = 0.5
ROWS, COLS, PITCH_M = 8, 16, 3.2e-3


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A contact and the force it carries.

    Attributes:
        family: Name of the family it was drawn from.
        x: Taxel centres, shape (n,), m.
        y: Likewise.
        loads: Normal forces, shape (n,), N.
        mu: Coefficient of friction.
        tangential: f_t, shape (2,), N.
        about: The point torques are taken about, shape (2,), m.
    """

    family: str
    x: Array
    y: Array
    loads: Array
    mu: float
    tangential: Array
    about: Array

    @property
    def torque_scale_nm(self) -> float:
        """μ Σ F_i |r_i − centroid|, the contact's own torque: between its limit without force and twice that, N·m."""
        dx, dy = self.x - self.x[self.loads.argmax()], self.y - self.y[self.loads.argmax()]
        share = self.loads / self.loads.sum()
        return float(self.mu * (self.loads @ np.hypot(dx - share @ dx, dy - share @ dy)))


def grid() -> tuple[Array, Array]:
    """Taxel centres of the 8 × 16 pad, each shape (128,), m."""
    row, col = np.divmod(np.arange(ROWS * COLS), COLS)
    return (col - (COLS - 1) / 2) * PITCH_M, (row - (ROWS - 1) / 2) * PITCH_M


def image(rng: Random) -> tuple[Array, Array, Array]:
    """A smooth patch on the pad, turned and cut off anywhere, with noisy gains; the active taxels only."""
    x, y = grid()
    angle, (a, b) = rng.uniform(0.0, math.pi), rng.uniform(1.5, 9.0, 2) * PITCH_M
    dx, dy = x - rng.uniform(-0.02, 0.02), y - rng.uniform(-0.01, 0.01)
    u, v = math.cos(angle) * dx + math.sin(angle) * dy, math.cos(angle) * dy - math.sin(angle) * dx
    pressure = np.maximum(1.0 - (u / a) ** 2 - (v / b) ** 2, 0.0) ** rng.choice((0.0, 0.5, 1.0))
    pressure[(u / a) ** 2 + (v / b) ** 2 >= 1.0] = 0.0
    pressure[rng.integers(pressure.size)] += 0.1  # never empty
    on = pressure > 0.0
    loads = pressure[on] * rng.normal(1.0, 0.05, int(on.sum())).clip(0.5)
    return x[on], y[on], loads * rng.uniform(1.0, 40.0) / loads.sum()


def sparse(rng: Random, least: int = 2, most: int = 40) -> tuple[Array, Array, Array]:
    """Some taxels of the pad, loads within two decades."""
    x, y = grid()
    taxels = rng.choice(x.size, int(rng.integers(least, most)), replace=False)
    return x[taxels], y[taxels], 10.0 ** rng.uniform(-1.0, 1.0, taxels.size)


def scene(family: str, rng: Random, x: Array, y: Array, loads: Array, ratio: float) -> Scene:
    """A scene whose force is ``ratio`` of the friction circle, in a random direction, about the load centroid."""
    angle = rng.uniform(0.0, 2.0 * math.pi)
    size = ratio * MU * math.fsum(loads)
    about = np.array((loads @ x, loads @ y)) / loads.sum()
    return Scene(family, x, y, loads, MU, size * np.array((math.cos(angle), math.sin(angle))), about)


def turning_about(family: str, x: Array, y: Array, loads: Array, pole: Array) -> Scene:
    """A scene whose pole is known: f_t is the sum of the friction of a turn about it (a taxel there gives nothing)."""
    dx, dy = x - pole[0], y - pole[1]
    distance = np.hypot(dx, dy)
    pull = MU * loads / np.where(distance > 0.0, distance, np.inf)
    about = np.array((loads @ x, loads @ y)) / loads.sum()
    return Scene(family, x, y, loads, MU, np.array((-(pull @ dy), pull @ dx)), about)


def ordinary(rng: Random) -> Scene:
    """A patch under a force anywhere in the friction circle."""
    return scene("ordinary", rng, *image(rng), ratio=math.sqrt(rng.random()))


def few_taxels(rng: Random) -> Scene:
    return scene("few taxels", rng, *sparse(rng, 2, 7), ratio=rng.random())


def no_force(rng: Random) -> Scene:
    return scene("no force", rng, *(image(rng) if rng.random() < 0.5 else sparse(rng)), ratio=0.0)


def hinge(rng: Random) -> Scene:
    """The pole is a taxel, well inside what that taxel can take or at the verge of it."""
    x, y, loads = sparse(rng, 3)
    taxel = int(rng.integers(x.size))
    found = turning_about("hinge", x, y, loads, np.array((x[taxel], y[taxel])))
    angle, share = rng.uniform(0.0, 2.0 * math.pi), rng.choice((0.0, 0.5, 0.999, 1.0))
    own = share * MU * loads[taxel] * np.array((math.cos(angle), math.sin(angle)))
    return Scene("hinge", x, y, loads, MU, found.tangential + own, found.about)


def beside_a_taxel(rng: Random) -> Scene:
    """The pole lies 10⁻¹ to 10⁻¹² of a pitch beside a taxel."""
    x, y, loads = sparse(rng, 3)
    taxel, angle = int(rng.integers(x.size)), rng.uniform(0.0, 2.0 * math.pi)
    offset = PITCH_M * 10.0 ** rng.uniform(-12.0, -1.0) * np.array((math.cos(angle), math.sin(angle)))
    return turning_about("beside a taxel", x, y, loads, np.array((x[taxel], y[taxel])) + offset)


def near_translation(rng: Random) -> Scene:
    """1 − ρ from 10⁻¹ down to 10⁻¹⁶·⁵, where rounding decides on which side of R = μ the force lies."""
    contact = image(rng) if rng.random() < 0.5 else sparse(rng)
    return scene("near translation", rng, *contact, ratio=1.0 - 10.0 ** rng.uniform(-16.5, -1.0))


def decades(rng: Random) -> Scene:
    """Loads spread over twelve decades."""
    x, y, loads = sparse(rng, 3)
    return scene("twelve decades", rng, x, y, 10.0 ** rng.uniform(-12.0, 0.0, loads.size), rng.random())


def dominant(rng: Random) -> Scene:
    """One load among tiny ones."""
    x, y, loads = sparse(rng, 3)
    loads = loads * 10.0 ** rng.uniform(-12.0, -1.0)
    loads[rng.integers(loads.size)] = 10.0
    ratio = rng.random() if rng.random() < 0.5 else 1.0 - 10.0 ** rng.uniform(-12.0, -1.0)
    return scene("one dominant load", rng, x, y, loads, ratio)


def collinear(rng: Random) -> Scene:
    """Taxels on a line: equal loads, or a line that is one only to rounding."""
    n, angle = int(rng.integers(2, 17)), rng.choice((0.0, 0.5 * math.pi, rng.uniform(0.0, math.pi)))
    along = np.sort(rng.choice(32, n, replace=False)) * PITCH_M
    loads = np.ones(n) if rng.random() < 0.5 else rng.uniform(0.1, 1.0, n)
    ratio = rng.choice((0.0, rng.random()))
    return scene("collinear", rng, along * math.cos(angle), along * math.sin(angle), loads, float(ratio))


def nearly_collinear(rng: Random) -> Scene:
    """A thin contact: width 10⁻¹ to 10⁻¹² of its length."""
    x, y, loads = sparse(rng, 3)
    return scene("nearly collinear", rng, x, y * 10.0 ** rng.uniform(-12.0, -1.0), loads, rng.random())


def duplicates(rng: Random) -> Scene:
    """The same positions again."""
    x, y, loads = sparse(rng, 2, 12)
    again = rng.integers(0, x.size, int(rng.integers(1, 12)))
    more = 10.0 ** rng.uniform(-3.0, 1.0, again.size)
    return scene(
        "duplicates", rng, np.append(x, x[again]), np.append(y, y[again]), np.append(loads, more), rng.random()
    )


def symmetric(rng: Random) -> Scene:
    """Equal loads on a whole rectangle of taxels, the force along a side or none."""
    x, y = grid()
    cols, rows = rng.integers(1, COLS), rng.integers(1, ROWS)
    on = (x < x[cols]) & (y < y[rows * COLS])
    loads = np.ones(int(on.sum()))
    about = np.array((x[on].mean(), y[on].mean()))
    force = rng.choice((0.0, rng.random())) * MU * loads.size * np.array(((1.0, 0.0), (0.0, 1.0))[rng.integers(2)])
    return Scene("symmetric", x[on], y[on], loads, MU, force, about)


def two_clusters(rng: Random) -> Scene:
    """Two small contacts far apart, 10 to 10⁶ times their size."""
    x, y, loads = sparse(rng, 4)
    x = x + np.where(rng.random(x.size) < 0.5, 0.0, 10.0 ** rng.uniform(1.0, 6.0) * PITCH_M)
    return scene("two clusters", rng, x, y, loads, rng.random())


def off_centre(rng: Random) -> Scene:
    """The point the torque is taken about misses the load centroid by what a sensor's noise makes of it."""
    found = scene("off centre", rng, *image(rng), ratio=1.0 - 10.0 ** rng.uniform(-6.0, 0.0))
    about = found.about + rng.normal(0.0, 1e-4, 2)
    return Scene(found.family, found.x, found.y, found.loads, found.mu, found.tangential, about)


def other_units(rng: Random) -> Scene:
    """Millimetres to kilometres, micronewtons to meganewtons, anywhere in the plane."""
    plain = scene("other units", rng, *image(rng), ratio=rng.random())
    length, force = 10.0 ** rng.uniform(-3.0, 6.0), 10.0 ** rng.uniform(-6.0, 6.0)
    shift = length * rng.normal(0.0, 0.1, 2)
    return Scene(
        plain.family,
        plain.x * length + shift[0],
        plain.y * length + shift[1],
        plain.loads * force,
        plain.mu,
        plain.tangential * force,
        plain.about * length + shift,
    )


FAMILIES: dict[str, Callable[[Random], Scene]] = {
    "ordinary": ordinary,
    "few taxels": few_taxels,
    "no force": no_force,
    "hinge": hinge,
    "beside a taxel": beside_a_taxel,
    "near translation": near_translation,
    "twelve decades": decades,
    "one dominant load": dominant,
    "collinear": collinear,
    "nearly collinear": nearly_collinear,
    "duplicates": duplicates,
    "symmetric": symmetric,
    "two clusters": two_clusters,
    "off centre": off_centre,
    "other units": other_units,
}


def draw(seed: int) -> Scene:
    """Scene number ``seed``: the families in turn."""
    families = tuple(FAMILIES.values())
    return families[seed % len(families)](np.random.default_rng(seed))
