"""A Weiss DSACON32m as seen from its line: it answers requests and streams images.

Not emulated: booting, single images, masks, sensitivities, thresholds and descriptions.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from slipd.devices import dsacon32
from slipd.devices.dsacon32 import MAX_RATE_HZ
from slipd.devices.shared.device_interface import DecoderHealth
from slipd.devices.shared.weiss_packets import SEED_AFTER_PREAMBLE, Packet, PacketScanner, encode
from slipd.devices.shared.weiss_tactile import RLE, Words
from slipd.tools.sim.emulated_wts import WeissController, encode_image
from slipd.types.arrays import Array

FINGER = ((6, 14), (6, 13))
"""The proximal and the distal matrix of an SDH finger, columns and rows."""

SERIAL = 1234

_INDEX_ERROR = 24
_REQUEST_BYTES = 9


REQUEST_SIZES = {
    dsacon32.CONTROLLER: 0,
    dsacon32.SENSOR: 0,
    dsacon32.ACQUIRE: dsacon32.ACQUIRE_FIELDS.size,
    dsacon32.MATRIX: 1,
}

_RS232 = 0x10

_REVISION = 0x20

_FIRMWARE = 288

_PITCH_MM = 3.4

_FULL_SCALE = 4095.0


def encode_error(packet_id: int, error: int = 0) -> bytes:
    """Return an answer that consists of an error number alone; 0 is no error."""
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
        0, _PITCH_MM, _PITCH_MM, cols, rows, unique, reserved, 0x10, *zeros, _FULL_SCALE, 0
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
    """The controller on its line, powered long before time 0; its caller passes the time.

    Args:
        seed: Seed of its noise.
        matrices: Columns and rows of each matrix; `press` takes the cells of all, in this order.
        noise_counts: Standard deviation of each reading.
    """

    rate_hz = 30.0
    clock_ppm = 80.0

    def __init__(self, seed: int, matrices: Sequence[tuple[int, int]] = FINGER, *, noise_counts: float = 0.7) -> None:
        requests = PacketScanner(
            SEED_AFTER_PREAMBLE, lambda number, size, _: REQUEST_SIZES.get(number) == size, _REQUEST_BYTES,
            DecoderHealth(), bare=True,
        )  # fmt: skip
        super().__init__(seed, sum(cols * rows for cols, rows in matrices), requests, noise_counts)
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

    def _obey(self, request: Packet, t_ns: int) -> bytes:
        if request.id == dsacon32.CONTROLLER:
            return encode_controller(SERIAL)
        if request.id == dsacon32.SENSOR:
            return encode_sensor(len(self._matrices), serial=5678)
        if request.id == dsacon32.MATRIX:
            index = request.payload[0]
            if index >= len(self._matrices):
                return encode_error(dsacon32.MATRIX, _INDEX_ERROR)
            return encode_matrix(*self._matrices[index])
        flags, rate_hz = dsacon32.ACQUIRE_FIELDS.unpack(request.payload)
        self._rle = bool(flags & RLE)
        if rate_hz and flags & dsacon32.PUSH:
            self._stream.start(t_ns, min(rate_hz, MAX_RATE_HZ))
        else:
            self._stream.stop()
        return encode_error(dsacon32.ACQUIRE)

    def _frame(self, cells: NDArray[np.uint16], time_ms: int) -> bytes:
        return encode_frame(cells, time_ms, rle=self._rle)


make = Dsacon32
