"""Multiplexed PVDF pad: 8 rows of 16 electrodes behind one charge amplifier, on a serial line.

The paper describes the pad and its multiplexed read-out but no wire format; this one is slipd's own. One frame carries
one row of the scan, so a torn frame costs one scan and the host need not wait for a long block. docs/devices.md
describes the format with a worked frame.

A row, little-endian: ``A5 5A``, version 1 (u8), row (u8), scan (u16), time of the row's first taxel in µs (u32), dwell
in 10 ns (u16), one count per column (i16), CRC-16/X-25 of everything after ``A5 5A`` (u16).
"""

from __future__ import annotations

import struct
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from slipd.devices import Device, Need
from slipd.devices.shared import checksums
from slipd.devices.shared.frame_scanner import FrameDecoder, FrameScanner
from slipd.types.samples import TactileSample

ROWS = 8
COLS = 16

MAX_SIDE = 256
"""Most rows (numbered in one byte), and most columns, which keep a frame under 600 bytes."""

_VERSION = 1
_SYNC = bytes((0xA5, 0x5A, _VERSION))
_UNCHECKED = 2  # bytes before the version, where the checksum begins
_HEAD = struct.Struct("<BHIH")  # row, scan, time of the row's first taxel in µs, dwell in 10 ns
_PREDICTED = 6  # bytes of a row that are known beforehand: sync, row and scan
_COUNTS_AT = len(_SYNC) + _HEAD.size
_CRC_LENGTH = 2
_DWELL_UNIT_NS = 10
_SCAN_SPAN = 1 << 16
_US_SPAN = 1 << 32


class Decoder(FrameDecoder):
    """Return a tactile sample of every complete scan; drop scans that lack a row.

    ``values`` has shape (rows·cols,), in counts of the charge amplifier and in scan order, row by row.
    ``device_time_ns`` is the time of the scan's first taxel as sent: it wraps every 2^32 µs (71.6 min) and is not
    unwrapped here. `health.lost` counts scans: those dropped, and those missing from the scan numbers. A number that
    jumps back is a restart of the device (`health.restarts`), which loses only the scan it interrupts.

    Args:
        rows: Rows of the pad, 1 to 256.
        cols: Columns of the pad, 1 to 256.

    Raises:
        ValueError: A side is out of range.
    """

    def __init__(self, rows: int = ROWS, cols: int = COLS) -> None:
        if not (1 <= rows <= MAX_SIDE and 1 <= cols <= MAX_SIDE):
            raise ValueError(f"rows and cols must be from 1 to {MAX_SIDE}, got {rows} x {cols}")
        super().__init__()
        self._rows = rows
        self._grid = rows, cols
        self._row_bytes = 2 * cols
        self._length = _COUNTS_AT + self._row_bytes + _CRC_LENGTH
        self._size = rows * self._length  # of a scan
        self._columns = itemgetter(*(slice(at, None, self._length) for at in range(_PREDICTED)))
        self._fixed_columns = [*(bytes((byte,)) * rows for byte in _SYNC), bytes(range(rows))]
        measure = checksums.x25_measure(_UNCHECKED, self._length)
        self._frames = FrameScanner(_SYNC, measure, self._length, self.health, least=self._length)
        self._scan: int | None = None
        self._scan_time_us = 0
        self._dwell_ns = 0
        self._open = False  # whether every row of the scan so far has arrived
        self._counts: list[bytes] = []

    def _readings(self, data: bytes, t_ns: int) -> list[TactileSample]:
        samples: list[TactileSample] = []
        while data and self._begins_next_scan(data):
            _, self._scan, self._scan_time_us, dwell = _HEAD.unpack_from(data, len(_SYNC))
            self._dwell_ns = dwell * _DWELL_UNIT_NS
            samples.append(self._complete(np.ndarray(self._grid, "<i2", data, _COUNTS_AT, (self._length, 2)), t_ns))
            data = data[self._size :]
        return samples + self._decode_rows(data, t_ns) if data else samples

    def _begins_next_scan(self, data: bytes) -> bool:
        """Return whether bytes begin with all rows of the scan after the newest one, in order, as they usually do."""
        if len(data) < self._size or self._open or self._scan is None or not self._frames.in_sync:
            return False
        scan = data[: self._size]
        low, high = ((self._scan + 1) % _SCAN_SPAN).to_bytes(2, "little")
        columns = (*self._fixed_columns, bytes((low,)) * self._rows, bytes((high,)) * self._rows)
        starts = range(_UNCHECKED, self._size, self._length)
        return self._columns(scan) == columns and checksums.x25_all_match(scan, starts, self._length - _UNCHECKED)

    def _decode_rows(self, data: bytes, t_ns: int) -> list[TactileSample]:
        """Decode any bytes, row by row."""
        buffer, found = self._frames.receive(data)
        samples: list[TactileSample] = []
        for at, _ in found:
            row, scan, time_us, dwell = _HEAD.unpack_from(buffer, at + len(_SYNC))
            if row >= self._rows:
                self.health.bad += 1
            elif self._follows(row, scan, time_us, dwell * _DWELL_UNIT_NS):
                counts_at = at + _COUNTS_AT
                self._counts.append(buffer[counts_at : counts_at + self._row_bytes])
                if row == self._rows - 1:
                    counts = np.frombuffer(b"".join(self._counts), "<i2")
                    samples.append(self._complete(counts, t_ns))
        return samples

    def forget(self) -> None:
        """Drop a partial scan and the expected scan number, because the line was closed."""
        super().forget()
        self.health.lost += self._open
        self._scan, self._open = None, False

    def _follows(self, row: int, scan: int, time_us: int, dwell_ns: int) -> bool:
        """Return whether a row continues the open scan or begins the next one."""
        if row == 0:
            if scan == self._scan and time_us == self._scan_time_us:
                self.health.duplicates += 1  # the same row again
                return False
            self._leave_scan(scan)
            self._open = True
            self._scan_time_us, self._dwell_ns = time_us, dwell_ns
            self._counts = []
        elif scan != self._scan:
            joined_midway = self._scan is None
            self._leave_scan(scan)
            self.health.lost += not joined_midway
        elif self._open and row != len(self._counts):
            self._open = False
            self.health.lost += 1
        return self._open

    def _leave_scan(self, scan: int) -> None:
        """Count the scans lost before ``scan``."""
        self.health.lost += self._open
        self._open = False
        if self._scan is not None:
            step = (scan - self._scan) % _SCAN_SPAN
            if 0 < step < _SCAN_SPAN // 2:
                self.health.lost += step - 1
            else:
                self.health.restarts += 1
        self._scan = scan

    def _complete(self, counts: NDArray[np.int16], t_ns: int) -> TactileSample:
        """Return the newest scan with these counts, in scan order."""
        self._open = False
        values = counts.astype(np.float64).ravel()
        return TactileSample(t_ns, self._scan_time_us * 1000, values, dwell_ns=self._dwell_ns)


def encode_scan(counts: NDArray[np.signedinteger], scan_index: int, device_time_us: float, dwell_us: float) -> bytes:
    """Return the frames of one scan as the pad sends them.

    Args:
        counts: Charge amplifier counts, integers, shape (rows, cols), each within an int16.
        scan_index: Scan number; sent modulo 2^16.
        device_time_us: Device time at the first taxel, µs; sent as whole µs modulo 2^32.
        dwell_us: Time from one taxel to the next, µs, 0 to 655.35; sent in steps of 0.01 µs.

    Raises:
        ValueError: The counts have a wrong shape, type or range, or the dwell is out of range.
    """
    counts = np.asarray(counts)
    if counts.ndim != 2 or not np.issubdtype(counts.dtype, np.integer):
        raise ValueError(f"counts must be integers of shape (rows, cols), got {counts.dtype} of shape {counts.shape}")
    if counts.shape[0] > MAX_SIDE or counts.min() < -(1 << 15) or counts.max() >= 1 << 15:
        raise ValueError(f"counts must fit an int16 and have at most {MAX_SIDE} rows")
    dwell = round(dwell_us * 1000 / _DWELL_UNIT_NS)
    if not 0 <= dwell < 1 << 16:
        raise ValueError(f"dwell_us must be from 0 to 655.35, got {dwell_us}")
    rows, cols = counts.shape
    payload = counts.astype("<i2")
    frames: list[bytes] = []
    for row in range(rows):
        time_us = round(device_time_us + row * cols * dwell_us) % _US_SPAN
        body = _SYNC + _HEAD.pack(row, scan_index % _SCAN_SPAN, time_us, dwell) + payload[row].tobytes()
        frames += body, checksums.x25(body[_UNCHECKED:]).to_bytes(2, "little")
    return b"".join(frames)


FASTEST_HZ = 2_000.0
"""Fastest expected scans: one of eight rows takes 5 ms, but other electronics may be faster."""

DEVICE = Device(
    "pvdf",
    "tactile",
    ("serial",),
    Decoder,
    rates_hz=(1.0, FASTEST_HZ),
    baud=921_600,
    axes=1,
    needs_size=True,
    clock_span_ns=_US_SPAN * 1_000,
    needs=(
        Need(
            "charge_tau_s",
            "2.0",
            "R · C of the charge amplifiers, or press, hold, and fit the decay; leave it out only if the electronics "
            "send the force itself",
        ),
    ),
    frame="a frame of a PVDF pad",
    evidence="own",
)
