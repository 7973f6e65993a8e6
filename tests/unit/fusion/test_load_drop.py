"""A load that falls from static to dynamic friction is a slip; loads that fall for other reasons are none."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from load_course import MU, Watch, contact_rows, line, slips_at

from slipd.config import Levels, Slip
from slipd.fusion.levels import ContactWatch, Uncertainty
from slipd.fusion.rows import FREE, LOAD_DROP_BIT, Rows
from slipd.motion.evidence import evidence_mask
from slipd.types.arrays import Array

NORMAL_N = 10.0
STD_N = 0.02


def followed(
    load: Array, normal: Array | float = NORMAL_N, *, aside: Array | float = 0.0, hz: float = 1000.0,
    std_n: float = STD_N, mu: float = MU, seed: int = 0, settings: Slip | None = None,
    noise: Array | None = None,
) -> Rows:  # fmt: skip
    """Return the assessments of a course of the load, N, with noise."""
    rng, n = np.random.default_rng(seed), len(load)
    noise = rng.normal(0.0, std_n, (3, n)) if noise is None else noise
    pulled, across, pressed = load + noise[0], aside + noise[1], normal + noise[2]
    used = np.hypot(pulled, across) / pressed / (1.0 if math.isnan(mu) else mu)
    rows = contact_rows(n, pulled, pressed, used, 100.0 + np.arange(n) / hz, aside_n=across)
    watch = ContactWatch(Levels(), settings or Slip(), 0.001, 0.3)
    watch.assess(rows, mu, Uncertainty(STD_N), 0.0)
    return rows["assessment"]


def smooth(begin: float, end: float, count: int) -> Array:
    part = np.linspace(0.0, 1.0, count)
    return begin + (end - begin) * part * part * (3.0 - 2.0 * part)


RISE = (2.0, 6.0, 800)
WHOLE_NUMBERS = ("level", "friction_step", "tipping_step", "slips", "tipping_by_unknown_load", "evidence")


@pytest.mark.parametrize("ratio", [0.62, 0.75, 0.85, 0.92])
@pytest.mark.parametrize("mu", [MU, 0.8 * MU, 1.2 * MU, math.nan])
def test_a_fall_from_static_to_dynamic_friction_is_a_slip(ratio: float, mu: float) -> None:
    found = followed(line(RISE, (6.0, 6.0 * ratio, 3), (6.0 * ratio, 6.0 * ratio, 300)), mu=mu)
    (at,) = slips_at(found)
    assert 803 <= at <= 825
    assert found["slips"][at:].all()
    assert found["peak_required"][at] == pytest.approx(0.6, rel=0.03)
    assert found["plateau_required"][-1] == pytest.approx(0.6 * ratio, rel=0.02)
    assert found["evidence"][at] == LOAD_DROP_BIT == evidence_mask("load_drop")
    assert found["drop_surprise"][at] > 17.0
    assert found["level"][at] == 4


def test_what_does_not_slip_has_no_peak_and_no_surprise() -> None:
    found = followed(line(RISE))
    assert np.isnan(found["peak_required"]).all()
    assert np.isnan(found["plateau_required"]).all()
    assert (found["drop_surprise"] == 0.0).all()
    assert found["required_friction"][-1] == pytest.approx(0.6, rel=0.02)


LOOSENED = line((10.0, 5.0, 1000), (5.0, 4.8, 200))


@pytest.mark.parametrize(
    ("load", "more", "since", "until"),
    [
        # A slow contact breaks loose over some milliseconds.
        *[
            (line((4.0, 6.0, 1500), (6.0, 4.5, ms), (4.5, 4.5, 200)), {}, 1500, 1500 + 3 * ms + 12)
            for ms in (2, 10, 20)
        ],
        (np.where(np.arange(1200) < 1000, 3.0, 0.45 * LOOSENED), {"normal": LOOSENED}, 1000, 1020),
        # A wet object slips far below the believed friction.
        (line((1.0, 2.4, 800), (2.4, 1.8, 3), (1.8, 1.8, 300)), {}, 803, 840),
        # A load that jumps beyond the limit shows no peak.
        (line((2.0, 2.0, 500), (2.0, 5.5, 5), (5.5, 5.4, 300)), {}, 500, 510),
    ],
)
def test_other_slips_are_reported_soon(load: Array, more: dict[str, Any], since: int, until: int) -> None:
    found = followed(load, **more)
    (at,) = slips_at(found)
    assert since <= at <= until
    assert math.isnan(found["peak_required"][at]) is (since == 500)


@pytest.mark.parametrize("loosened", [0.55, 0.7])
def test_a_grip_that_loosens_at_once_and_stops_is_no_jump(loosened: float) -> None:
    """The same corner as that of a load that jumps, but q rose because the normal force fell."""
    normal = line((10.0, 10.0, 500), (10.0, 10.0 * loosened, 5), (10.0 * loosened, 10.0 * loosened, 300))
    load = np.full(805, 5.5 * loosened)
    assert slips_at(followed(load, normal)) == []
    (at,) = slips_at(followed(load * 10.0 / normal))  # q is the same
    assert at <= 515


def test_a_slip_ends_when_the_load_leaves_the_plateau() -> None:
    slide = line(RISE, (6.0, 4.5, 3), (4.5, 4.5, 700))
    found = followed(np.concatenate((slide, line((4.5, 3.0, 20), (3.0, 3.0, 300)))))
    end = np.flatnonzero(found["slips"])[-1]
    assert 1503 <= end <= 1525


def test_a_slip_ends_when_a_raised_grip_holds_the_object() -> None:
    """While it slides, R stays as the grip is raised; when it stops, R falls."""
    normal = line((10.0, 10.0, 1000), (10.0, 16.0, 100), (16.0, 16.0, 300))
    load = np.concatenate((line(RISE, (6.0, 4.5, 3), (4.5, 4.5, 197)), np.minimum(0.45 * normal[1000:], 6.0)))
    found = followed(load, normal)
    assert found["slips"][1030]
    assert not found["slips"][1150:].any()


def test_a_slip_without_new_evidence_ends_after_hold_s() -> None:
    found = followed(line(RISE, (6.0, 4.5, 3), (4.5, 4.5, 1500)), settings=Slip(hold_s=0.5))
    count = int(found["slips"].sum())
    assert 495 <= count <= 505


T = np.arange(600) * 1e-3
AT_REST = np.ones(500)


def swing(hz: float, decay: float) -> Array:
    """A load that jumps from 2 to 5 N and swings about that on the springs of the pads."""
    return np.concatenate((2.0 * AT_REST, 5.0 - 3.0 * np.exp(-decay * T) * np.cos(2.0 * np.pi * hz * T)))


def bump(hz: float, decay: float) -> Array:
    """A bump against a load at rest."""
    return np.concatenate((4.0 * AT_REST, 4.0 + 1.5 * np.exp(-decay * T) * np.sin(2.0 * np.pi * hz * T)))


def let_go(held_ms: int, fall_ms: int, low_n: float) -> Array:
    """A pull that is held for a while and let go."""
    return np.concatenate(
        (smooth(2.0, 5.4, 400), np.full(held_ms, 5.4), smooth(5.4, low_n, fall_ms), np.full(400, low_n))
    )


def set_down(ms: int) -> Array:
    return np.concatenate((smooth(0.5, 5.6, 300), smooth(5.6, 0.2, ms), np.full(300, 0.2)))


def push(ms: int) -> Array:
    return np.concatenate((4.0 * AT_REST, 4.0 + 1.6 * np.sin(np.pi * np.linspace(0.0, 1.0, ms)), np.full(300, 4.0)))


def swinging(hz: float) -> Array:
    t = np.arange(4000) * 1e-3
    return 3.5 + 1.5 * np.clip((t - 0.5) / 0.1, 0.0, 1.0) * np.sin(2.0 * np.pi * hz * t)


TIGHTENED = line((10.0, 10.0, 400), (10.0, 25.0, 50), (25.0, 25.0, 300))
CLOSING = np.concatenate((smooth(0.5, 10.0, 200), np.full(300, 10.0)))


@pytest.mark.parametrize(
    ("load", "more"),
    [
        *[(swing(hz, 5.0), {}) for hz in (15.0, 30.0, 60.0)],
        # The trough of a swing that soon dies away is as flat as a plateau, but bent.
        *[(swing(hz, decay), {}) for hz, decay in ((15.0, 20.0), (30.0, 20.0), (45.0, 60.0))],
        *[
            (bump(hz, decay), {"mu": math.nan})
            for hz, decay in ((20.0, 20.0), (25.0, 40.0), (30.0, 60.0), (40.0, 40.0))
        ],
        *[(let_go(50, fall_ms, 2.0), {}) for fall_ms in (3, 10, 40, 200)],
        # Friction that carries a steady load does not give way by itself.
        *[(let_go(900, fall_ms, 4.0), {}) for fall_ms in (3, 10, 40)],
        (np.full(804, 4.2), {"aside": line((0.0, 4.0, 500), (4.0, 0.0, 4), (0.0, 0.0, 300))}),
        *[(set_down(ms), {}) for ms in (30, 100, 300)],
        (np.full(750, 5.4), {"normal": TIGHTENED}),
        (0.5 * np.minimum(CLOSING, 4.0), {"normal": CLOSING}),
        *[(push(ms), {}) for ms in (8, 40)],
        *[(swinging(hz), {}) for hz in (1.0, 4.0, 15.0, 120.0)],
    ],
)
def test_a_load_that_falls_or_jumps_for_another_reason_is_no_slip(load: Array, more: dict[str, Any]) -> None:
    assert [slips_at(followed(load, seed=seed, **more)) for seed in range(3)] == [[]] * 3


def test_the_end_of_the_contact_forgets_a_slip() -> None:
    watch = Watch()
    for load in line(RISE, (6.0, 4.5, 3), (4.5, 4.5, 30)):
        slips = watch.take(load, 10.0, load / 10.0 / MU).slips
    assert slips
    watch.take(0.0, 0.1, math.nan, phase=FREE)
    assert not watch.take(4.5, 10.0, 0.75).slips


def test_a_gap_forgets_what_was_before() -> None:
    load = line(RISE, (4.5, 4.5, 300))
    rows = contact_rows(len(load), load, 10.0, load / 10.0 / MU, np.arange(len(load)) * 1e-3)
    rows["t_s"][800:] += 0.2
    watch = ContactWatch(Levels(), Slip(), 0.001, 0.3)
    watch.assess(rows, MU, Uncertainty(STD_N), 0.0)
    assert not rows["assessment"]["slips"].any()


@pytest.mark.parametrize("size", [1, 7, 100])
def test_reads_of_any_length_give_the_same(size: int) -> None:
    load = line(RISE, (6.0, 4.5, 3), (4.5, 4.5, 100))
    whole = followed(load)
    noise = np.random.default_rng(0).normal(0.0, STD_N, (3, len(load)))
    pulled, pressed = load + noise[0], NORMAL_N + noise[2]
    used = np.hypot(pulled, noise[1]) / pressed / MU
    rows = contact_rows(len(load), pulled, pressed, used, 100.0 + np.arange(len(load)) * 1e-3, aside_n=noise[1])
    watch = ContactWatch(Levels(), Slip(), 0.001, 0.3)
    for first in range(0, len(load), size):
        watch.assess(rows[first : first + size], MU, Uncertainty(STD_N), 0.0)
    for name in whole.dtype.names or ():
        assert np.array_equal(rows["assessment"][name], whole[name], equal_nan=name not in WHOLE_NUMBERS)


@pytest.mark.parametrize("hz", [100.0, 7000.0])
def test_other_rates_see_a_slip_too(hz: float) -> None:
    t = np.arange(round(1.5 * hz)) / hz
    load = np.where(t < 1.0, 3.0 + 3.0 * t, 4.5)
    (at,) = slips_at(followed(load, hz=hz))
    assert 0.0 < at / hz - 1.0 <= (0.06 if hz == 100.0 else 0.02)


def coloured(rng: np.random.Generator, n: int, hz: float, cutoff_hz: float) -> Array:
    """Return noise with a spectrum that is flat up to a frequency and falls beyond, of variance 1, shape (3, n)."""
    spectrum = np.fft.rfft(rng.standard_normal((3, n)))
    spectrum /= np.sqrt(1.0 + (np.fft.rfftfreq(n, 1.0 / hz) / cutoff_hz) ** 2)
    noise = np.fft.irfft(spectrum, n)
    return np.asarray(noise / noise.std())


@pytest.mark.parametrize(
    ("hz", "hours", "std_n", "cutoff_hz", "load_n"),
    [
        (1000.0, 0.5, 0.02, None, 5.0),
        (1000.0, 0.5, 0.1, None, 2.0),
        (1000.0, 0.5, 0.1, 15.0, 5.0),
        (1000.0, 0.5, 0.05, 100.0, 2.0),
        (100.0, 3.0, 0.02, None, 2.0),
        (100.0, 3.0, 0.1, None, 5.0),
        (100.0, 3.0, 0.1, 5.0, 2.0),
    ],
)
def test_F5_noise_is_reported_no_more_often_than_stated(
    hz: float, hours: float, std_n: float, cutoff_hz: float | None, load_n: float
) -> None:
    """The config states one an hour."""
    rng, n = np.random.default_rng(11), round(hours * 3600.0 * hz)
    noise = std_n * (rng.standard_normal((3, n)) if cutoff_hz is None else coloured(rng, n, hz, cutoff_hz))
    found = followed(np.full(n, load_n), hz=hz, noise=noise)
    assert len(slips_at(found)) <= hours
