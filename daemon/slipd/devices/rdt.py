"""The 36-byte RDT record of force/torque sensors on UDP, and the requests that start and stop it.

Used by the ATI Net F/T and Ethernet Axia, and by the OptoForce Ethernet converter. A record has neither sync nor
checksum (UDP's own protects it), so a stream that lost bytes finds its grid again by what must be steady from one
record to the next. All numbers are big-endian. Source: ATI Ethernet Axia manual, OptoForce Ethernet converter manual.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from slipd.devices.framing import Frames
from slipd.devices.health import DecoderHealth
from slipd.devices.numbering import LATE_WITHIN, Numbering
from slipd.samples import Array

RECORD_LENGTH = 36

STOP = 0x0000
START = 0x0002
START_BUFFERED = 0x0003

_REQUEST = struct.Struct(">HHI")  # header, command, data
_REQUEST_HEADER = 0x1234
_HEAD = struct.Struct(">III")  # rdt_sequence, ft_sequence, status
_RECORD = struct.Struct(">III6i")
_COUNTS_AT = _HEAD.size
_SPAN = 1 << 32
_FIRST = 1
"""Number of the first record after each start."""
_FIRST_WITHIN = 1 << 16
"""A stream's first record is believed by itself up to this number; a stream joined later, by four records."""
_GAP_WITHIN = 1 << 8
"""Records that a gap may lack to be a small one. One byte off the grid, numbers rise by so many."""
_TICKS_WITHIN = 1 << 16
"""Ticks that a small gap may take: nine records of the slowest stream in use, 7000 ticks each."""
_STRANGER_NEEDS = 3
"""Records that must continue one without history, each by exactly one: a resting sensor's counts do so, too, now and
then, but not thrice."""

_STRANGER_LATER = range(0, _STRANGER_NEEDS * RECORD_LENGTH, RECORD_LENGTH)
_SEEK_BLOCK = 1024
"""Places judged at once by a search: enough that NumPy's own cost is small."""

_LATE_TICKS = 1 << 12
"""A datagram so little behind in the sensor's clock was overtaken: the longest, 40 records, take 280 at 1 kHz."""

AT_RAIL = 1 << 32
"""A 33rd status bit, which is not sent: a count is at the end of its range."""
_RAILS = (-(1 << 31), (1 << 31) - 1)

Head = tuple[int, int]
"""Ticks of the sensor's own clock, unwrapped, and the status word with `AT_RAIL`."""


class Records:
    """Finds the records of a stream, and unwraps the sensor's clock.

    The first record of a stream is believed when its number is low; in step behind another one, the next number is.
    After a small gap, twice or late, a record needs the one after it to continue it, and so does that of a new start,
    or one whose reserved bits are new. All others, and any out of step, need three records to continue them.

    Args:
        health: Receives everything but ``good``.
        reserved: Status bits that have no meaning.
    """

    def __init__(self, health: DecoderHealth, reserved: int) -> None:
        self._health = health
        self._reserved = reserved
        self._frames = Frames(b"", self._measure, RECORD_LENGTH, health, seek=self._seek)
        self._numbering = Numbering(_SPAN, health, first=_FIRST)
        self._newest: int | None = None
        self._newest_ticks = 0
        self._steady = 0  # the reserved bits of the newest record
        self._in_step = True
        self._handed_on: tuple[int, int] | None = None  # number and unwrapped clock of the last record

    def receive(self, data: bytes) -> tuple[list[Head], Array]:
        """Take the next bytes of the stream.

        Returns:
            The heads of the records they complete, without those that are old, and their counts, shape (records, 6):
            force x y z, torque x y z.
        """
        heads, counts = self._go_on(data) or self._find(data)
        lowest, highest = _RAILS
        if heads and (counts.min() == lowest or counts.max() == highest):
            at_rail = ((counts == lowest) | (counts == highest)).any(axis=1)
            heads = [(ticks, status | AT_RAIL * bool(at)) for (ticks, status), at in zip(heads, at_rail, strict=True)]
        return heads, counts

    def _go_on(self, data: bytes) -> tuple[list[Head], Array] | None:
        """Take the usual datagram as a whole: records that go on from the newest; None, and nothing is taken, else."""
        if len(data) % RECORD_LENGTH or len(data) <= RECORD_LENGTH:
            return None
        if self._handed_on is None or self._frames.begun:  # out of step, something always waits
            return None
        number, clock = self._handed_on
        if (number, clock % _SPAN) != (self._newest, self._newest_ticks):
            return None
        words = np.frombuffer(data, ">u4").reshape(-1, RECORD_LENGTH // 4)
        sequence, ticks, status = words[:, :3].astype(np.int64).T
        steps = ticks - np.concatenate(((self._newest_ticks,), ticks[:-1]))
        if not (
            (sequence[1:] - sequence[:-1] == 1).all()
            and 0 <= steps.min() <= steps.max() < _TICKS_WITHIN
            and (status & self._reserved == self._steady).all()
            and self._numbering.go_on(int(sequence[0]), len(words))
        ):
            return None
        clocks = (ticks + (clock - self._newest_ticks)).tolist()
        self._newest, self._newest_ticks = int(sequence[-1]), int(ticks[-1])
        self._handed_on = self._newest, clocks[-1]
        return list(zip(clocks, status.tolist(), strict=True)), words.view(">i4")[:, 3:].astype(np.float64)

    def _find(self, data: bytes) -> tuple[list[Head], Array]:
        """Take bytes of any kind."""
        buffer, found = self._frames.receive(data)
        heads: list[Head] = []
        bodies: list[bytes] = []
        for start, _ in found:
            sequence, ticks, status = _HEAD.unpack_from(buffer, start)
            if self._is_late(sequence, ticks):
                self._health.duplicates += 1
            elif self._numbering.take(sequence):
                self._handed_on = sequence, self._unwrap(ticks)
                heads.append((self._handed_on[1], status))
                bodies.append(buffer[start + _COUNTS_AT : start + RECORD_LENGTH])
        return heads, np.frombuffer(b"".join(bodies), ">i4").astype(np.float64).reshape(-1, 6)

    def forget(self) -> None:
        """Drop a begun record, and expect the first one of a freshly opened stream."""
        self._frames.forget()
        self._numbering.forget()
        self._newest, self._in_step, self._handed_on = None, True, None

    def _measure(self, buffer: bytes, at: int) -> int:
        """Length of the record at ``at``, 0 while it cannot be told, -1 where there is none."""
        if at + RECORD_LENGTH > len(buffer):
            return 0
        sequence, ticks, status = _HEAD.unpack_from(buffer, at)
        reserved = status & self._reserved
        needs = self._needs(sequence, ticks, reserved == self._steady)
        for behind in range(at, at + needs * RECORD_LENGTH, RECORD_LENGTH):
            if behind + 2 * RECORD_LENGTH > len(buffer):
                return 0
            if not self._is_pair(buffer, behind, 2 if needs == _STRANGER_NEEDS else _GAP_WITHIN):
                self._in_step = False
                return -1
        self._steady, self._in_step = reserved, True
        if self._newest is None or sequence == _FIRST or (self._newest - sequence) % _SPAN > LATE_WITHIN:
            self._newest, self._newest_ticks = sequence, ticks
        return RECORD_LENGTH

    def _seek(self, buffer: bytes, at: int) -> int:
        """Return the first place from ``at`` on that `_STRANGER_NEEDS` records continue, as far as they have come.

        As `_measure` judges a record out of step, for a block of places at once.
        """
        judged = len(buffer) - 2 * RECORD_LENGTH + 1  # places of which the next record has come
        while at < judged:
            count = min(_SEEK_BLOCK, judged - at)
            continued = np.ones(count + (_STRANGER_NEEDS - 1) * RECORD_LENGTH, bool)
            known = min(len(continued), judged - at)
            continued[:known] = self._pairs(buffer, at, known)
            fits = np.logical_and.reduce([continued[later : later + count] for later in _STRANGER_LATER])
            found = int(fits.argmax())
            if fits[found]:
                return at + found
            at += count
        return at

    def _pairs(self, buffer: bytes, at: int, count: int) -> NDArray[np.bool_]:
        """Say of each place from ``at`` on whether the next record continues the one there, shape (count,)."""

        def step(field: int) -> NDArray[np.uint32]:
            numbers = np.ndarray((count + RECORD_LENGTH,), ">u4", buffer, at + 4 * field, (1,)).astype(np.uint32)
            return numbers[RECORD_LENGTH:] - numbers[:count]

        status = np.ndarray((count + RECORD_LENGTH,), ">u4", buffer, at + 8, (1,)).astype(np.uint32)
        changed = (status[RECORD_LENGTH:] ^ status[:count]) & np.uint32(self._reserved)
        ticks = step(1)
        paired: NDArray[np.bool_] = (step(0) == 1) & (ticks > 0) & (ticks < _TICKS_WITHIN) & (changed == 0)
        return paired

    def _needs(self, sequence: int, ticks: int, steady: bool) -> int:
        """Return how many records have to continue one for it to be believed."""
        if not self._in_step:
            return _STRANGER_NEEDS
        if self._newest is None:
            return 0 if steady and sequence < _FIRST_WITHIN else _STRANGER_NEEDS
        ahead, later = (sequence - self._newest) % _SPAN, (ticks - self._newest_ticks) % _SPAN
        if later < _TICKS_WITHIN and ahead < _GAP_WITHIN:
            return 0 if steady and ahead == 1 else 1
        is_late = -ahead % _SPAN <= LATE_WITHIN and -later % _SPAN < _TICKS_WITHIN
        return 1 if is_late or sequence == _FIRST else _STRANGER_NEEDS

    def _is_pair(self, buffer: bytes, at: int, within: int) -> bool:
        """Say whether the record behind the one at ``at`` continues it."""
        sequence, ticks, status = _HEAD.unpack_from(buffer, at)
        next_sequence, next_ticks, next_status = _HEAD.unpack_from(buffer, at + RECORD_LENGTH)
        return (
            0 < (next_sequence - sequence) % _SPAN < within
            and 0 < (next_ticks - ticks) % _SPAN < _TICKS_WITHIN
            and not (next_status ^ status) & self._reserved
        )

    def _is_late(self, sequence: int, ticks: int) -> bool:
        """Say whether a record was overtaken by one that has been handed on."""
        if self._handed_on is None or sequence == _FIRST:
            return False
        number, clock = self._handed_on
        return 0 < (number - sequence) % _SPAN < _SPAN // 2 and 0 < (clock - ticks) % _SPAN < _LATE_TICKS

    def _unwrap(self, ticks: int) -> int:
        if self._handed_on is None:
            return ticks
        before = self._handed_on[1]
        step = (ticks - before + _SPAN // 2) % _SPAN - _SPAN // 2
        return before + step if step > -_TICKS_WITHIN else ticks  # a clock that runs far back was reset


def encode_request(command: int, data: int = 0) -> bytes:
    """Return a request of 8 bytes; for a start, ``data`` is the number of records, 0 for no end."""
    return _REQUEST.pack(_REQUEST_HEADER, command, data)


def parse_request(datagram: bytes) -> tuple[int, int] | None:
    """Return command and data of a request; None where the datagram is none."""
    if len(datagram) != _REQUEST.size:
        return None
    header, command, data = _REQUEST.unpack(datagram)
    return (command, data) if header == _REQUEST_HEADER else None


def encode_record(counts: Sequence[int], sequence: int, ft_sequence: int, status: int = 0) -> bytes:
    """Return one record of 36 bytes as a sensor sends it.

    Args:
        counts: Force x y z, torque x y z; each within an int32.
        sequence: Number of the record since the start, from 1; sent modulo 2^32.
        ft_sequence: The sensor's own sample counter; sent modulo 2^32.
        status: The 32 status bits.
    """
    return _RECORD.pack(sequence % _SPAN, ft_sequence % _SPAN, status, *counts)
