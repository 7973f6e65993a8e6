"""Base of the emulated Weiss tactile controllers: a clock, cells with noise, images pushed at a period."""

from __future__ import annotations

import struct
from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from slipd.devices import wts
from slipd.devices.shared.device_interface import DecoderHealth
from slipd.devices.shared.weiss_packets import SEED_WITH_PREAMBLE, Packet, PacketScanner, encode
from slipd.devices.shared.weiss_tactile import FRAME, FULL_SCALE, Words
from slipd.tools.sim.emulators import EmulatedTactile, TactileStream

SINGLE = 0x20
"""A single image; the answer is a status and the image, as drivers read it: ksatyaki/wts_driver at 82c46ac,
``src/wts_driver.cpp``."""

SERIAL = 4711

_FIRMWARE = 0x1000  # 1.0.0

_PITCH = 340  # 10 µm

_IMAGE_HEAD = struct.Struct("<IB")  # device time in ms, flags
_MS_SPAN = 1 << 32

REQUEST_SIZES = {SINGLE: 1, wts.START: wts.START_FIELDS.size, wts.STOP: 0, wts.MATRIX: 0, wts.SYSTEM: 0}


def encode_status(packet_id: int, status: int = 0) -> bytes:
    """Return an answer that consists of a status alone; 0 is success."""
    return encode(packet_id, status.to_bytes(2, "little"), SEED_WITH_PREAMBLE)


def encode_matrix(matrix: wts.Matrix) -> bytes:
    """Return the answer about the module's matrix."""
    form = (matrix.cols, matrix.rows, _PITCH, _PITCH, matrix.full_scale)
    return encode(wts.MATRIX, wts.MATRIX_FIELDS.pack(0, *form), SEED_WITH_PREAMBLE)


def encode_image(words: Sequence[int] | Words, device_time_ms: int, seed: int, *, flags: int = 0) -> bytes:
    """Return a packet that contains an image.

    Args:
        words: Cells, or runs of cells, integers of 16 bits, shape (any,).
        device_time_ms: Device time, ms; sent modulo 2^32.
        seed: Seed of the checksum, as in `weiss_packets.encode`.
        flags: Flags of the image.
    """
    head = _IMAGE_HEAD.pack(device_time_ms % _MS_SPAN, flags)
    return encode(FRAME, head + np.asarray(words).astype("<u2").tobytes(), seed)


def encode_frame(cells: Sequence[int] | Words, device_time_ms: int) -> bytes:
    """Return one plain image as the module sends it.

    Args:
        cells: Counts, integers from 0 to 65,535, shape (cells,).
        device_time_ms: Device time, ms; sent modulo 2^32.
    """
    return encode_image(cells, device_time_ms, SEED_WITH_PREAMBLE)


class WeissController(EmulatedTactile, ABC):
    """A controller on its line; its caller passes the time.

    Args:
        seed: Seed of its noise.
        cells: Number of its cells.
        requests: Parser of the requests of the host.
        noise_counts: Standard deviation of each reading.

    Attributes:
        rate_hz: Images per second until the host asks for another rate.
        clock_ppm: Rate error of its clock, parts per million; positive is fast.
    """

    clock_ppm: float

    def __init__(self, seed: int, cells: int, requests: PacketScanner, noise_counts: float = 0.7) -> None:
        super().__init__(TactileStream(seed, self.rate_hz, (cells,), noise_counts), self.rate_hz)
        self._requests = requests

    def opened(self, t_ns: int) -> None:
        """Drop an incomplete request of the previous user of the line."""
        self._requests.forget()

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Handle bytes that the host wrote by ``t_ns``; return the answers."""
        return [self._obey(request, t_ns) for request in self._requests.packets(data)]

    def advance(self, t_ns: int) -> list[bytes]:
        """Advance to ``t_ns`` and return the images due until then."""
        return [self._frame(self._cells(), self._time_ms(taken_ns)) for taken_ns in self._stream.times(t_ns)]

    def _cells(self) -> NDArray[np.uint16]:
        """Return the cells as they read now."""
        return np.clip(np.rint(self._stream.image()), 0, FULL_SCALE).astype(np.uint16)

    def _time_ms(self, t_ns: int) -> int:
        return round(t_ns * ((1.0 + self.clock_ppm * 1e-6) * 1e-6))

    @abstractmethod
    def _obey(self, request: Packet, t_ns: int) -> bytes: ...

    @abstractmethod
    def _frame(self, cells: NDArray[np.uint16], time_ms: int) -> bytes: ...


FASTEST_MS = 4
"""Shortest interval; it replaces 0 and shorter ones, ms."""

_REQUEST_BYTES = 8


class WtsModule(WeissController):
    """The module on its line, by default a WTS-FT; its caller passes the time.

    Args:
        seed: Seed of its noise.
        cols: Columns of its cells.
        rows: Rows of its cells.
    """

    rate_hz = 100.0
    clock_ppm = -60.0

    def __init__(self, seed: int, cols: int = 4, rows: int = 8) -> None:
        requests = PacketScanner(
            SEED_WITH_PREAMBLE, lambda number, size, _: REQUEST_SIZES.get(number) == size, _REQUEST_BYTES,
            DecoderHealth(),
        )  # fmt: skip
        super().__init__(seed, cols * rows, requests)
        self._matrix = wts.Matrix(cols, rows)

    def _obey(self, request: Packet, t_ns: int) -> bytes:
        if request.id == wts.SYSTEM:
            return encode(wts.SYSTEM, wts.SYSTEM_FIELDS.pack(0, 1, 0, _FIRMWARE, SERIAL), SEED_WITH_PREAMBLE)
        if request.id == wts.MATRIX:
            return encode_matrix(self._matrix)
        if request.id == SINGLE:
            image = _IMAGE_HEAD.pack(self._time_ms(t_ns), 0) + self._cells().astype("<u2").tobytes()
            return encode(SINGLE, bytes(2) + image, SEED_WITH_PREAMBLE)
        if request.id == wts.START:
            _, interval_ms = wts.START_FIELDS.unpack(request.payload)
            self._stream.start(t_ns, 1000.0 / max(interval_ms, FASTEST_MS))
        else:
            self._stream.stop()
        return encode_status(request.id)

    def _frame(self, cells: NDArray[np.uint16], time_ms: int) -> bytes:
        return encode_frame(cells, time_ms)


make = WtsModule
