"""A multiplexed PVDF pad as seen from its line: taxels whose charge leaks, scanned one after another."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slipd.devices import pvdf
from slipd.tools.sim.emulators import EmulatedDevice
from slipd.types.arrays import Array

FULL_SCALE = 32_767
ROWS, COLS = 8, 16


@dataclass(frozen=True)
class PvdfElectronics:
    """Charge amplifier, converter and multiplexer.

    Attributes:
        tau_s: Leak time constant of the charge amplifier: y' = f' − y/τ.
        gain_counts_per_n: Counts per newton on the cell of a taxel.
        gain_spread: Relative standard deviation of the gains of the taxels.
        offset_counts: Standard deviation of the constant offsets of the taxels.
        noise_counts: Standard deviation of each reading.
        rate_hz: Scans per second.
        dwell_ns: Time from one taxel of a scan to the next.
        clock_ppm: Rate error of its clock, parts per million; positive is fast.
        dead: Taxels, in scan order, that feel nothing.
    """

    tau_s: float = 2.0
    gain_counts_per_n: float = 2000.0
    gain_spread: float = 0.03
    offset_counts: float = 20.0
    noise_counts: float = 2.0
    rate_hz: float = 200.0
    dwell_ns: int = 20_000
    clock_ppm: float = -25.0
    dead: tuple[int, ...] = ()


IDEAL = PvdfElectronics(tau_s=1e9, gain_counts_per_n=1.0, gain_spread=0.0, offset_counts=0.0)
"""Without leak, gain and offsets, so that loads are counts."""


class PvdfPad(EmulatedDevice):
    """The pad on its line; its caller passes the time. It sends unasked and never reads.

    Args:
        rows: Rows of the scan.
        cols: Columns of the scan.
        electronics: Amplifier, converter and multiplexer.
        seed: Seed or source of noise, gains and offsets.

    Raises:
        ValueError: A scan takes longer than the time between scans.
    """

    def __init__(
        self,
        rows: int = ROWS,
        cols: int = COLS,
        electronics: PvdfElectronics = IDEAL,
        seed: int | np.random.Generator = 0,
    ) -> None:
        super().__init__(electronics.rate_hz, rows=rows, cols=cols)
        taxels, rng = rows * cols, np.random.default_rng(seed)
        self._shape = rows, cols
        self._period_ns = round(1e9 / electronics.rate_hz)
        self._delay_ns = np.arange(taxels) * electronics.dwell_ns
        self._scan_takes_ns = int(self._delay_ns[-1])
        if self._scan_takes_ns >= self._period_ns:
            raise ValueError(f"a scan must take less than {self._period_ns} ns, got {self._scan_takes_ns}")
        self._electronics = electronics
        self._rng = rng
        self._gain = electronics.gain_counts_per_n * (1.0 + electronics.gain_spread * rng.normal(size=taxels))
        self._offset = electronics.offset_counts * rng.normal(size=taxels)
        self._gain[list(electronics.dead)] = 0.0
        self._loads_n = self._before_n = np.zeros(taxels)
        self._past: list[tuple[int, Array]] = [(0, np.zeros(taxels))]  # (t_ns, charges), back to the scan's start
        self._scan = 0

    def press(self, values: Array) -> None:
        """Set the load on each taxel at the next step, in scan order, shape (taxels,), N; until then it is linear."""
        self._loads_n = np.asarray(values, dtype=np.float64)

    def advance(self, t_ns: int) -> list[bytes]:
        """Advance to ``t_ns`` and return the scans complete by then, which came together; the leak is exact."""
        before_ns, charge_n = self._past[-1]
        loads_n = self._loads_n
        if t_ns <= before_ns:
            return []
        tau_s, span_s = self._electronics.tau_s, (t_ns - before_ns) * 1e-9
        gone = -math.expm1(-span_s / tau_s)
        charge_n = charge_n * (1.0 - gone) + (loads_n - self._before_n) * (gone * tau_s / span_s)
        self._past.append((t_ns, charge_n))
        self._before_n = loads_n
        output = b""
        while (scan_ns := self._scan * self._period_ns) + self._scan_takes_ns <= t_ns:
            output += self._send(scan_ns)
        return [output] if output else []

    def _send(self, scan_ns: int) -> bytes:
        """Return the scan that began at ``scan_ns``, and drop the charges before it."""
        charge_n = self._sampled(scan_ns + self._delay_ns)
        noise = self._electronics.noise_counts * self._rng.standard_normal(charge_n.size)
        counts = np.rint(self._gain * charge_n + self._offset + noise)
        clipped = np.minimum(np.maximum(counts, -FULL_SCALE), FULL_SCALE).astype(np.int64)
        device_us = scan_ns * (1e-3 + self._electronics.clock_ppm * 1e-9)
        dwell_us = self._electronics.dwell_ns * 1e-3
        data = pvdf.encode_scan(clipped.reshape(self._shape), self._scan, device_us, dwell_us)
        self._scan += 1
        next_ns = self._scan * self._period_ns
        while len(self._past) > 1 and self._past[1][0] <= next_ns:
            self._past.pop(0)
        return data

    def _sampled(self, times_ns: NDArray[np.int64]) -> Array:
        """Return the charge of each taxel at its own time, linear between those of the past."""
        known_ns, charges_n = (np.array(each) for each in zip(*self._past, strict=True))
        before = np.minimum(np.searchsorted(known_ns, times_ns, side="right"), len(known_ns) - 1) - 1
        late = (times_ns - known_ns[before]) * (1.0 / (known_ns[before + 1] - known_ns[before]))
        before_n, after_n = (charges_n[each, np.arange(times_ns.size)] for each in (before, before + 1))
        return np.asarray(before_n + late * (after_n - before_n))
