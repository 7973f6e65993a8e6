"""With the reflex in the loop: does the object stay in the hand, and at which grip force?

The virtual gripper of the demo holds a box into which something is poured at one end, so that it turns and slides in
the end at the first grip force. Both fingers' sensors and the gripper are emulated, the engine commands, the simulated
grasp feels the force. Friction, mass, grip and pouring are drawn at random.
"""

from __future__ import annotations

from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np
from bench.tables import Table
from evaluate.intervals import share_upper
from simulation.bed import NEVER_S, Bed
from simulation.watch import Watch

from slipd import config
from slipd.tools.shipped_files import shipped_config
from slipd.tools.sim.scene import Scene
from slipd.tools.sim.scene_parts import GRAVITY_MPS2, Script
from slipd.tools.sim.stepped_grasp import FrictionLaw
from slipd.tools.sim.virtual_gripper import VirtualRig

POUR_S, POURED_S, END_S = 2.2, 5.2, 6.5
STRONG_N = 22.0
"""The reflex's ceiling in the demo's config, and the fixed grip beside it."""

LEASE_S = 0.1


@dataclass(frozen=True, slots=True)
class Mode:
    """How the object is held.

    Attributes:
        name: What the table calls it.
        reflex: The reflex raises the grip.
        factor: μ of the config over the true one; None: no μ.
        force_n: Grip force of the hold, N; None: half of the limit of the lifted box.
    """

    name: str
    reflex: bool
    factor: float | None = 1.0
    force_n: float | None = None


MODES = (
    Mode("fixed grip, λ 0.5 when lifted", reflex=False),
    Mode("fixed grip, 22 N", reflex=False, force_n=STRONG_N),
    Mode("reflex, μ known", reflex=True),
    Mode("reflex, μ factor 1.2", reflex=True, factor=1.2),
    Mode("reflex, μ factor 0.8", reflex=True, factor=0.8),
)


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of one object: whether it fell, how far it slid or turned, and the grip force."""

    dropped: bool
    slid_m: float
    turned_rad: float
    peak_n: float
    mean_n: float


def hold(seed: int, mode: Mode) -> Outcome:
    """Hold a drawn box with one way of gripping."""
    rng = np.random.default_rng(seed)
    mu, mass = rng.uniform(0.35, 0.8), rng.uniform(0.12, 0.35)
    friction = FrictionLaw(mu_s=mu, mu_d=mu * rng.uniform(0.6, 0.95), stribeck_mps=0.005)
    weak = max(mass * GRAVITY_MPS2 / 2.0 / (0.5 * mu), 4.0)
    force = weak if mode.force_n is None else mode.force_n
    lever = rng.uniform(0.01, 0.06)
    # what friction at the weak force carries as a turn is about its force limit times 10 mm
    excess = rng.uniform(1.3, 2.2) * 2.0 * mu * weak / (1.0 + lever / 0.01)
    script = Script(
        lift_s=1.5, ramp_s=0.3, pour_s=POUR_S, pour_until_s=POURED_S, pour_n_per_s=excess / (POURED_S - POUR_S),
        lever_m=lever, drain_s=NEVER_S, tug_s=NEVER_S, set_down_s=NEVER_S,
    )  # fmt: skip
    bed = _bed(seed, Scene(script=script, friction=friction, mass_kg=mass), mode, mu)
    bed.free()
    bed.lease()
    assert bed.code("gripper.close", force_n=force, speed_mps=0.15) is None
    forces: list[float] = []
    slid = turned = 0.0
    while bed.said_ns < END_S * 1e9:
        bed.run(LEASE_S)
        bed.ask("lease.renew")
        scene = bed.rig.scene
        if scene.in_contact:
            forces.append(scene.normal_n)
            slid, turned = max(slid, float(np.hypot(*scene.displacement_m))), max(turned, abs(scene.angle_rad))
    dropped = any(event.event == "dropped" for event in bed.rig.scene.truth)
    return Outcome(dropped, slid, turned, max(forces), float(np.mean(forces)))


def _bed(seed: int, scene: Scene, mode: Mode, mu: float) -> Bed:
    """Return the demo's rig with another scene, reflex and μ."""
    bed = Bed(seed, charge=True)
    text = settings_text(mode, mu)
    bed.settings = config.parse(text, "closed_loop.toml")
    bed.rig, bed.watch = VirtualRig(scene, seed), Watch(bed.settings)
    bed.begin(bed.settings, zeros=False)
    return bed


def settings_text(mode: Mode, mu: float) -> str:
    """Return the demo's config with the μ and the reflex of a mode."""
    text = shipped_config("demo.toml").read_text(encoding="utf-8")
    line = "" if mode.factor is None else f"mu = {mode.factor * mu:.4f}"
    text = text.replace("mu = 0.55 ", f"{line} ").replace("mu = 0.55\n", f"{line}\n")
    if mode.reflex:
        text = text.replace("[reflex]\nenabled = false", "[reflex]\nenabled = true")
    return text


def run(seeds: Iterable[int], workers: int) -> dict[str, list[Outcome]]:
    """Return the outcomes of every mode."""
    tasks = [(seed, mode) for seed in seeds for mode in MODES]
    with ProcessPoolExecutor(max(workers, 1)) as pool:
        outcomes = list(pool.map(hold, *zip(*tasks, strict=True)))
    found: dict[str, list[Outcome]] = {mode.name: [] for mode in MODES}
    for (_, mode), outcome in zip(tasks, outcomes, strict=True):
        found[mode.name].append(outcome)
    return found


def table(found: dict[str, list[Outcome]]) -> Table:
    """Return drops and forces of every mode."""
    result = Table(
        "With the reflex in the loop",
        ("grip", "grasps", "dropped", "upper bound", "slid p50 / most, mm", "peak force p50, N", "mean force, N"),
        notes=[
            "A box in the demo's gripper, into which so much is poured that it would fall from the weak grip. Dropped: "
            "it slid 40 mm or turned by 1 rad."
        ],
    )
    for name, outcomes in found.items():
        drops = sum(one.dropped for one in outcomes)
        slid = sorted(1e3 * one.slid_m for one in outcomes)
        result.rows.append((
            name, len(outcomes), drops, f"{100.0 * share_upper(drops, len(outcomes)):.0f} %",
            f"{slid[len(slid) // 2]:.1f} / {slid[-1]:.1f}", float(np.median([one.peak_n for one in outcomes])),
            float(np.mean([one.mean_n for one in outcomes])),
        ))  # fmt: skip
    return result
