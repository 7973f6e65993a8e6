"""A load that falls from static to dynamic friction is a slip; loads that fall for other reasons are none."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from chirps import chirp
from load_course import MU, NORMAL_N, Watch, assessed, line, readings, slips_at

from slipd.config import Slip
from slipd.fusion.rows import FREE, UNSOLVED, Rows
from slipd.motion.evidence import evidence_mask
from slipd.types.arrays import Array


def followed(load: Array, normal: Array | float = NORMAL_N, *, settings: Slip | None = None, **how: Any) -> Rows:
    """Return the assessments of a course of the load, N, with noise."""
    return assessed(readings(load, normal, **how), how.get("mu", MU), settings)


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
    assert found["peak_required"][at] == pytest.approx(0.6, rel=0.03)
    assert found["plateau_required"][-1] == pytest.approx(0.6 * ratio, rel=0.02)
    assert (found["evidence"][at], found["level"][at]) == (evidence_mask("load_drop"), 4)


def test_what_does_not_slip_has_no_peak_and_no_surprise() -> None:
    found = followed(line(RISE))
    assert np.isnan((found["peak_required"], found["plateau_required"])).all()
    assert not found["drop_surprise"].any()
    assert found["required_friction"][-1] == pytest.approx(0.6, rel=0.02)


def bunches(count: int, hz: float, size: int) -> Array:
    """Return the times, s, of readings that come in bunches: each spans an eighth of the time that it stands for."""
    number = np.arange(count)
    return np.asarray(((number // size + 1) * size - 1 - 0.12 * (size - 1 - number % size)) / hz)


def jittering(count: int, hz: float, seed: int) -> Array:
    return np.asarray((np.arange(count) + np.random.default_rng(seed).uniform(-0.45, 0.45, count)) / hz)


def bunched(hz: float) -> Array:
    return line((2.0, 6.0, round(0.8 * hz)), (6.0, 4.5, round(0.01 * hz)), (4.5, 4.5, round(0.3 * hz)))


def slow_fall() -> Array:
    part = np.linspace(0.0, 1.0, 90)
    fall = 6.0 * (1.0 - 0.12 * (1.0 - (1.0 - part) ** 2))
    return np.concatenate((np.linspace(2.4, 6.0, 1000), fall, np.full(200, fall[-1])))


def seen(count: int, period: int, lost: int) -> Array:
    """Return the times, s, of readings at 1 kHz of which so many in each period are lost."""
    number = np.arange(2 * count)
    return 1e-3 * number[number % period >= lost][:count]


def steps(seed: int) -> Array:
    """Return the loads of a pad of 40 Hz that sends each reading four times: they are no falls to a plateau."""
    walk = np.cumsum(np.random.default_rng(seed).normal(0.0, 0.2, 300))
    return np.repeat(np.clip(4.0 + walk, 1.0, 5.9), 4)


def far_apart(first_s: float) -> Array:
    t_s = np.arange(1200) / 40.0
    t_s[0] = t_s[1] - first_s
    return t_s


def loosened(share: float) -> Array:
    """Return the normal force of a grip that loosens at once and stops."""
    return line((10.0, 10.0, 500), (10.0, 10.0 * share, 5), (10.0 * share, 10.0 * share, 300))


SLIDE = line(RISE, (6.0, 4.5, 3), (4.5, 4.5, 700))
RAISED = line((10.0, 10.0, 1000), (10.0, 16.0, 100), (16.0, 16.0, 300))
LOOSENED = line((10.0, 5.0, 1000), (5.0, 4.8, 200))


@pytest.mark.parametrize(
    ("load", "how", "since_s", "until_s", "ends_s"),
    [
        # A slow contact breaks loose over some milliseconds.
        *[
            (line((4.0, 6.0, 1500), (6.0, 4.5, ms), (4.5, 4.5, 200)), {}, 1.5, 1.512 + 3e-3 * ms, None)
            for ms in (2, 10, 20)
        ],
        (np.where(np.arange(1200) < 1000, 3.0, 0.45 * LOOSENED), {"normal": LOOSENED}, 1.0, 1.02, None),
        # A wet object slips far below the believed friction.
        (line((1.0, 2.4, 800), (2.4, 1.8, 3), (1.8, 1.8, 300)), {}, 0.803, 0.84, None),
        # A load that jumps beyond the limit shows no peak.
        (line((2.0, 2.0, 500), (2.0, 5.5, 5), (5.5, 5.4, 300)), {}, 0.5, 0.51, None),
        *[(55.0 * share / loosened(share), {}, 0.5, 0.515, None) for share in (0.55, 0.7)],
        # A slip ends where the load leaves the plateau, and without new evidence after hold_s.
        (np.concatenate((SLIDE, line((4.5, 3.0, 20), (3.0, 3.0, 300)))), {}, 0.803, 0.825, 1.514),
        (line(RISE, (6.0, 4.5, 3), (4.5, 4.5, 1500)), {"settings": Slip(hold_s=0.5)}, 0.803, 0.825, 1.31),
        # While it slides, R stays as the grip is raised; when that holds the object, R falls.
        (np.concatenate((SLIDE[:1000], np.minimum(0.45 * RAISED[1000:], 6.0))), {"normal": RAISED}, 0.8, 0.825, 1.09),
        # Other rates, bunches of readings, and jitter: the rate of a fall needs the mean of its steps of time.
        *[
            (np.where(t_s < 1.0, 3.0 + 3.0 * t_s, 4.5), {"hz": hz}, 1.0, 1.0 + within_s, None)
            for hz, within_s in ((100.0, 0.06), (7000.0, 0.02)) for t_s in [np.arange(round(1.5 * hz)) / hz]
        ],
        *[
            (bunched(hz), {"t_s": bunches(len(bunched(hz)), hz, size), "seed": seed}, 0.8, 0.8 + within_s, None)
            for hz, size, within_s in ((100.0, 2, 0.04), (100.0, 4, 0.08), (400.0, 8, 0.04)) for seed in range(2)
        ],
        *[(slow_fall(), {"t_s": jittering(1290, 1000.0, seed), "seed": 5}, 1.0, 1.09, None) for seed in range(3)],
    ],
)  # fmt: skip
def test_other_slips_are_reported_soon_and_end(
    load: Array, how: dict[str, Any], since_s: float, until_s: float, ends_s: float | None
) -> None:
    found = followed(load, **how)
    (at,) = slips_at(found)
    t_s = how.get("t_s", np.arange(len(load)) / how.get("hz", 1000.0))
    assert since_s <= t_s[at] <= until_s
    assert ends_s is None or t_s[np.flatnonzero(found["slips"])[-1]] == pytest.approx(ends_s, abs=0.03)
    assert math.isnan(found["peak_required"][at]) is (until_s in (0.51, 0.515))


@pytest.mark.parametrize(
    ("load", "how", "shaken_n", "expected"),
    [
        (line(RISE, (6.0, 4.5, 3), (4.5, 4.5, 300)), {}, 0.0, (807, 837.534, 0.594095, 0.450723, 0.449608)),
        (line(RISE, (6.0, 4.5, 8), (4.5, 4.5, 300)), {}, 0.15, (811, 702.737, 0.590113, 0.456267, 0.449858)),
        (
            line(RISE, (6.0, 4.9, 8), (4.9, 4.8, 300)), {"t_s": seen(1108, 5, 2)}, 0.05,
            (811, 327.404, 0.590270, 0.491965, 0.481669),
        ),
        (
            line(RISE, (6.0, 4.5, 8), (4.5, 4.4, 300)), {"t_s": seen(1108, 24, 9), "mu": 1.1}, 0.05,
            (831, 1169.92, 0.594060, 0.456988, 0.441567),
        ),
        (
            line((2.0, 6.0, 200), (6.0, 4.5, 3), (4.5, 4.5, 100)), {"hz": 250.0}, 0.05,
            (203, 350.884, 0.599760, 0.443592, 0.450528),
        ),
        (line((2.0, 2.0, 500), (2.0, 5.5, 5), (5.5, 5.4, 300)), {}, 0.02, (507, 1310.54, math.nan, 0.549540, 0.541004)),
        (
            line((2.5, 2.5, 500), (2.5, 5.0, 6), (5.0, 4.5, 4), (4.5, 4.5, 300)), {}, 0.01,
            (519, 59.2115, math.nan, 0.449372, 0.449958),
        ),
        (
            slow_fall()[:1090], {}, 0.01,
            (1071, 270.054, 0.596407, 0.537894, 0.527802),
        ),
    ],
)  # fmt: skip
def test_the_surprise_of_a_slip_beside_noise_and_vibration_keeps_its_digits(
    load: Array, how: dict[str, Any], shaken_n: float, expected: tuple[float, ...]
) -> None:
    """At which reading; surprise, peak and plateau there; and the plateau in the end."""
    count = len(load)
    noise = 0.08 * chirp(3, count) + shaken_n * np.sin(0.9 * np.arange(count))
    found = followed(load, noise=noise, **how)
    (at,) = slips_at(found)
    told = (found[name][at] for name in ("drop_surprise", "peak_required", "plateau_required"))
    assert (at, *told, found["plateau_required"][-1]) == pytest.approx(expected, rel=1e-4, nan_ok=True)


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


NO_SLIPS: list[tuple[Array, dict[str, Any]]] = [
    *[(swing(hz, 5.0), {}) for hz in (15.0, 30.0, 60.0)],
    # The trough of a swing that soon dies away is as flat as a plateau, but bent.
    *[(swing(hz, decay), {}) for hz, decay in ((15.0, 20.0), (30.0, 20.0), (45.0, 60.0))],
    *[(bump(hz, decay), {"mu": math.nan}) for hz, decay in ((20.0, 20.0), (25.0, 40.0), (30.0, 60.0), (40.0, 40.0))],
    *[(let_go(50, fall_ms, 2.0), {}) for fall_ms in (3, 10, 40, 200)],
    # Friction that carries a steady load does not give way by itself.
    *[(let_go(900, fall_ms, 4.0), {}) for fall_ms in (3, 10, 40)],
    (np.full(804, 4.2), {"aside": line((0.0, 4.0, 500), (4.0, 0.0, 4), (0.0, 0.0, 300))}),
    *[(set_down(ms), {}) for ms in (30, 100, 300)],
    (np.full(750, 5.4), {"normal": TIGHTENED}),
    (0.5 * np.minimum(CLOSING, 4.0), {"normal": CLOSING}),
    *[(push(ms), {}) for ms in (8, 40)],
    *[(swinging(hz), {}) for hz in (1.0, 4.0, 15.0, 120.0)],
    # A grip that loosens at once: the same corner as that of a load that jumps, but the normal force fell.
    *[(np.full(805, 5.5 * share), {"normal": loosened(share)}) for share in (0.55, 0.7)],
    # A gap forgets what was before, and readings too far apart show no fall, whatever the first step of time was.
    (line(RISE, (4.5, 4.5, 300)), {"std_n": 0.0, "t_s": 1e-3 * np.arange(1100) + 0.2 * (np.arange(1100) >= 800)}),
    *[(steps(seed), {"std_n": 0.002, "t_s": far_apart(s)}) for s in (0.025, 0.002) for seed in range(3)],
]
"""Loads that fall or jump for another reason, and how they are read."""


@pytest.mark.parametrize(("load", "more"), NO_SLIPS)
def test_a_load_that_falls_or_jumps_for_another_reason_is_no_slip(load: Array, more: dict[str, Any]) -> None:
    assert [slips_at(followed(load, seed=seed, **more)) for seed in range(3)] == [[]] * 3


def test_the_end_of_the_contact_forgets_a_slip() -> None:
    watch = Watch()
    for load in line(RISE, (6.0, 4.5, 3), (4.5, 4.5, 30)):
        slips = watch.take(load, 10.0, load / 10.0 / MU).slips
    assert slips
    watch.take(0.0, 0.1, math.nan, phase=FREE)
    assert not watch.take(4.5, 10.0, 0.75).slips


@pytest.mark.parametrize("size", [1, 7, 100])
def test_reads_of_any_length_give_the_same(size: int) -> None:
    rows = readings(line(RISE, (6.0, 4.5, 3), (4.5, 4.5, 100)))
    whole, parts = assessed(rows.copy()), assessed(rows, size=size)
    for name in whole.dtype.names or ():
        assert np.array_equal(parts[name], whole[name], equal_nan=name not in WHOLE_NUMBERS)


def coloured(rng: np.random.Generator, n: int, hz: float, cutoff_hz: float) -> Array:
    """Return noise with a spectrum that is flat up to a frequency and falls beyond, of variance 1, shape (3, n)."""
    spectrum = np.fft.rfft(rng.standard_normal((3, n)))
    spectrum /= np.sqrt(1.0 + (np.fft.rfftfreq(n, 1.0 / hz) / cutoff_hz) ** 2)
    noise = np.fft.irfft(spectrum, n)
    return np.asarray(noise / noise.std())


@pytest.mark.parametrize(
    ("hz", "hours", "std_n", "cutoff_hz", "load_n"),
    [
        (1000.0, 0.02, 0.1, 15.0, 5.0),
        (100.0, 0.2, 0.1, None, 5.0),
        *(
            pytest.param(*row, marks=pytest.mark.statistics)
            for row in (
                (1000.0, 0.25, 0.02, None, 5.0),
                (1000.0, 0.25, 0.1, None, 2.0),
                (1000.0, 0.25, 0.1, 15.0, 5.0),
                (1000.0, 0.25, 0.05, 100.0, 2.0),
                (100.0, 2.0, 0.02, None, 2.0),
                (100.0, 2.0, 0.1, None, 5.0),
                (100.0, 2.0, 0.1, 5.0, 2.0),
            )
        ),
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


def with_a_silence(load: Array, begin: int, count: int, *, late_image: bool) -> list[int]:
    """Return at which readings of a course at 1 kHz a slip begins, with readings or images missing."""
    rows, there = readings(load, seed=3), np.ones(len(load), dtype=bool)
    there[begin : begin + count] = late_image
    rows["utilisation"]["kind"][begin : begin + count] = UNSOLVED
    return np.flatnonzero(there)[slips_at(assessed(rows[there]))].tolist()


@pytest.mark.parametrize(
    ("begin", "count", "within"), [(770, 15, 815), (780, 3, 815), (795, 20, 845), (740, 50, 815), (400, 1000, 815)]
)
def test_a_slip_is_seen_across_late_images_and_without_any(begin: int, count: int, within: int) -> None:
    """On a busy machine, images that came 15 ms late hid a slip of 14 mm on both fingers."""
    (at,) = with_a_silence(line(RISE, (6.0, 4.5, 3), (4.5, 4.5, 300)), begin, count, late_image=True)
    assert 803 <= at <= within


@pytest.mark.parametrize("late_image", [False, True])
@pytest.mark.parametrize(("hz", "decay"), [(15.0, 20.0), (45.0, 60.0)])
@pytest.mark.parametrize("begin", [500, 510, 530])
def test_a_load_that_jumps_and_swings_in_a_silence_is_no_slip(
    begin: int, hz: float, decay: float, late_image: bool
) -> None:
    """A crest without its rise, next to what was before, looked like a fall to a plateau."""
    t_s = np.arange(600) * 1e-3
    swing = 5.0 - 3.0 * np.exp(-decay * t_s) * np.cos(2.0 * np.pi * hz * t_s)
    course = np.concatenate((np.full(500, 2.0), swing))
    assert with_a_silence(course, begin, 30, late_image=late_image) == []


@pytest.mark.parametrize(("size", "std_n"), [(4, 0.06), (2, 0.1)])
def test_F5_noise_in_bunches_is_no_slip(size: int, std_n: float) -> None:
    """In 36 minutes. It is larger than stated, and the lines that join the bunches have none of it."""
    load = np.full(72_000, 5.0)
    t_s = bunches(len(load), 100.0, size)
    found = [slips_at(assessed(readings(load, t_s=t_s, std_n=std_n, seed=seed))) for seed in range(3)]
    assert sum(map(len, found)) <= 1
