"""Ways to foresee or notice slip, on the same messages: what each would have alarmed at, for every threshold.

Each method makes one number of a reading, which would be 1 at the onset of slip if the method and its μ were right; it
alarms where the number exceeds a threshold. Its two errors follow for all thresholds at once:

- a **slip** (the first gross slip of a run) is found if the number exceeds the threshold at some time from `BEFORE_S`
  before its onset to `PROMPT_S` after it;
- a **safe span** (`SPAN_S` in which the true λ is below `SAFE` and nothing slides) is a false alarm if it exceeds it
  there.

μ of the config is 0.8 to 1.2 times the true one, each equally often: μ is known to 20 %.
"""

from __future__ import annotations

import math
import time
import zlib
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np
from chart.rivals import paper
from chart.scenes import Scene as ContactScene
from evaluate.campaign import FIXED
from evaluate.families import draw
from evaluate.offline_grasp import Heard
from evaluate.playing import play, truth_of
from evaluate.reports import SLIPPING
from evaluate.running import FACTORS, Tape, Variant, config_text, record
from evaluate.scene import Scene
from evaluate.score import LATE_S, PROMPT_S, SAFE
from evaluate.truth import Truth

from slipd.fusion import utilisation
from slipd.types.arrays import Array

BEFORE_S, SPAN_S = 0.5, 0.5
DEBOUNCE_S = 0.01
SAMPLE_HZ = 50.0
"""Of the messages and images that the methods get."""

PAPER_STEPS = 5
"""Bisections of the paper's verdict for its number: to 3 %, for its search takes long."""

RATIO, DEBOUNCED, ELLIPSE, PAPER = "eq. (4) alone", "R > 0.8 μ, debounced", "ellipsoid", "the paper as printed"
EXACT, EVIDENCE, LEARNED = "exact, μ fixed", "exact + evidence, μ fixed", "exact + evidence + learned μ"
METHODS = (DEBOUNCED, RATIO, PAPER, ELLIPSE, EXACT, EVIDENCE, LEARNED)
OPERATED_AT = {DEBOUNCED: 0.8, RATIO: 1.0, PAPER: 1.0, ELLIPSE: 0.85, EXACT: 0.85, EVIDENCE: 0.85, LEARNED: 0.85}
"""Threshold at which each would be used."""

FAMILIES_SHOWN = (
    "ramp", "pour", "torsion", "combined", "loosen", "far pole", "edge", "sudden weight", "hold", "lift", "shake",
    "change of load", "change of grip", "actuation noise",
)  # fmt: skip


@dataclass
class Found:
    """The numbers of one method: the highest one around every slip, and in every safe span."""

    slips: list[float]
    safe: list[float]

    def curve(self, thresholds: Array) -> tuple[Array, Array]:
        """Return the shares of false alarms and of slips found at some thresholds."""
        slips, safe = np.sort(self.slips), np.sort(self.safe)
        return (
            1.0 - np.searchsorted(safe, thresholds, side="left") / max(safe.size, 1),
            1.0 - np.searchsorted(slips, thresholds, side="left") / max(slips.size, 1),
        )


def compare(seeds: Iterable[int], workers: int) -> dict[str, Found]:
    """Return the numbers of every method over grasps of `FAMILIES_SHOWN`."""
    found = {name: Found([], []) for name in METHODS}
    tasks = [(family, seed) for seed in seeds for family in FAMILIES_SHOWN]
    with ProcessPoolExecutor(max(workers, 1)) as pool:
        for part in pool.map(observe, tasks):
            for name, (slips, safe) in part.items():
                found[name].slips += slips
                found[name].safe += safe
    return found


def observe(task: tuple[str, int]) -> dict[str, tuple[list[float], list[float]]]:
    """Return the numbers of every method for one grasp, at every μ factor."""
    family, seed = task
    scene = draw(family, seed)
    trace = play(scene)
    truth = truth_of(scene, trace)
    noise = zlib.crc32(f"{family} {seed}".encode())
    found: dict[str, tuple[list[float], list[float]]] = defaultdict(lambda: ([], []))
    tape = record(scene, trace, "", noise)
    for factor in FACTORS:
        fixed = _heard(scene, tape, Variant(factor, finger_lines=FIXED))
        learned = _heard(scene, tape, Variant(factor))
        for name, (t, numbers) in (*_by_messages(fixed), _engine(LEARNED, learned)):
            _collect(found[name], truth, t, numbers)
        if factor == 1.0:
            by_images = list(_by_images(fixed, scene.friction.mu_s))
    for name, (t, numbers) in by_images:
        for factor in FACTORS:
            _collect(found[name], truth, t, numbers / factor)
    return dict(found)


def _heard(scene: Scene, tape: Tape, variant: Variant) -> list[Heard]:
    text = config_text(scene, variant).replace("tactile_hz = 1.0", f"tactile_hz = {SAMPLE_HZ}")
    return [Heard(*message) for message in tape.play(text)]


def _slips(heard: list[Heard]) -> list[Heard]:
    return [one for one in heard if one.topic == "slip.left" and one.t_ns >= 0]


def _column(messages: list[Heard], key: str) -> Array:
    return np.array([math.nan if one.body.get(key) is None else one.body[key] for one in messages], dtype=np.float64)


def _times(messages: list[Heard]) -> Array:
    return np.array([one.t_ns for one in messages], dtype=np.float64) * 1e-9


def _by_messages(heard: list[Heard]) -> Iterator[tuple[str, tuple[Array, Array]]]:
    """Yield the numbers of the methods that need no image of their own."""
    messages = _slips(heard)
    t, ratio = _times(messages), _column(messages, "friction_ratio") / _column(messages, "mu")
    yield RATIO, (t, ratio)
    yield DEBOUNCED, (t, _least_lately(t, ratio))
    yield EXACT, (t, _column(messages, "utilisation"))
    yield _engine(EVIDENCE, heard)


def _engine(name: str, heard: list[Heard]) -> tuple[str, tuple[Array, Array]]:
    """Return the number of slipd itself: λ, and infinity while it reports a slip."""
    messages = _slips(heard)
    slipping = _column(messages, "level_code") == SLIPPING
    return name, (_times(messages), np.where(slipping, math.inf, _column(messages, "utilisation")))


def _by_images(heard: list[Heard], mu: float) -> Iterator[tuple[str, tuple[Array, Array]]]:
    """Yield the numbers of the methods that solve each image anew, at the true μ."""
    contacts = list(contacts_of(heard, mu))
    for name, number in ((ELLIPSE, ellipse_number), (PAPER, paper_number)):
        yield name, (np.array([t for t, _, _ in contacts]), np.array([number(c, spin) for _, c, spin in contacts]))


def contacts_of(heard: list[Heard], mu: float) -> Iterator[tuple[float, ContactScene, float]]:
    """Yield time, contact and spin of every image with the message before it."""
    message: Heard | None = None
    for one in heard:
        if one.t_ns < 0:
            continue
        if one.topic == "slip.left":
            message = one
        elif one.topic == "tactile.left" and message is not None and message.body["spin_nm"] is not None:
            loads = np.array(one.body["loads_n"] or [0.0])
            on = loads > 0.0
            if on.sum() < 2:
                continue
            x, y = _places(one.body)
            body = message.body
            loads = loads[on] * (body["normal_n"] / loads[on].sum())
            about, force = np.array(body["centroid_m"]), np.array(body["tangential_n"])
            yield one.t_ns * 1e-9, ContactScene("", x[on], y[on], loads, mu, force, about), body["spin_nm"]


def _places(image: dict[str, object]) -> tuple[Array, Array]:
    rows, cols, pitch = int(image["rows"]), int(image["cols"]), float(image["pitch_m"])  # type: ignore[call-overload]
    x, y = np.meshgrid((np.arange(cols) - (cols - 1) / 2) * pitch, (np.arange(rows) - (rows - 1) / 2) * pitch)
    return x.ravel(), y.ravel()


def ellipse_number(contact: ContactScene, spin: float) -> float:
    """Return the gauge of an ellipsoid with the torque of a turn about the centroid."""
    dx, dy = contact.x - contact.about[0], contact.y - contact.about[1]
    torque = contact.mu * float(contact.loads @ np.hypot(dx, dy))
    force = contact.mu * float(contact.loads.sum())
    return math.hypot(float(np.hypot(*contact.tangential)) / force, spin / torque)


def paper_number(contact: ContactScene, spin: float) -> float:
    """Return the least factor on μ with which the paper's own test calls the contact safe, by bisection."""
    mirrored = spin < 0.0  # the test is for a positive spin; a mirror image has one
    x = -contact.x if mirrored else contact.x
    tangential = contact.tangential * ((-1.0, 1.0) if mirrored else (1.0, 1.0))
    about = contact.about * ((-1.0, 1.0) if mirrored else (1.0, 1.0))
    low, high = 0.25, 2.0
    for _ in range(PAPER_STEPS):
        middle = math.sqrt(low * high)
        limit = paper.printed(ContactScene("", x, contact.y, contact.loads, middle * contact.mu, tangential, about))
        low, high = (low, middle) if limit >= abs(spin) else (middle, high)
    return math.sqrt(low * high)


def _least_lately(t: Array, numbers: Array) -> Array:
    """Return the least number of the last `DEBOUNCE_S`."""
    first = np.searchsorted(t, t - DEBOUNCE_S)
    return np.array([numbers[i : k + 1].min() for k, i in enumerate(first)])


def _collect(found: tuple[list[float], list[float]], truth: Truth, t: Array, numbers: Array) -> None:
    """Add the highest number around the first slip, and in every safe span."""
    slips, safe = found
    episodes = truth.episodes()
    numbers = np.nan_to_num(numbers, nan=0.0, posinf=1e9)
    if episodes and episodes[0].end_s - episodes[0].begin_s >= PROMPT_S:
        near = (t >= episodes[0].begin_s - BEFORE_S) & (t <= episodes[0].begin_s + PROMPT_S)
        slips.append(float(numbers[near].max(initial=0.0)))
    for begin_s in np.arange(0.5, truth.t_s[-1] - SPAN_S, SPAN_S):
        within, span = ((times >= begin_s) & (times < begin_s + SPAN_S) for times in (t, truth.t_s))
        slides = any(e.begin_s - 0.05 < begin_s + SPAN_S and begin_s < e.end_s + LATE_S for e in episodes)
        if within.any() and not slides and truth.utilisation[span].max() < SAFE:
            safe.append(float(numbers[within].max()))


def costs(seed: int) -> dict[str, float]:
    """Return the time of one decision of every method, s: the median over the images of a grasp.

    For slipd's whole verdicts it is the time of the engine for a force reading, from bytes to message.
    """
    scene = draw("combined", seed)
    trace = play(scene)
    tape = record(scene, trace, "", seed)
    heard = _heard(scene, tape, Variant(1.0, finger_lines=FIXED))
    contacts = list(contacts_of(heard, scene.friction.mu_s))
    mu = scene.friction.mu_s
    solved: dict[str, Callable[[ContactScene, float], object]] = {
        RATIO: lambda c, _: math.hypot(*c.tangential) / (mu * c.loads.sum()),
        ELLIPSE: ellipse_number,
        PAPER: lambda c, _: paper.printed(c),
        EXACT: lambda c, spin: utilisation(c.x, c.y, c.loads, mu, c.tangential, spin, c.about),
    }
    found = {
        name: float(np.median([_seconds(ask, c, spin) for _, c, spin in contacts])) for name, ask in solved.items()
    }
    found[DEBOUNCED] = found[RATIO]
    for name, lines in ((EVIDENCE, FIXED), (LEARNED, "")):
        begun = time.perf_counter()
        _heard(scene, tape, Variant(1.0, finger_lines=lines))
        readings = (trace.t_s[-1] + 1.5) * scene.sensors.force.rate_hz
        found[name] = (time.perf_counter() - begun) / readings
    return found


def _seconds(ask: Callable[[ContactScene, float], object], contact: ContactScene, spin: float) -> float:
    begun = time.perf_counter()
    ask(contact, spin)
    return time.perf_counter() - begun
