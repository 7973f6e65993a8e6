"""Which readings of a link may be used: those of the right device, at a rate that it can have."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from slipd.devices import Session
from slipd.types.samples import Sample

FLOOD_FACTOR = 4.0
"""Multiple of its expected rate at which a device floods; a rate in a config is easily wrong by two."""
BURST_S = 1.0
"""Readings that may arrive at once after a stall of the daemon, as time at the expected rate."""
LEAST_BURST = 32.0
"""Least number of readings that may arrive at once: slow streams come in bunches too."""


class Identity(NamedTuple):
    """What is known of the device behind a link.

    Attributes:
        reported: Identity that it reports; "" if it did not yet, or never does.
        opened: What was opened last, e.g. a path or an address; "" before.
    """

    reported: str
    opened: str


class IdentityGuard:
    """What was opened and which device answered, compared with the config and with the run so far.

    Tare, calibration and mounting belong to one device, so that readings of another one must not be used.

    Args:
        wanted: Identity that the config names, of the device or of what is opened; "" for any.

    Attributes:
        opened: What was opened last, e.g. a path or an address; "" before.
        first: First identity that a device reported in this run; "" before.
        mismatch: Why readings must not be used; "" where they may.
    """

    def __init__(self, wanted: str) -> None:
        self._wanted = wanted
        self._first_opened = ""
        self.opened = self.first = self.mismatch = ""

    def open(self, opened: str) -> bool:
        """Note what was opened; return whether the link was open before in this run."""
        reopened = bool(self._first_opened)
        self._first_opened = self._first_opened or opened
        self.opened = opened
        return reopened

    def check(self, session: Session | None) -> None:
        """Compare what was opened, and the identity that the device reports, if any."""
        identity = session.identity if session is not None else ""
        self.first = self.first or identity
        if self._wanted and self._wanted not in (identity, self.opened):
            self.mismatch = (
                f"another device answers: {identity!r}, where hardware_id says {self._wanted!r}"
                if identity
                else f"waits for the device to identify itself as {self._wanted!r}"
            )
        elif not identity and self.first and session is not None and session.state != "running":
            self.mismatch = "waits for the device to identify itself: another device may be connected now"
        elif identity != self.first and identity:
            self.mismatch = f"another device answers: {identity!r}, where {self.first!r} was; restart slipd"
        elif self.opened != self._first_opened:
            self.mismatch = f"another port answers: {self.opened!r}, where {self._first_opened!r} was"
        else:
            self.mismatch = ""


class FloodGuard:
    """The readings that a link may bring now: a store that fills at a multiple of the expected rate.

    Attributes:
        rate_hz: Expected rate of all streams of the link, Hz.
        left: Readings that it may bring before `limit` must look at the time; the caller subtracts what came.
        dropped: Readings dropped since the daemon began.
        dropped_ns: When readings were dropped last; None: never.
    """

    def __init__(self) -> None:
        self.rate_hz = self.left = 0.0
        self.dropped = 0
        self.dropped_ns: int | None = None
        self._filled_ns = 0

    def open(self, t_ns: int) -> None:
        """Begin with a full store on a link opened at ``t_ns``."""
        self._filled_ns, self.left = t_ns, self._burst()

    def limit(self, samples: Sequence[Sample], t_ns: int) -> Sequence[Sample]:
        """Return readings received at ``t_ns``, more than are left, without the oldest that exceed the limit."""
        refill = (t_ns - self._filled_ns) * 1e-9 * FLOOD_FACTOR * self.rate_hz
        self.left, self._filled_ns = min(self.left + refill, self._burst()), t_ns
        surplus = max(len(samples) - int(self.left), 0)
        if surplus:
            self.dropped += surplus
            self.dropped_ns = t_ns
        return samples[surplus:]

    def _burst(self) -> float:
        return max(BURST_S * self.rate_hz, LEAST_BURST)
