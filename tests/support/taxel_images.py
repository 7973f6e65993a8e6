"""A pad of eight by sixteen taxels under simulated grips, for the tests of what taxels do."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from slipd.signals.taxel_health import TaxelHealth
from slipd.tools.sim.scene_parts import Pad, Patch

ROWS, COLS = 8, 16
TAXELS = ROWS * COLS
N_PER_COUNT = 0.0005
FULL_SCALE = 32_767 * N_PER_COUNT
NOISE, OFFSET = 2.0, 20.0
LOST_S, END_S = 2.0, 3.2
"""When a taxel is lost, and the end of the data: found within 1 s leaves a little over for the last block."""

WIDE = Patch(0.032, 0.018, 8.0, (0.0, 0.0))
"""Presses on every taxel."""


def watch(**options: float) -> TaxelHealth:
    settings = {"full_scale": FULL_SCALE, "threshold": 0.005, **options}
    return TaxelHealth(ROWS, COLS, **settings)


def swing(t_s: np.ndarray) -> np.ndarray:
    """A grip from 0.8 s on whose force swings about 20 N once a second."""
    return np.clip((t_s - 0.8) / 0.3, 0.0, 1.0) * (20.0 + 7.0 * np.sin(2.0 * np.pi * t_s))


def counts(force_n: np.ndarray, patch: Patch, rng: np.random.Generator, *, charge_tau_s: float = 0.0) -> np.ndarray:
    """What a pad sends: a spread of gains and offsets, noise, whole counts; shape (images, taxels)."""
    gain = 2000.0 * (1.0 + 0.03 * rng.normal(size=TAXELS)) * Pad(ROWS, COLS).shares(patch)
    felt = force_n[:, None] * gain
    return np.rint(felt + OFFSET * rng.normal(size=TAXELS) + NOISE * rng.normal(size=felt.shape))


def feed(
    health: TaxelHealth, images: np.ndarray, rate_hz: float, force_n: np.ndarray, *, begin_s: float = 0.0
) -> list[tuple[float, np.ndarray]]:
    """Feeds images in counts; tells when ``masked`` changed, and what it was then."""
    span = max(round(0.1 * rate_hz), 1)
    moving = maximum_filter1d(force_n, span) - minimum_filter1d(force_n, span) > 0.1
    changes = []
    for k, image in enumerate(N_PER_COUNT * images):
        before = health.masked
        t_s = begin_s + k / rate_hz
        health.update(image, round(t_s * 1e9), bool(force_n[k] < 0.8), bool(moving[k]))
        if health.masked is not before and (health.masked != before).any():
            changes.append((t_s, health.masked))
    return changes
