"""Readings that another process pushes: for labs whose own driver holds the port of a sensor.

Each message is one msgpack map, `{stream, t_ns, force_n, torque_nm}` or `{stream, t_ns, values}`, written down in
docs/devices.md. Messages delimit themselves: nothing here relies on a transport that hands them over one by one.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import msgpack
import numpy as np
from numpy.typing import ArrayLike

from slipd.devices import Device
from slipd.devices import external_message as message
from slipd.devices.health import DecoderHealth
from slipd.devices.numbering import Numbering
from slipd.samples import Array, TactileSample, WrenchSample

MAX_STREAMS = 64
"""Of one socket whose readings are numbered: bounds what a process that makes up names can fill."""

FREE_TRIES, BYTES_A_TRY = 64, 64
"""In a stretch of garbage so many places are judged at once, and then one every so many bytes: each costs microseconds,
and any two bytes may look like the begin of a message."""

_LATEST_NS = 1 << 63  # the clock's own type holds no more
_SEQ_SPAN = 1 << 64
_NAME = re.compile(r"[A-Za-z0-9_./-]+")
_WORD = re.compile(r"[a-z][a-z0-9_]*")
_BEGIN = re.compile(rb"[\x83-\x86](?:[\xa3-\xa9]|\Z)")  # a map of so many fields, and a key as long as one of ours


class Decoder:
    """Makes a wrench or a tactile sample of every message; ``source`` is its ``stream``.

    ``device_time_ns`` is the message's ``t_ns``: CLOCK_MONOTONIC of the acquisition on this host, as its sender says.
    `health.lost`, `duplicates` and `restarts` count by ``seq``, for the streams that carry one. Bytes that are no
    message are `bad_bytes`, and each stretch of them is one `bad`; so is a message with an unknown key, a wrong kind of
    value or a number out of range.

    Status names: those of the message, and "invalid" where a value is not finite.
    """

    def __init__(self) -> None:
        self.health = DecoderHealth()
        self._tail = b""
        self._garbage = 0  # bytes of the stretch of garbage that lies before the tail
        self._tries = 0  # places in it that were judged in vain
        self._numberings: dict[str, Numbering] = {}

    def receive(self, data: bytes, t_ns: int) -> list[WrenchSample | TactileSample]:
        """Take bytes received at ``t_ns`` and return the readings they complete."""
        buffer = self._tail + data
        samples: list[WrenchSample | TactileSample] = []
        done, at = 0, self._next_try(0)
        while (begin := _BEGIN.search(buffer, at)) is not None:
            at = begin.start()
            length = message.measure(buffer, at)
            if length == 0:
                break
            body = _unpack(buffer[at : at + length]) if length > 0 else None
            if body is None:
                self._tries += 1
                at = max(at + 1, self._next_try(done))
                continue
            self._drop(at - done)
            self._garbage = self._tries = 0
            done = at = at + length
            if self._is_new(body):
                samples.append(_sample(body, t_ns))
        keep = at if begin is not None else len(buffer)
        self._drop(keep - done)
        self._tail = buffer[keep:]
        self.health.good += len(samples)
        return samples

    def forget(self) -> None:
        """Drop a begun frame and what was expected to follow: the line was closed."""
        self._drop(len(self._tail))
        self._tail = b""
        self._numberings.clear()

    def _drop(self, count: int) -> None:
        """Count bytes that are no message."""
        if count:
            self.health.bad_bytes += count
            self.health.bad += not self._garbage
            self._garbage += count

    def _next_try(self, done: int) -> int:
        """Return the first place that may be judged, given that garbage goes on at ``done``."""
        return max(0, done + (self._tries - FREE_TRIES) * BYTES_A_TRY - self._garbage)

    def _is_new(self, body: dict[str, Any]) -> bool:
        """Say whether a reading is to be handed on, by its number where it has one."""
        if "seq" not in body:
            return True
        stream = body["stream"]
        if stream not in self._numberings:
            if len(self._numberings) == MAX_STREAMS:
                self.health.bad += 1
                return False
            self._numberings[stream] = Numbering(_SEQ_SPAN, self.health)
        return self._numberings[stream].take(body["seq"])


def _unpack(data: bytes) -> dict[str, Any] | None:
    """Unpack a message of the right shape; None where a name or a time is impossible."""
    try:
        body: dict[str, Any] = msgpack.unpackb(data)
    except UnicodeDecodeError:
        return None
    well = (
        _NAME.fullmatch(body["stream"])
        and body["t_ns"] < _LATEST_NS
        and all(_WORD.fullmatch(word) for word in body.get("status", ()))
    )
    return body if well else None


def _sample(body: dict[str, Any], t_ns: int) -> WrenchSample | TactileSample:
    status, stream, time_ns = tuple(body.get("status", ())), body["stream"], body["t_ns"]
    if "values" in body:
        values = np.array(body["values"], dtype=np.float64)
        return TactileSample(t_ns, time_ns, values, _judged(status, values), stream)
    force_n, torque_nm = [*map(float, body["force_n"])], body.get("torque_nm")
    torque_nm = None if torque_nm is None else [*map(float, torque_nm)]
    status = _judged(status, np.array(force_n if torque_nm is None else force_n + torque_nm))
    return WrenchSample(t_ns, time_ns, force_n, torque_nm, status, stream)


def _judged(status: tuple[str, ...], values: Array) -> tuple[str, ...]:
    return status if "invalid" in status or np.isfinite(values).all() else (*status, "invalid")


def encode_reading(
    stream: str,
    t_ns: int,
    *,
    force_n: ArrayLike | None = None,
    torque_nm: ArrayLike | None = None,
    values: ArrayLike | None = None,
    seq: int | None = None,
    status: Sequence[str] = (),
) -> bytes:
    """Return the message of one reading.

    Args:
        stream: Its name, letters, digits and ``_./-``, up to 64 of them.
        t_ns: CLOCK_MONOTONIC when the reading was taken.
        force_n: Force, shape (3,), N.
        torque_nm: Torque about the sensor's origin, shape (3,), N·m; only beside a force, and only where there is one.
        values: An image instead of a force, shape (taxels,) or (taxels, 3), in scan order.
        seq: Running number of the stream's readings, where it has one.
        status: Conditions of this reading, up to 8 short words.

    Raises:
        ValueError: A receiver would not take the message.
    """
    body: dict[str, Any] = {"stream": stream, "t_ns": t_ns}
    for key, reading in (("force_n", force_n), ("torque_nm", torque_nm), ("values", values)):
        if reading is not None:
            body[key] = np.asarray(reading, dtype=np.float64).tolist()
    if seq is not None:
        body["seq"] = seq
    if status:
        body["status"] = list(status)
    try:
        data: bytes = msgpack.packb(body)
    except OverflowError:
        data = b""
    if not data or message.measure(data, 0) != len(data) or _unpack(data) is None:
        raise ValueError(
            f"no reading of stream {stream!r:.80}: a name, a time, and either a force of shape (3,), with or without "
            f"a torque of shape (3,), or values of shape (taxels,) or (taxels, 3) with at most {message.MAX_TAXELS} "
            f"taxels and {message.MAX_MESSAGE} bytes make one"
        )
    return data


FASTEST_HZ = 10_000.0
"""What one socket brings without a backlog, and faster than any force sensor."""

DEVICE = Device(
    "external",
    "any",
    ("external",),
    Decoder,
    rates_hz=(0.1, FASTEST_HZ),
    shared=True,
    host_clock=True,
    frame="a reading",
)
