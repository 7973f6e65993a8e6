"""A Weiss WTS-FT tactile module as seen from its line: it answers, and pushes plain images.

Not emulated: run-length encoded images, tare, masks, thresholds, gain, temperature and device tag.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slipd.devices import wts
from slipd.devices.shared.device_interface import DecoderHealth
from slipd.devices.shared.weiss_packets import SEED_WITH_PREAMBLE, Packet, PacketScanner
from slipd.tools.sim.weiss_controller import WeissController

FASTEST_MS = 4
"""Shortest interval; it replaces 0 and shorter ones, ms."""

_REQUEST_BYTES = 8


class WtsModule(WeissController):
    """The module on its line; its caller passes the time.

    Args:
        matrix: Rows and columns of its cells.
        rng: Source of its noise.
        serial: Its serial number.
        noise_counts: Standard deviation of each reading.
        clock_ppm: Rate error of its clock, parts per million; positive is fast.
    """

    rate_hz = 100.0

    def __init__(
        self,
        matrix: wts.Matrix,
        rng: np.random.Generator,
        *,
        serial: int = 4711,
        noise_counts: float = 0.7,
        clock_ppm: float = -60.0,
    ) -> None:
        requests = PacketScanner(SEED_WITH_PREAMBLE, _is_request, _REQUEST_BYTES, DecoderHealth())
        super().__init__(matrix.cols * matrix.rows, requests, rng, noise_counts, clock_ppm)
        self._matrix = matrix
        self._serial = serial

    def _obey(self, request: Packet, t_ns: int) -> bytes:
        if request.id == wts.SYSTEM:
            return wts.encode_system(self._serial)
        if request.id == wts.MATRIX:
            return wts.encode_matrix(self._matrix)
        if request.id == wts.SINGLE:
            return wts.encode_single(self._cells(), self._time_ms(t_ns))
        running = request.id == wts.START
        self._push(max(wts.parse_start(request.payload), FASTEST_MS) * 1_000_000 if running else None, t_ns)
        return wts.encode_status(request.id)

    def _frame(self, cells: NDArray[np.uint16], time_ms: int) -> bytes:
        return wts.encode_frame(cells, time_ms)


def make(seed: int = 0, cols: int = 4, rows: int = 8) -> WtsModule:
    """Return a module, by default a WTS-FT of 4 x 8 cells."""
    return WtsModule(wts.Matrix(cols, rows), np.random.default_rng(seed))


def _is_request(packet_id: int, size: int, _: bytes) -> bool:
    return wts.REQUEST_SIZES.get(packet_id) == size
