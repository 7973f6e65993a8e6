"""Times of acquisition from a device's clock: error and bound of slipd's, of the receipt, and of other estimators.

All are asked about the same readings, one after another, as a daemon would. The others get the restarts told.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from bench.tables import Table
from chart.clocks_streams import BOOT_NS, Stream, Times

from slipd.signals.clock import DeviceClock
from slipd.types.arrays import Array

if TYPE_CHECKING:
    from matplotlib.figure import SubFigure


SECONDS, QUICK_SECONDS = 120.0, 3.0
SEEDS = 8
POLL_S = 0.016  # of a USB serial adapter as it comes
CASES = {
    "1 kHz": Stream(1000.0, ppm=20.0),
    "1 kHz, +500 ppm": Stream(1000.0, ppm=500.0, warming_ppm=5.0),
    "1 kHz, −500 ppm, 16 ms polls": Stream(1000.0, ppm=-500.0, poll_s=POLL_S),
    "100 Hz, 16 ms polls": Stream(100.0, ppm=120.0, poll_s=POLL_S),
    "1 kHz, resets": Stream(1000.0, ppm=120.0, resets_s=((3.7, 0.0), (8.2, 4000.0), (60.0, 0.0), (100.0, 50.0))),
    "500 Hz, 16 ms polls, stalls": Stream(500.0, ppm=-120.0, poll_s=POLL_S, stall_every_s=5.0),
    "30 Hz, clock of 1 ms": Stream(30.0, ppm=50.0, delay_s=3e-4, tick_ns=1_000_000),
    "60 Hz, lognormal 2 ms": Stream(60.0, ppm=50.0, delay_s=2e-3, delay="lognormal"),
    "1 kHz, Pareto 1 ms": Stream(1000.0, ppm=50.0, delay_s=1e-3, delay="pareto"),
}
LONGEST_STALL_NS = 11_000_000_000
WINDOW_NS = 8_000_000_000  # of the rivals, as long as slipd's


class Estimator(Protocol):
    """Tells times of acquisition on line."""

    def map(self, device_time_ns: int, receipt_ns: int) -> int: ...


class Receipt:
    """Takes the receipt for it."""

    def map(self, device_time_ns: int, receipt_ns: int) -> int:
        return receipt_ns


class _Windowed:
    """Keeps a window of the last pair of each receipt, begun anew when the device's clock jumps."""

    def __init__(self) -> None:
        self._before = (0, 0)
        self._begin()

    def _begin(self) -> None:
        self._pairs: deque[tuple[int, int]] = deque()

    def _take(self, device_ns: int, receipt_ns: int) -> None:
        """Takes a pair; a jump back, or ahead by more than the longest stall, counts as told."""
        step = device_ns - self._before[0]
        if step < 0 or abs(step - (receipt_ns - self._before[1])) > LONGEST_STALL_NS:
            self._begin()
        self._before = device_ns, receipt_ns
        if self._pairs and self._pairs[-1][1] == receipt_ns:
            self._pairs.pop()
        self._pairs.append((device_ns, receipt_ns))
        while self._pairs[0][1] < receipt_ns - WINDOW_NS:
            self._pairs.popleft()


class WindowMinimum(_Windowed):
    """The least lag of the window; no rate."""

    def _begin(self) -> None:
        super()._begin()
        self._rising: deque[tuple[int, int]] = deque()  # lag and receipt, the least first

    def map(self, device_time_ns: int, receipt_ns: int) -> int:
        self._take(device_time_ns, receipt_ns)
        lag = receipt_ns - device_time_ns
        while self._rising and self._rising[-1][0] >= lag:
            self._rising.pop()
        self._rising.append((lag, receipt_ns))
        while self._rising[0][1] < receipt_ns - WINDOW_NS:
            self._rising.popleft()
        return device_time_ns + self._rising[0][0]


class LeastSquares(_Windowed):
    """A line through the window's pairs, by running sums about its first pair."""

    def map(self, device_time_ns: int, receipt_ns: int) -> int:
        new_read = receipt_ns != self._before[1]
        self._take(device_time_ns, receipt_ns)
        if new_read or not hasattr(self, "_line"):
            d0, r0 = self._pairs[0]
            pairs = np.array(self._pairs if len(self._pairs) < 64 else list(self._pairs)[:: len(self._pairs) // 64])
            x, y = (pairs[:, 0] - d0) * 1e-9, (pairs[:, 1] - pairs[:, 0] - (r0 - d0)) * 1e-9
            spread = float(((x - x.mean()) ** 2).sum())
            slope = float(((x - x.mean()) * y).sum()) / spread if spread > 0.0 else 0.0
            self._line = d0, r0 - d0, slope, float(y.mean() - slope * x.mean())
        d0, lag, slope, height = self._line
        past_s = (device_time_ns - d0) * 1e-9
        return device_time_ns + lag + round(1e9 * (height + slope * past_s))


class Kalman(_Windowed):
    """Offset and rate by a Kalman filter on the lag of each read; the rate walks by 1e-8 a root second."""

    def _begin(self) -> None:
        super()._begin()
        self._state: tuple[Array, Array, int, int] | None = None

    def map(self, device_time_ns: int, receipt_ns: int) -> int:
        new_read = receipt_ns != self._before[1]
        self._take(device_time_ns, receipt_ns)
        if self._state is None:
            self._state = np.zeros(2), np.diag((1e-4, 1e-6)), device_time_ns, receipt_ns - device_time_ns
        mean, spread, at_ns, lag = self._state
        past_s = (device_time_ns - at_ns) * 1e-9
        if new_read and past_s > 0.0:
            turn = np.array(((1.0, past_s), (0.0, 1.0)))
            mean, spread = turn @ mean, turn @ spread @ turn.T + np.diag((0.0, 1e-16 * past_s))
            gain = spread[:, 0] / (spread[0, 0] + KALMAN_NOISE_S**2)
            mean = mean + gain * ((receipt_ns - device_time_ns - lag) * 1e-9 - mean[0])
            spread = spread - np.outer(gain, spread[0])
            self._state, past_s = (mean, spread, device_time_ns, lag), 0.0
        return device_time_ns + lag + round(1e9 * float(mean[0] + mean[1] * past_s))


KALMAN_NOISE_S = 2e-3

RIVALS: dict[str, Callable[[], Estimator]] = {
    "receipt": Receipt,
    "least squares": LeastSquares,
    "Kalman": Kalman,
    "window minimum": WindowMinimum,
}


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """One case: the readings of all seeds in turn.

    Attributes:
        true_s: True time of each reading since the start, shape (n,); the first seed's come first.
        errors_s: By estimator, time told less true time, shape (n,).
        bound_s: slipd's bound, NaN where it gives none, shape (n,).
        first: Readings of the first seed.
        call_s: slipd's time of a call.
    """

    true_s: Array
    errors_s: dict[str, Array]
    bound_s: Array
    first: int
    call_s: float


def follow(device: Times, receipt: Times, true: Times, clock: DeviceClock) -> tuple[Array, Array]:
    """Error and bound of each reading, s; the bound NaN where there is none."""
    error, bound = np.empty(device.size), np.full(device.size, np.nan)
    for k, (d, r) in enumerate(zip(device.tolist(), receipt.tolist(), strict=True)):
        error[k] = clock.map(d, r) - int(true[k])
        known = clock.uncertainty_ns
        if known is not None:
            bound[k] = known
    return error * 1e-9, bound * 1e-9


def run(quick: bool) -> dict[str, Run]:
    """Every estimator on every case."""
    return {name: _case(stream, quick) for name, stream in CASES.items()}


def _case(stream: Stream, quick: bool) -> Run:
    parts = [stream.readings(QUICK_SECONDS if quick else SECONDS, seed) for seed in range(2 if quick else SEEDS)]
    followed = [follow(*part, DeviceClock(None)) for part in parts]
    errors = {"slipd": np.concatenate([error for error, _ in followed])}
    for name, make in RIVALS.items():
        errors[name] = np.concatenate([_told(make(), part) for part in parts])
    true = np.concatenate([(part[2] - BOOT_NS) * 1e-9 for part in parts])
    return Run(true, errors, np.concatenate([bound for _, bound in followed]), parts[0][0].size, _call_s(parts[0]))


def _told(estimator: Estimator, part: tuple[Times, Times, Times]) -> Array:
    device, receipt, true = part
    told = [estimator.map(d, r) for d, r in zip(device.tolist(), receipt.tolist(), strict=True)]
    return np.asarray((np.array(told) - true) * 1e-9)


def _call_s(part: tuple[Times, Times, Times]) -> float:
    pairs = list(zip(part[0].tolist(), part[1].tolist(), strict=True))
    best = math.inf
    for _ in range(3):
        clock = DeviceClock(None)
        began = time.perf_counter()
        for device, receipt in pairs:
            clock.map(device, receipt)
        best = min(best, time.perf_counter() - began)
    return best / len(pairs)


def tables(runs: dict[str, Run]) -> list[Table]:
    """Errors of all while slipd gives a bound, and what its bound is worth."""
    names = ["slipd", *RIVALS]
    errors = Table(
        "Error of the time of acquisition, median / p99 of its size, µs", ["stream", *names, "without bound %"]
    )
    bounds = Table("slipd's bound, µs", ["stream", "median", "p99", "largest error", "outside %", "a call µs"])
    for case, found in runs.items():
        some = ~np.isnan(found.bound_s)
        sizes = {name: np.abs(found.errors_s[name][some]) * 1e6 for name in names}
        cells = [f"{np.median(size):.0f} / {np.quantile(size, 0.99):.0f}" for size in sizes.values()]
        errors.rows.append((case, *cells, 100.0 * float(np.mean(~some))))
        bound = found.bound_s[some] * 1e6
        outside = 100.0 * float(np.mean(sizes["slipd"] > bound))
        middle, high = (float(np.quantile(bound, q)) for q in (0.5, 0.99))
        worst = float(sizes["slipd"].max())
        bounds.rows.append((case, middle, high, worst, f"{outside:.3f}", found.call_s * 1e6))
    errors.notes += [
        "Without bound: while the fit settles, 0.5 s at the start and after a reset; slipd then uses the time of"
        " receipt. The errors are those of the other readings, for all methods.",
        "Delays exclude the constant minimum, which a one-way stream cannot show.",
        "The rivals are told of resets; window minimum, least squares: over 8 s; Kalman: offset and rate, noise 2 ms.",
    ]
    bounds.notes += [
        "If reads are polls, an uncertainty of up to one period remains: a slow beat of both phases looks like drift of"
        " the clock. A stream of one reading per poll hides this wait completely; it then counts as part of the minimum"
        " delay, unless the config states it (`poll_s`).",
    ]
    return [errors, bounds]


def draw(runs: dict[str, Run], figure: SubFigure) -> None:
    """A panel a case: errors over time of the first seed, slipd's bound behind."""
    shown = list(runs.items())[:6]
    panels = figure.subplots(2, 3, gridspec_kw={"left": 0.06, "right": 0.98, "hspace": 0.38, "wspace": 0.25})
    for axes, (case, found) in zip(panels.ravel(), shown, strict=True):
        part = slice(0, found.first, max(1, found.first // 6000))
        at, bound = found.true_s[part], found.bound_s[part] * 1e3
        for name, colour in (("receipt", "#BBBBBB"), ("least squares", "#CC79A7"), ("window minimum", "#E69F00")):
            axes.plot(at, found.errors_s[name][part] * 1e3, ",", color=colour)
            axes.plot([], [], "s", color=colour, label=name)
        axes.fill_between(at, -bound, bound, color="#56B4E9", alpha=0.4, lw=0.0, label="slipd's bound")
        axes.plot(at, found.errors_s["slipd"][part] * 1e3, ",", color="#0044AA")
        axes.plot([], [], "s", color="#0044AA", label="slipd")
        axes.set_yscale("symlog", linthresh=0.1)
        axes.set_ylim(-30.0, 2e4 if "stalls" in case else 100.0)
        axes.set_title(case, loc="left", fontweight="bold")
        axes.set_xlabel("s")
        axes.set_ylabel("error, ms")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="upper right", ncols=5, frameon=False)
    figure.suptitle("Time of acquisition: error over time", x=0.06, ha="left", fontweight="bold")
