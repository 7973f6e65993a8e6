"""Keep what a detector of slip sees of simulated grasps, and what really happened, so that it is scored in seconds.

A grasp runs through sensors and engine once. Kept are the course of its load, the images of its pad, the evidence and
the level that were published, and the true course of the contact.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from evaluate.offline_grasp import BEGIN_NS, run_offline
from evaluate.reports import reports_of
from evaluate.running import READ_NS, Variant, config_text
from evaluate.worlds import WORLDS
from realdata.runs import RUNS, START_S, measure

from slipd.finger import contact_estimator
from slipd.fusion.assess import SPIN_ARM_M
from slipd.fusion.rows import TOUCHING, UNSOLVED, Row, Rows
from slipd.motion.evidence import Evidence
from slipd.motion.image_shift import ImageShift
from slipd.types.arrays import Array, Mask

FACTORS = (1.0, 0.9, 1.1, None)
"""μ of the config over the true one, by the seed; None: the config has none."""
COLUMNS = ("t_s", "touches", "q", "normal", "fx", "fy", "spin", "cx", "cy", "std", "mu", "evidence", "exact")


@dataclass(frozen=True, slots=True, eq=False)
class Grasp:
    """One grasp.

    Attributes:
        name: Family and seed.
        load: Columns `COLUMNS` of each reading, shape (n, 13).
        level: Times of messages, s, and their level codes, shape (m, 2).
        truth: Time, s, speed of the contact, m/s, whether all of it slides, and true utilisation, shape (i, 4).
        episodes: Begin and end of each gross slip, s, shape (j, 2).
        ratio: μ_d / μ_s.
        images: Force on each taxel in each image of the contact, shape (p, n).
        seen: Of each image: how many readings came before it, its time, ns, and the wrench since the one before, N and
            N·m, shape (p, 8).
    """

    name: str
    load: Array
    level: Array
    truth: Array
    episodes: Array
    ratio: float
    images: Array = field(default_factory=lambda: np.empty((0, 0)))
    seen: Array = field(default_factory=lambda: np.empty((0, 8)))

    @property
    def family(self) -> str:
        """Its family."""
        return self.name.rsplit(" ", 1)[0]

    @property
    def seed(self) -> int:
        """Its seed."""
        return int(self.name.rsplit(" ", 1)[1])

    @property
    def way_m(self) -> Array:
        """How far the contact has slid at each time of ``truth``, m."""
        step_s = np.diff(self.truth[:, 0], append=self.truth[-1, 0])
        return np.asarray(np.cumsum(self.truth[:, 1] * step_s))


def grasps(
    families: Iterable[str], seeds: Iterable[int], folder: Path, world: str = "first", workers: int = 2
) -> Iterator[Grasp]:
    """Yield grasps, those that are kept in a folder without a run."""
    tasks = [(world, family, seed, folder) for seed in seeds for family in families]
    folder.mkdir(parents=True, exist_ok=True)
    left = [task for task in tasks if not _path(*task).exists()]
    if left:
        with ProcessPoolExecutor(workers) as pool:
            list(pool.map(_record, left))
    for task in tasks:
        yield load(_path(*task))


def load(path: Path) -> Grasp:
    """Read a kept grasp."""
    with np.load(path, allow_pickle=False) as kept:
        arrays = {name: kept[name] for name in ("load", "level", "truth", "episodes", "images", "seen")}
        return Grasp(name=str(kept["name"]), ratio=float(kept["ratio"]), **arrays)


def _save(path: Path, grasp: Grasp) -> None:
    np.savez_compressed(path, **{one.name: getattr(grasp, one.name) for one in fields(grasp)})


def _path(world: str, family: str, seed: int, folder: Path) -> Path:
    return folder / f"{world}_{family.replace(' ', '_')}_{seed}.npz"


def _record(task: tuple[str, str, int, Path]) -> None:
    """Simulate a grasp, run it, and keep it."""
    name, family, seed, _ = task
    world = WORLDS[name]
    scene = world.draw(family, seed)
    trace = world.play(scene)
    truth = world.truth_of(scene, trace)
    variant = Variant(FACTORS[seed // 2 % len(FACTORS)])
    noise = zlib.crc32(f"{family} {seed}".encode())
    images: list[Array] = []
    seen: list[tuple[float, ...]] = []
    look = ImageShift.update

    def keep_image(
        motion: ImageShift, t_ns: int, forces: Array, wrench: tuple[float, ...], usable: Mask | None
    ) -> Evidence | None:
        images.append(forces.astype(np.float32))
        seen.append((sum(map(len, columns)), float(t_ns), *wrench))
        return look(motion, t_ns, forces, wrench, usable)

    with keeping_loads() as columns, mock.patch.object(ImageShift, "update", keep_image):
        heard = run_offline(trace, {"left": scene.sensors}, config_text(scene, variant), noise, read_ns=READ_NS)
    bodies = ((t_ns + BEGIN_NS, body) for t_ns, topic, body in heard if topic == "slip.left" and t_ns >= 0)
    published, load_rows = reports_of(bodies, BEGIN_NS), np.concatenate(columns)
    load_rows[:, 0] -= BEGIN_NS * 1e-9
    found = Grasp(
        f"{family} {seed}",
        load_rows,
        np.stack([published.t_s, published.level], 1),
        np.stack([truth.t_s, truth.speed_mps, truth.gross, truth.utilisation], 1),
        np.array([tuple(one) for one in truth.episodes()]).reshape(-1, 2),
        scene.friction.mu_d / scene.friction.mu_s,
        np.array(images, np.float32).reshape(len(images), -1 if images else 0),
        np.array(seen).reshape(-1, 8),
    )
    _save(_path(*task), found)


@contextmanager
def keeping_loads() -> Iterator[list[Array]]:
    """Keep the columns of all readings that an engine judges meanwhile."""
    columns: list[Array] = []
    judge = contact_estimator.judge_readings

    def keep(rows: Rows, states: Rows, *rest: Any) -> None:
        judge(rows, states, *rest)
        columns.append(_columns(rows, states[0]["conditions"]))

    with mock.patch.object(contact_estimator, "judge_readings", keep):
        yield columns


def pushes(folder: Path) -> Iterator[Grasp]:
    """Yield the pushes of the repository as grasps, where a slide is a slip; kept ones without a run."""
    for file in sorted(RUNS.glob("*.npz")):
        path = folder / f"pushes_{file.name}"
        if path.exists():
            yield load(path)
            continue
        with keeping_loads() as columns:
            (run,) = measure(RUNS, [file.stem])
        load_rows = np.concatenate(columns)
        load_rows[:, 0] -= START_S
        time_s, path_m = run.motion.time_s, run.motion.path_m
        speed = np.append(np.diff(path_m) / np.diff(time_s), 0.0)
        slides = np.array([(slide.begin_s, slide.end_s) for slide in run.motion.slides])
        truth = np.stack([time_s, speed, np.zeros_like(speed), np.zeros_like(speed)], 1)
        found = Grasp(f"{file.stem} 0", load_rows, np.empty((0, 2)), truth, slides, 0.8)
        _save(path, found)
        yield found


def _columns(rows: Rows, now: Row) -> Array:
    """Return the columns of readings that were judged; q and its noise as `slipd.fusion.assess` finds them."""
    contact, found, mu = rows["contact"], rows["assessment"], float(now["mu"])
    normal, ratio, spin = contact["normal_n"], contact["friction_ratio"], contact["spin_nm"]
    exact = (rows["utilisation"]["kind"] != UNSOLVED) & ~np.isnan(spin)
    by_force = np.where(np.isnan(spin), ratio, np.hypot(ratio, spin / (normal * SPIN_ARM_M)))
    q = np.where(exact, rows["utilisation"]["value"] * (1.0 if np.isnan(mu) else mu), by_force)
    std = np.hypot(now["force_std_n"] * np.hypot(1.0, ratio), now["torque_std_nm"] / SPIN_ARM_M) / normal
    return np.stack(
        [rows["t_s"], rows["phase"] == TOUCHING, q, normal, contact["fx_n"], contact["fy_n"], spin, contact["cx_m"],
         contact["cy_m"], std, np.full(len(rows), mu), found["evidence"], exact], 1,
    )  # fmt: skip
