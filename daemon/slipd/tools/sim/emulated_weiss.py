"""Weiss tactile controllers as seen from their line: WTS modules and the DSACON32m, which push images at a period.

Not emulated on the DSACON32m: booting, single images, masks, sensitivities, thresholds and descriptions.
"""

from __future__ import annotations

import struct
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from slipd.devices import dsacon32, wts
from slipd.devices.shared.device_interface import DecoderHealth
from slipd.devices.shared.weiss_packets import SEED_AFTER_PREAMBLE, SEED_WITH_PREAMBLE, Packet, PacketScanner, encode
from slipd.devices.shared.weiss_tactile import FRAME, FULL_SCALE, RLE, Words
from slipd.tools.sim.emulators import EmulatedTactile, ReadingStream
from slipd.types.arrays import Array

_REQUEST_BYTES = 8
"""Length of an ordinary request."""

_IMAGE_HEAD = struct.Struct("<IB")  # device time in ms, flags
_MS_SPAN = 1 << 32


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


class WeissController(EmulatedTactile, ABC):
    """A controller on its line.

    Args:
        seed: Seed of its noise.
        cells: Number of its cells.
        sizes: Payload length of each request.
        checksum: Seed of the checksum of the requests.
        bare: Whether a request without payload has no checksum.
        noise_counts: Standard deviation of each reading.

    Attributes:
        rate_hz: Images per second until the host asks for another rate.
        clock_ppm: Rate error of its clock, parts per million; positive is fast.
    """

    clock_ppm: float

    def __init__(
        self, seed: int, cells: int, sizes: Mapping[int, int], checksum: int, *, bare: bool = False,
        noise_counts: float = 0.7,
    ) -> None:  # fmt: skip
        super().__init__(ReadingStream(seed, self.rate_hz, (cells,), noise_counts), self.rate_hz)
        self._requests: PacketScanner = PacketScanner(
            checksum, lambda number, size, _: sizes.get(number) == size, _REQUEST_BYTES, DecoderHealth(), bare=bare
        )

    def receive(self, data: bytes, t_ns: int) -> list[bytes]:
        """Handle bytes that the host wrote by ``t_ns``; return the answers."""
        return [self._answer(request, t_ns) for request in self._requests.packets(data)]

    def _cells(self) -> NDArray[np.uint16]:
        """Return the cells as they read now."""
        return np.clip(np.rint(self._stream.reading()), 0, FULL_SCALE).astype(np.uint16)

    def _time_ms(self, t_ns: int) -> int:
        return round(t_ns * ((1.0 + self.clock_ppm * 1e-6) * 1e-6))

    @abstractmethod
    def _answer(self, request: Packet, t_ns: int) -> bytes: ...


SINGLE = 0x20
"""A single image; the answer is a status and the image, as drivers read it: ksatyaki/wts_driver at 82c46ac,
``src/wts_driver.cpp``."""

FASTEST_MS = 4
"""Shortest interval; it replaces 0 and shorter ones, ms."""

WTS_SERIAL = 4711
WTS_SIZES = {SINGLE: 1, wts.START: wts.START_FIELDS.size, wts.STOP: 0, wts.MATRIX: 0, wts.SYSTEM: 0}
"""Bytes of each request to a module."""

_WTS_FIRMWARE = 0x1000  # 1.0.0
_PITCH = 340  # 10 µm


def encode_status(packet_id: int, status: int = 0) -> bytes:
    """Return an answer of a module that consists of a status alone; 0 is success."""
    return encode(packet_id, status.to_bytes(2, "little"), SEED_WITH_PREAMBLE)


def encode_module(cols: int, rows: int, full_scale: int = FULL_SCALE) -> bytes:
    """Return the answer about the matrix of a module."""
    form = (cols, rows, _PITCH, _PITCH, full_scale)
    return encode(wts.MATRIX, wts.MATRIX_FIELDS.pack(0, *form), SEED_WITH_PREAMBLE)


def encode_wts_frame(cells: Sequence[int] | Words, device_time_ms: int) -> bytes:
    """Return one plain image as the module sends it.

    Args:
        cells: Counts, integers from 0 to 65,535, shape (cells,).
        device_time_ms: Device time, ms; sent modulo 2^32.
    """
    return encode_image(cells, device_time_ms, SEED_WITH_PREAMBLE)


class WtsModule(WeissController):
    """A module, by default a WTS-FT.

    Args:
        seed: Seed of its noise.
        cols: Columns of its cells.
        rows: Rows of its cells.
    """

    rate_hz = 100.0
    clock_ppm = -60.0

    def __init__(self, seed: int, cols: int = 4, rows: int = 8) -> None:
        super().__init__(seed, cols * rows, WTS_SIZES, SEED_WITH_PREAMBLE)
        self._sides = cols, rows

    def _answer(self, request: Packet, t_ns: int) -> bytes:
        if request.id == wts.SYSTEM:
            return encode(wts.SYSTEM, wts.SYSTEM_FIELDS.pack(0, 1, 0, _WTS_FIRMWARE, WTS_SERIAL), SEED_WITH_PREAMBLE)
        if request.id == wts.MATRIX:
            return encode_module(*self._sides)
        if request.id == SINGLE:
            image = _IMAGE_HEAD.pack(self._time_ms(t_ns), 0) + self._cells().astype("<u2").tobytes()
            return encode(SINGLE, bytes(2) + image, SEED_WITH_PREAMBLE)
        if request.id == wts.START:
            _, interval_ms = wts.START_FIELDS.unpack(request.payload)
            self._stream.start(t_ns, 1000.0 / max(interval_ms, FASTEST_MS))
        else:
            self._stream.stop()
        return encode_status(request.id)

    def _frame(self, taken_ns: int) -> bytes:
        return encode_wts_frame(self._cells(), self._time_ms(taken_ns))


FINGER = ((6, 14), (6, 13))
"""The proximal and the distal matrix of an SDH finger, columns and rows."""

DSACON_SERIAL, FINGER_SERIAL = 1234, 5678
DSACON_SIZES = {
    dsacon32.CONTROLLER: 0,
    dsacon32.SENSOR: 0,
    dsacon32.ACQUIRE: dsacon32.ACQUIRE_FIELDS.size,
    dsacon32.MATRIX: 1,
}
"""Bytes of each request to a DSACON32m."""

_INDEX_ERROR = 24
_RS232 = 0x10
_REVISION = 0x20
_FIRMWARE = 288
_PITCH_MM = 3.4


def encode_error(packet_id: int, error: int = 0) -> bytes:
    """Return an answer of a DSACON32m that consists of an error number alone; 0 is no error."""
    return encode(packet_id, error.to_bytes(2, "little"), SEED_AFTER_PREAMBLE)


def encode_controller(serial: int, *, kind: int = dsacon32.TYPE_DSACON32, operable: bool = True) -> bytes:
    """Return the answer about the controller: serial number, type, and whether it can measure."""
    payload = dsacon32.CONTROLLER_FIELDS.pack(
        0, serial, _REVISION, _FIRMWARE, dsacon32.OPERABLE * operable, _RS232, kind, 0, 0, 0
    )
    return encode(dsacon32.CONTROLLER, payload, SEED_AFTER_PREAMBLE)


def encode_sensor(matrices: int, serial: int, error: int = 0) -> bytes:
    """Return the answer about the sensor: number of matrices and serial number."""
    return encode(
        dsacon32.SENSOR, dsacon32.SENSOR_FIELDS.pack(error, matrices, 0x0120, 1, serial, 0), SEED_AFTER_PREAMBLE
    )


def encode_matrix(cols: int, rows: int) -> bytes:
    """Return the answer about a matrix."""
    zeros = (0.0,) * 6
    unique, reserved = bytes(range(1, 7)), bytes(2)
    payload = dsacon32.MATRIX_FIELDS.pack(
        0, _PITCH_MM, _PITCH_MM, cols, rows, unique, reserved, 0x10, *zeros, float(FULL_SCALE), 0
    )
    return encode(dsacon32.MATRIX, payload, SEED_AFTER_PREAMBLE)


_LONGEST_RUN = 15


def encode_frame(cells: Sequence[int] | Words, device_time_ms: int, *, rle: bool = False) -> bytes:
    """Return one image as the controller sends it.

    Args:
        cells: Counts of all matrices in order, integers from 0 to 4095, shape (cells,).
        device_time_ms: Device time, ms; sent modulo 2^32.
        rle: Whether to encode runs.
    """
    words = np.asarray(cells, dtype=np.uint16)
    return encode_image(_runs(words) if rle else words, device_time_ms, SEED_AFTER_PREAMBLE, flags=RLE * rle)


def _runs(cells: Words) -> Words:
    starts = np.flatnonzero(np.diff(cells, prepend=cells[:1] ^ 1))
    words: list[int] = []
    for start, end in zip(starts, [*starts[1:], len(cells)], strict=True):
        whole, rest = divmod(int(end - start), _LONGEST_RUN)
        lengths = [_LONGEST_RUN] * whole + [rest] * (rest > 0)
        words += [length << dsacon32.RUN_SHIFT | int(cells[start]) for length in lengths]
    return np.array(words, dtype=np.uint16)


class Dsacon32(WeissController):
    """A DSACON32m, powered long before time 0.

    Args:
        seed: Seed of its noise.
        matrices: Columns and rows of each matrix; `press` takes the cells of all, in this order.
        noise_counts: Standard deviation of each reading.
    """

    rate_hz = 30.0
    clock_ppm = 80.0

    def __init__(self, seed: int, matrices: Sequence[tuple[int, int]] = FINGER, *, noise_counts: float = 0.7) -> None:
        cells = sum(cols * rows for cols, rows in matrices)
        super().__init__(seed, cells, DSACON_SIZES, SEED_AFTER_PREAMBLE, bare=True, noise_counts=noise_counts)
        self._matrices = matrices
        self._loads = [np.zeros(cols * rows) for cols, rows in matrices]
        self._rle = False

    def press(self, values: Array, sensor: str | None = None) -> None:
        """Set the load on the cells from now on, counts.

        Args:
            values: Loads of the cells of one matrix, or of all, shape (cells,).
            sensor: Index of the matrix, as in ``sensor`` of a config; None: all.

        Raises:
            ValueError: The number of values is not the number of cells.
        """
        if sensor is None:
            super().press(values)
        else:
            self._loads[int(sensor)] = values
            super().press(np.concatenate(self._loads))

    def _answer(self, request: Packet, t_ns: int) -> bytes:
        if request.id == dsacon32.CONTROLLER:
            return encode_controller(DSACON_SERIAL)
        if request.id == dsacon32.SENSOR:
            return encode_sensor(len(self._matrices), FINGER_SERIAL)
        if request.id == dsacon32.MATRIX:
            index = request.payload[0]
            if index >= len(self._matrices):
                return encode_error(dsacon32.MATRIX, _INDEX_ERROR)
            return encode_matrix(*self._matrices[index])
        flags, rate_hz = dsacon32.ACQUIRE_FIELDS.unpack(request.payload)
        self._rle = bool(flags & RLE)
        if rate_hz and flags & dsacon32.PUSH:
            self._stream.start(t_ns, min(rate_hz, dsacon32.MAX_RATE_HZ))
        else:
            self._stream.stop()
        return encode_error(dsacon32.ACQUIRE)

    def _frame(self, taken_ns: int) -> bytes:
        return encode_frame(self._cells(), self._time_ms(taken_ns), rle=self._rle)
