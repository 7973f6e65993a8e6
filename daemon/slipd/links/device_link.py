"""One link: the conversation with its device, the check that it is the right one, its streams and their rate limit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from itertools import groupby
from operator import attrgetter
from typing import cast

from slipd.config import Config, device_options, transport_of
from slipd.config import Stream as StreamConfig
from slipd.devices import DEVICES, Decoder, Session
from slipd.events import NEVER_NS, LinkSpec
from slipd.finger.freshness import PROMPT, Arrival, Freshness, Read
from slipd.links.stream_meter import StreamMeter
from slipd.types.samples import Sample

RESTART_NS = 1_000_000_000
"""A session that failed restarts at once, but no more often than this."""
FLOOD_FACTOR = 4.0
"""Multiple of its expected rate at which a device floods; a rate in a config is easily wrong by two."""
BURST_S = 1.0
"""Readings that may arrive at once after a stall of the daemon, as time at the expected rate."""
LEAST_BURST = 32.0
"""Least number of readings that may arrive at once: slow streams come in bunches too."""
_SOURCE = attrgetter("source")


class DeviceLink:
    """A port or server, the conversation on it, and the streams that it carries.

    Readings of another device than before in this run, or than the config names, are refused: tare, calibration and
    mounting belong to the device that was there.

    Args:
        spec: What to open.
        config: Config of the first stream, which names the device and its options.

    Attributes:
        device: What is expected on the link.
        streams: The streams by sensor.
        session: The conversation with the device; None for a device that sends unasked.
        counters: Counters of the decoder.
        due_ns: When `due` has bytes to write, as far as is known; the time may have moved on since.
        up: The link is open.
        message: Why it is not open, for people.
        reconnects: Times that the link came up again.
        failed: The session failed, and whatever relies on its state must still be reset; the caller clears this.
        fault: The newest failure, for people; "" before one.
        fault_ns: When it came.
        guard: Compares the device with the one that is expected.
        flood: Limit of the readings that the link may bring.
        opened_ns: When the link was opened.
        received_ns: When bytes came last; None: none came since then.
        bad_bytes_before: Bad bytes of the decoder when the link was opened.
    """

    def __init__(self, spec: LinkSpec, config: StreamConfig) -> None:
        self.spec, self.device = spec, DEVICES[config.device]
        options = device_options(config)
        self.session: Session | None = self.device.session(**options) if self.device.session is not None else None
        self._decoder: Session | Decoder = self.session or self.device.decoder(**options)
        self.counters = self._decoder.health
        self.streams: dict[str, StreamMeter] = {}
        self.up = self.failed = False
        self.message = "not opened yet"
        self.reconnects = 0
        self.guard = IdentityGuard(config.hardware_id, self.session)
        self.flood = FloodGuard()
        self.opened_ns = self.bad_bytes_before = self.fault_ns = 0
        self.received_ns: int | None = None
        self.fault = ""
        self.due_ns = NEVER_NS
        self._begun_ns = 0  # the session
        self._begin_again_ns: int | None = None  # a session that failed

    def add(self, sensor: str, stream: StreamMeter) -> None:
        """Add a stream of the link."""
        self.streams[sensor] = stream
        self.flood.rate_hz += stream.expected_hz

    def open(self, identity: str, t_ns: int) -> bytes:
        """Restart on an opened link; return the first bytes for the device."""
        self.reconnects += self.guard.open(identity)
        self.up, self.message = True, ""
        self.flood.open(t_ns)
        self.opened_ns, self.received_ns = t_ns, None
        self.bad_bytes_before, self.fault = self.counters.bad_bytes, ""
        greeting = self._begin(t_ns)
        self.guard.check()
        return greeting

    def _begin(self, t_ns: int) -> bytes:
        """Begin the conversation; return the first bytes for the device."""
        self.interrupt()
        self._begun_ns, self._begin_again_ns = t_ns, None
        if self.session is None:
            cast("Decoder", self._decoder).forget()
            return b""
        self.due_ns = 0
        try:
            return self.session.start(t_ns)
        except Exception as error:  # a device of another package ends no other stream
            self._fail(error, t_ns)
            return b""

    def interrupt(self) -> None:
        """Forget the model of the device's clock after a gap in which time passed unseen."""
        for stream in self.streams.values():
            stream.clock.forget()

    def close(self, reason: str) -> None:
        """End the conversation on a link that went down or could not be opened."""
        self.farewell()
        self.up, self.message, self.due_ns = False, reason, NEVER_NS

    def farewell(self) -> bytes:
        """End the conversation on an open link; return the last bytes for the device, if any."""
        if self.session is None or not self.up:
            return b""
        try:
            return self.session.stop()
        except Exception:  # the link closes in any case
            return b""

    def receive(self, data: bytes, t_ns: int, arrival: Arrival = PROMPT) -> list[Read]:
        """Decode bytes that reached the daemon at ``t_ns`` into readings, in runs of one stream each."""
        self.received_ns = t_ns
        if self._begin_again_ns is not None:
            return []
        session, guard = self.session, self.guard
        try:
            samples = self._decoder.receive(data, t_ns)
            if session is not None:
                deadline_ns = session.next_deadline()
                self.due_ns = NEVER_NS if deadline_ns is None else deadline_ns
        except Exception as error:  # no bytes of a device may end the daemon or another stream
            self._fail(error, t_ns)
            return []
        if session is not None and (guard.mismatch or session.identity != guard.first):
            guard.check()
        if not samples or guard.mismatch:
            return []
        samples = self.flood.admit(samples, t_ns)
        reads = []
        for source, run in groupby(samples, _SOURCE) if self.device.shared else (("", samples),):
            stream = self.streams.get(source)
            if stream is not None and (read := stream.update(run, arrival)) is not None:
                reads.append(read)
        return reads

    def due(self, t_ns: int) -> list[bytes]:
        """Return what the session writes at ``t_ns``, one item for each datagram that a device expects."""
        session = self.session
        if session is None or not self.up:
            return []
        pieces: list[bytes] = []
        try:
            if self._begin_again_ns is None:
                while (deadline := session.next_deadline()) is not None and deadline <= t_ns:
                    if piece := session.on_time(t_ns):
                        pieces.append(piece)
                    elif session.next_deadline() == deadline:
                        break
                self.due_ns = NEVER_NS if deadline is None else deadline
                return pieces
        except Exception as error:  # the state of a conversation comes from bytes of the device
            self._fail(error, t_ns)
        if self._begin_again_ns is not None and self._begin_again_ns <= t_ns:
            pieces = [greeting] if (greeting := self._begin(t_ns)) else []
        return pieces

    def _fail(self, error: Exception, t_ns: int) -> None:
        """Report bytes that the decoder cannot handle, and restart after them."""
        self.fault = f"its bytes cannot be read ({type(error).__name__}: {error}): they are dropped"
        self.fault_ns = t_ns
        if self.session is not None:
            self.failed, self.due_ns = True, max(t_ns, self._begun_ns + RESTART_NS)
            self._begin_again_ns = self.due_ns
            return
        with suppress(Exception):
            cast("Decoder", self._decoder).forget()


class IdentityGuard:
    """What was opened and which device answered, compared with the config and with the run so far.

    Tare, calibration and mounting belong to one device, so that readings of another one must not be used.

    Args:
        wanted: Identity that the config names, of the device or of what is opened; "" for any.
        session: The conversation in which the device reports its identity; None for a device that sends unasked.

    Attributes:
        opened: What was opened last, e.g. a path or an address; "" before.
        first: First identity that a device reported in this run; "" before.
        mismatch: Why readings must not be used; "" where they may.
    """

    def __init__(self, wanted: str, session: Session | None) -> None:
        self._wanted, self._session = wanted, session
        self._first_opened = ""
        self.opened = self.first = self.mismatch = ""

    def open(self, opened: str) -> bool:
        """Note what was opened; return whether the link was open before in this run."""
        reopened = bool(self._first_opened)
        self._first_opened = self._first_opened or opened
        self.opened = opened
        return reopened

    @property
    def reported(self) -> str:
        """Identity that the device reports; "" if it did not yet, or never does."""
        return self._session.identity if self._session is not None else ""

    def check(self) -> None:
        """Compare what was opened, and the identity that the device reports, if any."""
        session, identity = self._session, self.reported
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
    """Limits the rate of readings: a token bucket that fills at a multiple of the expected rate.

    Attributes:
        rate_hz: Expected rate of all streams of the link, Hz.
        dropped: Readings dropped since the daemon began.
        dropped_ns: When readings were dropped last; None: never.
    """

    def __init__(self) -> None:
        self.rate_hz = self._left = 0.0
        self.dropped = 0
        self.dropped_ns: int | None = None
        self._filled_ns = 0

    def open(self, t_ns: int) -> None:
        """Begin with a full bucket on a link opened at ``t_ns``."""
        self._filled_ns, self._left = t_ns, self._burst()

    def admit(self, samples: Sequence[Sample], t_ns: int) -> Sequence[Sample]:
        """Return readings received at ``t_ns`` without the oldest that exceed the limit."""
        if len(samples) > self._left:
            refill = (t_ns - self._filled_ns) * 1e-9 * FLOOD_FACTOR * self.rate_hz
            self._left, self._filled_ns = min(self._left + refill, self._burst()), t_ns
            surplus = max(len(samples) - int(self._left), 0)
            if surplus:
                self.dropped += surplus
                self.dropped_ns = t_ns
                samples = samples[surplus:]
        self._left -= len(samples)
        return samples

    def _burst(self) -> float:
        return max(BURST_S * self.rate_hz, LEAST_BURST)


def make_links(config: Config, freshness: Mapping[str, Freshness] = {}) -> dict[str, DeviceLink]:
    """Return one link for each address, by the name of the first stream that uses it.

    Args:
        config: The rig.
        freshness: Of the streams whose readings fingers judge, by stream.
    """
    by_address: dict[str, DeviceLink] = {}
    for name, stream in config.streams().items():
        link = by_address.get(stream.port)
        if link is None:
            device = DEVICES[stream.device]
            inquiry = device.inquiry(**device_options(stream)) if device.inquiry is not None else None
            transport = transport_of(stream.port)
            baud = (stream.baud or device.baud or 0) if transport == "serial" else 0
            spec = LinkSpec(name, transport, stream.port, baud, inquiry)
            link = by_address[stream.port] = DeviceLink(spec, stream)
        link.add(stream.sensor, StreamMeter(name, stream, freshness.get(name)))
    return {link.spec.name: link for link in by_address.values()}
