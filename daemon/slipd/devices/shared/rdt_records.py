"""The 36-byte RDT record of force/torque sensors on UDP, and the requests that start and stop it.

Used by the ATI Net F/T and Ethernet Axia, and by the OptoForce Ethernet converter. A record, big-endian: record number
(u32), sensor clock in ticks (u32), status (u32), force x y z and torque x y z in counts (6 × i32).

A record has neither sync nor checksum (UDP has one). After lost bytes the scanner finds records again by what must be
consistent from one record to the next. It tells late, repeated and lost records apart.

Source: ATI Ethernet Axia manual, OptoForce Ethernet converter manual.
"""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import NDArray

from slipd.devices.shared.device_interface import DecoderHealth
from slipd.devices.shared.frame_scanner import NO_FRAME, FrameScanner
from slipd.devices.shared.sequence_tracker import LATE_WITHIN, SequenceTracker
from slipd.types.arrays import Array

RECORD_LENGTH = 36

STOP = 0x0000
START = 0x0002
START_BUFFERED = 0x0003

REQUEST = struct.Struct(">HHI")  # header, command, data
REQUEST_HEADER = 0x1234
_HEAD = struct.Struct(">III")  # rdt_sequence, ft_sequence, status
RECORD = struct.Struct(">III6i")
SPAN = 1 << 32
_FIRST = 1
"""Number of the first record after each start."""
_FIRST_WITHIN = 1 << 16
"""Up to this number the first record of a stream is accepted alone; a stream joined later needs four records."""
_GAP_WITHIN = 1 << 8
"""Longest small gap, records; one byte out of alignment, record numbers rise by this many."""
_TICKS_WITHIN = 1 << 16
"""Longest small gap, ticks: nine records of the slowest stream in use, 7000 ticks each."""
_NEW_STREAM_NEEDS = 3
"""Number of records that must follow one without history, each numbered higher by one.

The counts of a resting sensor sometimes look like one such record, but not like three.
"""

_FEW = 6
"""Up to this many records are read one by one as fast as together."""

_SEEK_BLOCK = 1024
"""Places that a search checks at once: enough to make the overhead of NumPy small."""

_LATE_TICKS = 1 << 12
"""A datagram at most this far behind was overtaken; the longest, of 40 records, takes 280 ticks at 1 kHz."""

AT_RAIL = 1 << 32
"""A 33rd status bit, never sent: a count is at the end of its range."""
_LOWEST, _HIGHEST = -(1 << 31), (1 << 31) - 1
_RAILS = frozenset((_LOWEST, _HIGHEST))

Head = tuple[int, int]
"""Ticks of the sensor's clock, unwrapped, and the status with `AT_RAIL`."""


class RecordScanner(FrameScanner):
    """Find the records of a stream, and unwrap the sensor's clock.

    The first record of a stream is accepted if its number is low; in sync, the record with the next number is accepted.
    A record after a small gap, a repeated or late one, the first one of a new start, and one with new reserved bits are
    accepted if the next record follows them. All others, and any out of sync, must be followed by three records.

    Args:
        health: Receives all counts but ``good``.
        reserved: Mask of the status bits without a meaning.
    """

    def __init__(self, health: DecoderHealth, reserved: int) -> None:
        super().__init__(b"", self._record_length, RECORD_LENGTH, health, seek=self._next_stream)
        self._reserved = reserved
        self._sequence = SequenceTracker(SPAN, health, first=_FIRST)
        self._newest: int | None = None
        self._newest_ticks = 0
        self._reserved_bits = 0  # of the newest record
        self._aligned = True
        self._returned: tuple[int, int] | None = None  # number and unwrapped clock of the record returned last

    def records(self, data: bytes) -> tuple[list[Head], Array]:
        """Scan the next bytes of the stream.

        Returns:
            The heads of the new records that they complete, and the counts of these, shape (records, 6): force x y z,
            torque x y z.
        """
        return self._scan_whole_records(data) or self._search(data)

    def _scan_whole_records(self, data: bytes) -> tuple[list[Head], Array] | None:
        """Read a long datagram, whole records that follow the newest; return None, and change nothing, otherwise."""
        if len(data) % RECORD_LENGTH or len(data) <= _FEW * RECORD_LENGTH:
            return None
        if self._returned is None or not self.in_sync:
            return None
        number, clock = self._returned
        if (number, clock % SPAN) != (self._newest, self._newest_ticks):
            return None
        words = np.frombuffer(data, ">u4").reshape(-1, RECORD_LENGTH // 4)
        numbers, ticks, status = words[:, :3].astype(np.int64).T
        steps = ticks - np.concatenate(((self._newest_ticks,), ticks[:-1]))
        if not (
            (numbers[1:] - numbers[:-1] == 1).all()
            and 0 <= steps.min() <= steps.max() < _TICKS_WITHIN
            and (status & self._reserved == self._reserved_bits).all()
            and self._sequence.accept_run(int(numbers[0]), len(words))
        ):
            return None
        clocks = (ticks + (clock - self._newest_ticks)).tolist()
        self._newest, self._newest_ticks = int(numbers[-1]), int(ticks[-1])
        self._returned = self._newest, clocks[-1]
        counts = words.view(">i4")[:, 3:].astype(np.float64)
        status |= ((counts == _LOWEST) | (counts == _HIGHEST)).any(axis=1) * AT_RAIL
        return list(zip(clocks, status.tolist(), strict=True)), counts

    def _search(self, data: bytes) -> tuple[list[Head], Array]:
        """Read any bytes, record by record."""
        buffer, found = self.receive(data)
        heads: list[Head] = []
        rows: list[list[int]] = []
        for start, _ in found:
            sequence, ticks, status, *counts = RECORD.unpack_from(buffer, start)
            clock = self._clock_of(sequence, ticks)
            if clock is None:
                self._health.duplicates += 1
            elif self._sequence.accept(sequence):
                self._returned = sequence, clock
                heads.append((clock, status if _RAILS.isdisjoint(counts) else status | AT_RAIL))
                rows.append(counts)
        return heads, np.array(rows, dtype=np.float64).reshape(-1, 6)

    def forget(self) -> None:
        """Drop a partial record, and expect the first record of a freshly opened stream."""
        super().forget()
        self._sequence.forget()
        self._newest, self._aligned, self._returned = None, True, None

    def _record_length(self, buffer: bytes, at: int) -> int:
        """Return the length of the record at ``at``, 0 if more bytes are needed to decide, else `NO_FRAME`."""
        if at + RECORD_LENGTH > len(buffer):
            return 0
        sequence, ticks, status = _HEAD.unpack_from(buffer, at)
        reserved = status & self._reserved
        needs = self._needs(sequence, ticks, reserved == self._reserved_bits)
        for place in range(at, at + needs * RECORD_LENGTH, RECORD_LENGTH):
            if place + 2 * RECORD_LENGTH > len(buffer):
                return 0
            if not self._pairs(buffer, place, 1, 1 if needs == _NEW_STREAM_NEEDS else _GAP_WITHIN - 1)[0]:
                self._aligned = False
                return NO_FRAME
        self._reserved_bits, self._aligned = reserved, True
        if self._newest is None or sequence == _FIRST or (self._newest - sequence) % SPAN > LATE_WITHIN:
            self._newest, self._newest_ticks = sequence, ticks
        return RECORD_LENGTH

    def _next_stream(self, buffer: bytes, at: int) -> int:
        """Return the first place from ``at`` on that is followed by `_NEW_STREAM_NEEDS` records, as far as received.

        This is what `_record_length` requires out of sync, for a block of places at once.
        """
        end = len(buffer) - 2 * RECORD_LENGTH + 1  # from here on the next record is incomplete
        while at < end:
            count = min(_SEEK_BLOCK, end - at)
            followed = np.ones(count + (_NEW_STREAM_NEEDS - 1) * RECORD_LENGTH, bool)
            known = min(len(followed), end - at)
            followed[:known] = self._pairs(buffer, at, known)
            offsets = range(0, _NEW_STREAM_NEEDS * RECORD_LENGTH, RECORD_LENGTH)
            fits = np.logical_and.reduce([followed[offset : offset + count] for offset in offsets])
            found = int(fits.argmax())
            if fits[found]:
                return at + found
            at += count
        return at

    def _pairs(self, buffer: bytes, at: int, count: int, within: int = 1) -> NDArray[np.bool_]:
        """Return for each place from ``at`` on whether the next record follows the one there, shape (count,).

        It does if its number is higher by at most ``within``.
        """

        def field(place: int) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
            values = np.ndarray((count + RECORD_LENGTH,), ">u4", buffer, at + 4 * place, (1,)).astype(np.uint32)
            return values[:count], values[RECORD_LENGTH:]

        (number, next_number), (ticks, next_ticks), (status, next_status) = map(field, range(3))
        near = (next_number - number - 1 < within) & (next_ticks - ticks - 1 < _TICKS_WITHIN - 1)
        paired: NDArray[np.bool_] = near & ((next_status ^ status) & np.uint32(self._reserved) == 0)
        return paired

    def _needs(self, sequence: int, ticks: int, same_reserved: bool) -> int:
        """Return how many records must follow one for it to be accepted."""
        if not self._aligned:
            return _NEW_STREAM_NEEDS
        if self._newest is None:
            return 0 if same_reserved and sequence < _FIRST_WITHIN else _NEW_STREAM_NEEDS
        ahead, later = (sequence - self._newest) % SPAN, (ticks - self._newest_ticks) % SPAN
        if later < _TICKS_WITHIN and ahead < _GAP_WITHIN:
            return 0 if same_reserved and ahead == 1 else 1
        is_late = -ahead % SPAN <= LATE_WITHIN and -later % SPAN < _TICKS_WITHIN
        return 1 if is_late or sequence == _FIRST else _NEW_STREAM_NEEDS

    def _clock_of(self, sequence: int, ticks: int) -> int | None:
        """Return the unwrapped clock of a record; None if it was overtaken by one that has been returned."""
        if self._returned is None:
            return ticks
        number, before = self._returned
        step = (ticks - before + SPAN // 2) % SPAN - SPAN // 2
        if -_LATE_TICKS < step < 0 and sequence != _FIRST and 0 < (number - sequence) % SPAN < SPAN // 2:
            return None
        return before + step if step > -_TICKS_WITHIN else ticks  # a clock that jumps far back was reset


def encode_request(command: int, data: int = 0) -> bytes:
    """Return a request of 8 bytes; for a start, ``data`` is the number of records, 0 for no limit."""
    return REQUEST.pack(REQUEST_HEADER, command, data)
