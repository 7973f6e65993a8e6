"""Streams of a device with a clock of its own, as a busy host receives them; the truth is known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from slipd.signals.clock import DeviceClock
from slipd.types.arrays import Array

Times = NDArray[np.int64]

BOOT_NS = 1_000_000_000_000  # CLOCK_MONOTONIC at the start of a stream
WAKE_S = 3e-5  # mean time that a reader takes to wake


@dataclass(frozen=True)
class Stream:
    """What a stream is like.

    Attributes:
        rate_hz: Readings a second, by a crystal of their own.
        ppm: By how much the device's clock is fast.
        delay_s: Scale of the delay of each reading on its way.
        delay: How it is distributed.
        poll_s: Readings wait for the next poll, e.g. of a USB port; 0 for none.
        stall_every_s: Mean time between stalls of the loop, of 10 ms to 10 s; 0 for none.
        tick_ns: The device's clock counts in these.
        warming_ppm: Amplitude of a slow wander of its rate, over 5 minutes.
        resets_s: Times at which it begins anew, and what it then says, s.
    """

    rate_hz: float
    ppm: float = 0.0
    delay_s: float = 1e-4
    delay: Literal["exponential", "gamma", "lognormal", "pareto"] = "exponential"
    poll_s: float = 0.0
    stall_every_s: float = 0.0
    tick_ns: int = 1
    warming_ppm: float = 0.0
    resets_s: tuple[tuple[float, float], ...] = ()

    def readings(self, seconds: float, seed: int) -> tuple[Times, Times, Times]:
        """Device time, receipt, and true time of acquisition of each reading, ns."""
        rng = np.random.default_rng(seed)
        count = int(self.rate_hz * seconds)
        true_s = (np.arange(count) + rng.random()) / self.rate_hz * (1.0 + rng.normal(0.0, 5e-5))
        ready_s = np.maximum.accumulate(true_s + self._delays(rng, count))
        if self.poll_s:
            phase_s = rng.uniform(0.0, self.poll_s)
            polls, of_poll = np.unique(np.ceil((ready_s - phase_s) / self.poll_s), return_inverse=True)
            woken_s = polls * self.poll_s + phase_s + rng.exponential(WAKE_S, polls.size)
            ready_s = np.maximum.accumulate(woken_s)[of_poll]
        if self.stall_every_s:
            _stall(ready_s, self.stall_every_s, rng)
        return self._clock(true_s, rng), _ns(ready_s) + BOOT_NS, _ns(true_s) + BOOT_NS

    def _delays(self, rng: np.random.Generator, count: int) -> NDArray[np.float64]:
        draw = {
            "exponential": lambda: rng.exponential(1.0, count),
            "gamma": lambda: rng.gamma(3.0, 1.0, count),
            "lognormal": lambda: rng.lognormal(0.0, 1.0, count),
            "pareto": lambda: rng.pareto(1.5, count),
        }
        return self.delay_s * draw[self.delay]()

    def _clock(self, true_s: NDArray[np.float64], rng: np.random.Generator) -> Times:
        turn, phase = 2.0 * np.pi / 300.0, rng.uniform(0.0, 2.0 * np.pi)
        wander_s = 1e-6 * self.warming_ppm / turn * (np.sin(turn * true_s + phase) - np.sin(phase))
        device_s = true_s * (1.0 + 1e-6 * self.ppm) + wander_s + 1.0
        for at_s, says_s in self.resets_s:
            after = np.flatnonzero(true_s >= at_s)
            if after.size:
                device_s[after] += says_s - device_s[after[0]]
        return _ns(device_s) // self.tick_ns * self.tick_ns


def _stall(ready_s: NDArray[np.float64], every_s: float, rng: np.random.Generator) -> None:
    begin_s = rng.exponential(every_s)
    while begin_s < ready_s[-1]:
        end_s = begin_s + 10.0 ** rng.uniform(-2.0, 1.0)
        ready_s[(ready_s >= begin_s) & (ready_s < end_s)] = end_s
        begin_s = end_s + rng.exponential(every_s)


def _ns(seconds: NDArray[np.float64]) -> Times:
    return np.asarray(np.rint(seconds * 1e9), dtype=np.int64)


def follow(device: Times, receipt: Times, true: Times, clock: DeviceClock) -> tuple[Array, Array]:
    """Error and bound of each reading, s; the bound NaN where there is none."""
    error, bound = np.empty(device.size), np.full(device.size, np.nan)
    for k, (d, r) in enumerate(zip(device.tolist(), receipt.tolist(), strict=True)):
        error[k] = clock.map(d, r) - int(true[k])
        known = clock.uncertainty_ns
        if known is not None:
            bound[k] = known
    return error * 1e-9, bound * 1e-9
