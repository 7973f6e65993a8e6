"""Slip reports of a finger while an arm carries the object, with the arm stream right, wrong or missing."""

from __future__ import annotations

import heapq
from collections import Counter

import numpy as np
from carry.faults import FAULTS, MORE_FAULTS
from carry.scenes import Motion, carried
from carry.weigh import ARM, ARM_MS, MS, TIMING_S, Distortion
from evaluate import playing
from evaluate.finger_sensing import FingerSensing, offline_config
from evaluate.offline_grasp import BEGIN_NS, LEAD_S
from evaluate.running import Tape, Variant, record, reports
from evaluate.scene import STEP_S, Kind, Scene
from evaluate.score import score
from grasp_table import grasp_table
from scipy.spatial.transform import Rotation

from slipd import config
from slipd.devices.external import encode_reading
from slipd.events import Bytes, Event, LinkUp
from slipd.types.arrays import Array

KINDS: tuple[Kind, ...] = ("safe", "slips")
STREAMS: dict[str, Distortion | None] = {"right": None}
STREAMS |= {name: distort for name, (distort, _) in FAULTS.items() if distort} | MORE_FAULTS
RARELY = 400
"""Steps between two solutions of the true λ, which only warnings need."""
ARM_AGE_NS = 2 * MS
"""Age of a reading of the arm when it enters the engine."""


def measure_slips(count: int, first: int = 0) -> None:
    """Print false slip reports, and slips that are reported in time, by kind of the arm stream; of seeds from `first`.

    The other finger is silent, so that the stream is checked by its length only.
    """
    found = {name: Counter[str]() for name in ("no stream", *STREAMS)}
    delays_s: dict[str, list[float]] = {name: [] for name in found}
    for seed in range(first, first + count):
        for kind in KINDS:
            scene, motion = carried(seed, kind)
            trace = playing.play(scene)
            truth = playing.truth_of(scene, trace, every=RARELY, needs=False)
            tape = record(scene, trace, "", seed)
            published = reports(scene, tape, Variant())
            for name, tally in found.items():
                if name in STREAMS:
                    published = reports(scene, *with_arm(tape, scene, motion, seed, STREAMS[name]))
                figures = score(truth, published, steady=None, closed_s=scene.closed_s)
                long = [episode for episode in figures.episodes if episode.long]
                tally.update(slips=len(long), found=sum(not episode.missed for episode in long))
                delays_s[name] += [episode.latency_s for episode in long if not episode.missed]
                if kind == "safe" and not figures.episodes:
                    tally.update(held=1, false=figures.false_slipping > 0)
        for name, tally in found.items():
            delay_s = np.mean(delays_s[name]) if delays_s[name] else np.nan
            print(
                f"{seed}, {name}: false in {tally['false']} of {tally['held']} grasps that hold; {tally['found']} of "
                f"{tally['slips']} slips reported within 0.1 s, after {1e3 * delay_s:.1f} ms in the mean",
                flush=True,
            )


def with_arm(tape: Tape, scene: Scene, motion: Motion, seed: int, distort: Distortion | None) -> tuple[Tape, Variant]:
    """Return the events of a grasp with an arm stream among them, and the config that reads it."""
    right = offline_config({"right": FingerSensing(scene.sensors.force, None)}, None)
    variant = Variant(extra=right + grasp_table() + ARM)
    grasp = config.parse(offline_config({"left": scene.sensors}, None, extra=variant.extra), "config of a carry").grasp
    if grasp is None:
        raise ValueError("a config of a carry has [grasp]")
    turn = Rotation.from_quat(grasp.pads["left"].quat_xyzw)
    rng = np.random.default_rng((8, seed))
    seconds = len(scene.grip_n) * STEP_S
    sent_ns = np.arange(BEGIN_NS - round(LEAD_S * 1e9), BEGIN_NS + round(seconds * 1e9), ARM_MS * MS)
    felt_s = (sent_ns - BEGIN_NS - ARM_AGE_NS) * 1e-9 - rng.normal(0.0, TIMING_S)
    known_s, zero = np.arange(len(scene.grip_n)) * STEP_S, np.zeros(felt_s.size)

    def at(values: Array) -> Array:
        return np.interp(felt_s, known_s, values)

    gravity = turn.apply(np.column_stack((at(motion.gravity_mps2[:, 0]), at(motion.gravity_mps2[:, 1]), zero)))
    omega = turn.apply(np.column_stack((zero, zero, at(motion.omega_radps))))
    alpha = turn.apply(np.column_stack((zero, zero, at(motion.alpha_radps2))))
    gravity, omega = gravity + rng.normal(0.0, 0.02, gravity.shape), omega + rng.normal(0.0, 0.002, omega.shape)
    if distort is not None:
        gravity, omega, alpha = distort(gravity, omega, alpha)
    events: list[tuple[int, Event]] = [(int(sent_ns[0]), LinkUp("arm", "offline arm"))]
    for t_ns, felt, turning, more in zip(sent_ns.tolist(), gravity, omega, alpha, strict=True):
        if np.isfinite(felt).all():
            motion_at = {"gravity_mps2": felt.tolist(), "angular_velocity_radps": turning.tolist()}
            motion_at |= {"angular_acceleration_radps2": more.tolist()}
            events.append((t_ns, Bytes("arm", encode_reading("arm", t_ns - ARM_AGE_NS, **motion_at))))
    merged = Tape("")
    merged.events = list(heapq.merge(events, tape.events, key=lambda timed: timed[0]))
    return merged, variant
