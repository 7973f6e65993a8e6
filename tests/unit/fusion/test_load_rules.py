"""Where each rule about a load that falls or jumps begins and ends, without noise."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from load_course import MU, assessed, contact_rows, line, readings, slips_at

from slipd.types.arrays import Array

RISE, HELD = (2.0, 6.0, 800), (4.8, 4.8, 300)
FALL = (6.0, 4.8, 3), HELD
REST, SETTLED = (2.0, 2.0, 500), (4.5, 4.5, 300)
OVERSHOT = (2.0, 5.0, 6), (5.0, 4.5, 4)
ODD = {"mu": 1.2}
"""The peak is far below the friction that is believed: a plateau must last longer."""
AT = np.arange(1103)


def gripped(begin_n: float, end_n: float, since: int, within: int, count: int) -> Array:
    """Return the normal force of a grip that changes within some readings, since one of them."""
    return np.interp(np.arange(count), (since, since + within), (begin_n, end_n))


def bent(depth_n: float) -> Array:
    """Return a load whose plateau is bent like a trough."""
    return np.concatenate(
        (line(RISE, FALL[0]), 4.8 + depth_n * np.linspace(-1.0, 1.0, 60) ** 2, np.full(100, 4.8 + depth_n))
    )


Found = dict[float, int | None]
"""Value of what is varied, and at which reading a slip is reported; None: at none."""

LOADS: dict[str, tuple[Callable[[Any], tuple[Array, dict[str, Any]]], Found]] = {
    "a fall by this share": (
        lambda s: (line(RISE, (6.0, 6.0 * (1.0 - s), 3), (6.0 * (1.0 - s), 6.0 * (1.0 - s), 300)), {}),
        {
            0.031094: None,
            0.03125: None,
            0.03273: None,
            0.03293: 835,
            0.11: 807,
            0.31: 807,
            0.4031: 812,
            0.4056: None,
            0.51: None,
        },
    ),
    "a fall within so many ms": (
        lambda s: (line(RISE, (6.0, 4.8, s), HELD), {}),
        {12: 814, 32: 839, 52: 859},
    ),
    "likewise, where mu is unknown": (
        lambda s: (line(RISE, (6.0, 4.8, s), HELD), {"mu": math.nan}),
        {12: 815, 32: 839, 52: 859},
    ),
    "likewise within 12 ms, where mu is this": (
        lambda s: (line(RISE, (6.0, 4.8, 12), HELD), {"mu": s}),
        {0.603: 814, 1.01: 830, 1.42: 837},
    ),
    "a plateau of so many ms": (
        lambda s: (line(RISE, *FALL[:1], (4.8, 4.8, s), (4.8, 1.0, 20), (1.0, 1.0, 100)), {}),
        {1: None, 3: 807, 11: 807, 31: 807, 51: 807},
    ),
    "a plateau that falls on by so much in 40 ms, N": (
        lambda s: (line(RISE, (6.0, 4.8, 3), (4.8, 4.8 - s, 40), (4.8 - s, 4.8 - s, 260)), ODD),
        {0.203: 832, 0.5294: 838, 0.5326: None, 0.61: None, 1.02: None},
    ),
    "a plateau that swings, N": (
        lambda s: (line(RISE, *FALL) + s * np.sin(0.4 * AT) * (AT > 803), ODD),
        {0.102: 832, 0.2637: 833, 0.2653: None, 0.305: None, 0.508: None},
    ),
    "a plateau that is bent, N": (
        lambda s: (
            np.concatenate(
                (line(RISE, (6.0, 4.8, 3)), 4.8 + s * np.linspace(-1.0, 1.0, 60) ** 2, np.full(100, 4.8 + s))
            ),
            ODD,
        ),
        {0.271: 832, 0.464: 839, 0.4668: None, 0.814: None, 1.36: None},
    ),
    "a rise before the fall, N": (
        lambda s: (line((6.0 - s, 6.0 - s, 800), (6.0 - s, 6.0, 300), *FALL), {}),
        {0.03: None, 0.1043: None, 0.1049: 1123, 0.154: 1107, 0.513: 1107, 0.846: 1107},
    ),
    "a hold before the fall, ms": (
        lambda s: (line(RISE, (6.0, 6.0, s + 1), *FALL), {}),
        {60: 868, 120: 937, 130: 963, 137: 970, 138: None, 200: None, 330: None},
    ),
    "a peak after so many times that load was carried": (
        lambda s: (line((1.0, 6.0 * s, 300), (6.0 * s, 2.0, 300), (2.0, 6.0, 800), *FALL), {}),
        {0.923: 1407, 1.096: 1407, 1.103: None, 1.21: None, 1.48: None},
    ),
    "a swing before, N": (
        lambda s: (line((2.0, 3.0, 300), (3.0, 3.0 - s, 60), (3.0 - s, 3.0, 60), (3.0, 6.0, 500), *FALL), {}),
        {0.308: 927, 1.03: 927, 1.4295: 927, 1.4359: None, 1.69: None},
    ),
    "a load that came down from a top by so much first, N": (
        lambda s: (line((2.0, 6.0 + s, 700), (6.0 + s, 6.0, 90), *FALL), {}),
        {0.136: 806, 0.407: 811, 0.678: 815},
    ),
    "a grip that grows tighter by this share meanwhile": (
        lambda s: (
            line(RISE, *FALL),
            {"normal": gripped(10.0, 10.0 * (1.0 + s), 800, 2, 1103)},
        ),
        {0.0462: 807, 0.05655: 807, 0.05689: None, 0.154: None, 0.254: None},
    ),
    "a grip that closed by this share just before": (
        lambda s: (
            line(RISE, *FALL),
            {
                "normal": line(
                    (10.0, 10.0, 760), (10.0, 10.0 * (1.0 + s), 30), (10.0 * (1.0 + s), 10.0 * (1.0 + s), 313)
                )
            },
        ),
        {0.0462: 807, 0.07351: 840, 0.07396: None, 0.154: None, 0.254: None},
    ),
    "a load that grows aside, N": (
        lambda s: (line(RISE, *FALL), {"aside": line((0.0, 0.0, 800), (0.0, s, 3), (s, s, 300))}),
        {0.308: 807, 0.59295: 807, 0.59615: None, 1.03: None, 1.69: None},
    ),
    "a rise just before the fall within so many ms": (
        lambda s: (line((2.0, 4.0, 800), (4.0, 6.0, s), (6.0, 4.8, 12), HELD), {}),
        {17: 841, 19: 850, 20: None, 53: None, 64: None, 65: 883, 68: 887, 86: 903},
    ),
    "likewise before a sudden fall": (
        lambda s: (line((2.0, 4.0, 800), (4.0, 6.0, s), (6.0, 4.8, 2), HELD), {}),
        {12: 824, 26: 838, 27: None, 40: None, 69: None, 70: 887, 80: 895},
    ),
    "readings so many ms apart": (
        lambda s: (line((2.0, 6.0, round(800 / s)), (6.0, 4.8, 2), (4.8, 4.8, round(600 / s))), {"hz": 1000.0 / s}),
        {4.0: 202, 10.5: 78, 12.0: 69, 13.0: None, 17.0: None},
    ),
    "a jump to this load, N": (
        lambda s: (line(REST, (2.0, s, 5), (s, s, 300)), {}),
        {3.4: None, 4.068: None, 4.092: 507, 5.3: 507, 7.1: 507},
    ),
    "a jump within so many ms": (
        lambda s: (line(REST, (2.0, 5.5, s), (5.5, 5.4, 300)), {}),
        {8: 510, 22: 532, 26: 535, 27: None, 35: None},
    ),
    "a jump after this load was carried, N": (
        lambda s: (line((1.0, s, 400), (s, 2.0, 300), (2.0, 2.0, 200), (2.0, 5.5, 5), (5.5, 5.4, 300)), {}),
        {4.31: 907, 5.03: 907, 5.392: 907, 5.425: None, 5.69: None},
    ),
    "a jump that falls back by so much in 40 ms, N": (
        lambda s: (line(REST, (2.0, 5.5, 5), (5.5, 5.5 - s, 40), (5.5 - s, 5.5 - s, 260)), {}),
        {1.02: 507, 3.05: 507, 5.017: 507, 5.047: None, 5.08: None},
    ),
    "a jump that swings, N": (
        lambda s: (line(REST, (2.0, 5.5, 5), (5.5, 5.5, 300)) + s * np.sin(1.3 * AT[:805]) * (AT[:805] > 505), {}),
        {0.05: 507, 0.254: 507, 0.266: 507, 0.2676: None, 0.763: None, 1.27: None},
    ),
    "a jump after a swing, N": (
        lambda s: (line((3.0, 3.0 - s, 100), (3.0 - s, 3.0, 100), (3.0, 3.0, 300), (3.0, 5.0, 5), (5.0, 5.0, 300)), {}),
        {0.508: 507, 1.53: 507, 2.372: 507, 2.386: None, 2.54: None},
    ),
    "a jump while the grip loosens by so much, N": (
        lambda s: (
            line(REST, (2.0, 5.0, 5), (5.0, 5.0, 300)),
            {"normal": gripped(10.0 + s, 10.0, 500, 4, 805)},
        ),
        {2.03: 507, 5.982: 507, 6.018: None, 6.1: None, 10.2: None},
    ),
    "an overshoot by this share": (
        lambda s: (line(REST, (2.0, 4.5 * (1.0 + s), 6), (4.5 * (1.0 + s), 4.5, 4), SETTLED), {}),
        {0.02: 508, 0.136: 519, 0.407: 520, 0.6251: 531, 0.6288: None, 0.678: None},
    ),
    "an overshoot to this load, N": (
        lambda s: (line((0.4 * s, 0.4 * s, 500), (0.4 * s, 1.12 * s, 6), (1.12 * s, s, 4), (s, s, 300)), {}),
        {2.77: None, 4.068: None, 4.092: 519, 4.56: 519, 6.23: 520},
    ),
    "an overshoot within so many ms": (
        lambda s: (line(REST, (2.0, 5.0, s), (5.0, 4.5, s), SETTLED), {}),
        {2: 506, 3: 516, 5: 519, 11: 530, 17: 541, 23: 562, 24: None, 30: None},
    ),
    "an overshoot that falls on by so much in 40 ms, N": (
        lambda s: (line(REST, *OVERSHOT, (4.5, 4.5 - s, 40), (4.5 - s, 4.5 - s, 260)), {}),
        {-0.397: None, -0.1945: None, -0.1933: 519, 0.0102: 519, 0.417: 535},
    ),
    "an overshoot after a rise from this load, N": (
        lambda s: (line((s, s, 500), (s, 5.0, 6), (5.0, 4.5, 4), SETTLED), {}),
        {1.86: 519, 2.57: 519, 3.28: 519, 3.825: 519, 3.848: None, 4.2: None},
    ),
}


@pytest.mark.parametrize("name", LOADS)
def test_a_load_in_newtons_is_a_slip_within_these_limits(name: str) -> None:
    course, expected = LOADS[name]
    found: Found = {}
    for value in expected:
        load, how = course(value)
        slips = slips_at(assessed(readings(load, std_n=0.0, **how), how.get("mu", MU)))
        found[value] = slips[0] if slips else None
    assert found == expected


def fall(share: float = 0.12, ms: int = 90, power: float = 2.0, begin: float = 0.4) -> Array:
    """Return q / μ that rises to 1 within a second, falls ever more slowly, and stays."""
    part = np.linspace(0.0, 1.0, ms)
    return np.concatenate(
        (np.linspace(begin, 1.0, 1000), 1.0 - share * (1.0 - (1.0 - part) ** power), np.full(200, 1.0 - share))
    )


def let_go(count: int) -> Array:
    """Return q / μ of a load that is let go: it falls ever faster."""
    part = np.linspace(0.0, 1.0, count)
    down = 0.95 - 0.45 * part * part * (3.0 - 2.0 * part)
    return np.asarray(np.concatenate([np.linspace(0.4, 0.95, 1000), down, np.full(200, 0.5)]))


def push(held_ms: int, let_go_ms: int) -> Array:
    """Return q / μ of a push that is held and let go within a tenth of a second."""
    up, down = np.linspace(0.0, np.pi, 120), np.linspace(0.0, np.pi, let_go_ms)
    parts = [0.5 - 0.5 * np.cos(up), np.full(held_ms, 1.0), 0.5 + 0.5 * np.cos(down), np.zeros(200)]
    return np.asarray(0.69 + 0.41 * np.concatenate([np.zeros(500), *parts]))


def swung_on() -> Array:
    """Return q / μ of a weight that comes on and swings on the springs of the pads, beyond a mu stated too low."""
    t = np.arange(1000) * 1e-3
    on = 0.75 * np.clip(t / 0.15, 0.0, 1.0) ** 2 * (3.0 - 2.0 * np.clip(t / 0.15, 0.0, 1.0))
    ring = -0.08 * np.exp(-6.0 * (t - 0.15)) * np.sin(2.0 * np.pi * 11.0 * (t - 0.15)) * (t > 0.15)
    return np.asarray(np.concatenate([np.full(300, 0.02), 0.02 + on - ring]))


SUPPORTED = np.concatenate((fall()[:1000], np.full(150, 1.0), fall()[1000:]))
"""Somebody holds a pull for a moment and then supports the object a little."""
FAR_BELOW = np.concatenate((np.full(800, 0.9), np.linspace(0.9, 0.5, 300), 0.7 * fall()))
T = np.arange(3000) * 1e-3


FALLS: dict[str, tuple[Callable[[Any], tuple[Array, dict[str, Any]]], Found]] = {
    "by this share": (
        lambda s: (fall(s), {}),
        {
            0.024: None,
            0.0267: None,
            0.03084: None,
            0.03103: 1091,
            0.04266: 1047,
            0.106: 1031,
            0.308: 1031,
            0.4797: 1051,
            0.4826: None,
            0.509: None,
        },
    ),
    "within so many ms": (
        lambda s: (fall(ms=s), {}),
        {60: 1023, 160: 1051, 230: 1071, 260: 1083, 383: 1123, 384: None, 400: None},
    ),
    "that slows down with this power": (
        lambda s: (fall(power=s), {}),
        {1.17: 1083, 1.51: 1051, 1.85: 1035},
    ),
    "likewise, by a third": (
        lambda s: (fall(0.34, power=s), {}),
        {1.24: 1095, 1.71: 1039, 2.19: 1027},
    ),
    "from this share of mu": (
        lambda s: (fall(), {"mu": MU / s}),
        {0.569: None, 0.67966: None, 0.68178: 1031, 0.908: 1031, 1.25: 1031},
    ),
    "after a rise by this share in a second": (
        lambda s: (fall(begin=1.0 - s), {}),
        {0.03: None, 0.06009: None, 0.06045: 1031, 0.0678: 1031, 0.203: 1031, 0.339: 1031},
    ),
    "while the grip loosens by so much, N": (
        lambda s: (fall(power=1.55), {"shear_n": 4.0, "normal_n": np.linspace(10.0 + s, 10.0, 1290)}),
        {0.678: 1079, 2.03: 1051, 3.39: 1047},
    ),
    "while the grip grows tighter by this share": (
        lambda s: (
            fall(),
            {
                "normal_n": line(
                    (10.0, 10.0, 1000), (10.0, 10.0 * (1.0 + s), 90), (10.0 * (1.0 + s), 10.0 * (1.0 + s), 200)
                )
            },
        ),
        {0.03125: 1059, 0.031356: None, 0.0339: None, 0.102: None, 0.169: None},
    ),
    "after a rise by this share in a tenth of a second": (
        lambda s: (np.concatenate((line((0.4, 1.0 - s, 900), (1.0 - s, 1.0, 100)), fall()[1000:])), {}),
        {0.0045882: None, 0.0046081: 1031, 0.0508: 1031, 0.153: 1035, 0.59: 1035},
    ),
    "after so many times that load was carried": (
        lambda s: (np.concatenate((line((0.2, s, 800), (s, 0.4, 300)), fall())), {}),
        {0.902: 2163, 1.0136: 2195, 1.0186: None, 1.11: None, 1.31: None},
    ),
    "while the shear grows, at this share of mu": (
        lambda s: (fall(0.06), {"mu": MU / s}),
        {0.83: 1035, 1.0: 1035, 1.25: 1035},
    ),
    "of a load that is let go within so many ms": (
        lambda s: (let_go(s), {"shear_n": 10.0 * MU * let_go(s)}),
        {50: None, 90: None, 150: None},
    ),
    "of a load that is supported, at this share of mu": (
        lambda s: (SUPPORTED, {"mu": MU / s, "shear_n": 10.0 * MU * SUPPORTED}),
        {1.0: None},
    ),
    "of a push that is held and let go within so many ms": (
        lambda s: (push(s, s), {"shear_n": 10.0 * MU * push(s, s)}),
        {50: None, 60: None},
    ),
    "of a weight that comes on and swings, at this share of mu": (
        lambda s: (swung_on(), {"mu": MU * s, "shear_n": 10.0 * MU * swung_on()}),
        {0.88: 519, 0.89: None, 1.0: None},
    ),
    "of a swing near the limit, Hz": (
        lambda s: (0.8 + 0.1 * np.sin(2.0 * np.pi * s * T), {"shear_n": 3.0 + 0.5 * np.sin(0.74 * np.pi * s * T)}),
        {1.5: None, 4.0: None, 9.0: None},
    ),
    "while the load goes aside, N": (
        lambda s: (fall(), {"shear_n": 4.0, "aside_n": np.interp(np.arange(1290), (1000, 1089), (0.0, s))}),
        {3.0: None},
    ),
    "far below what was carried": (lambda s: (s * FAR_BELOW, {}), {1.0: None}),
}


@pytest.mark.parametrize("name", FALLS)
def test_a_slow_fall_of_the_required_friction_is_a_slip_within_these_limits(name: str) -> None:
    course, expected = FALLS[name]
    found: Found = {}
    for value in expected:
        used, how = course(value)
        mu, count = how.get("mu", MU), len(used)
        shear_n = how.get("shear_n", np.linspace(1.5, 4.0, count))
        times_s = 100.0 + 1e-3 * np.arange(count)
        slips = slips_at(
            assessed(
                contact_rows(
                    count, shear_n, how.get("normal_n", 10.0), MU * used / mu, times_s, aside_n=how.get("aside_n", 0.0)
                ),
                mu,
            )
        )
        found[value] = slips[0] if slips else None
    assert found == expected


def test_noise_alone_in_ten_minutes_of_a_hold_is_no_slow_fall() -> None:
    """One false alarm an hour is the risk: two in ten minutes have a chance of 1 in 80."""
    rng, count = np.random.default_rng(0), 600_000
    used, pulled_n, pressed_n = rng.normal((0.9, 3.0, 10.0), (0.002 / MU, 0.02, 0.02), (count, 3)).T
    rows = contact_rows(count, pulled_n, pressed_n, used, 100.0 + 1e-3 * np.arange(count))
    assert len(slips_at(assessed(rows))) <= 1
