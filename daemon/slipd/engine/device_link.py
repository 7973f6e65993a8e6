"""One link: the device behind it, whether it is the right device, and the streams that it carries."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from itertools import groupby
from operator import attrgetter
from typing import cast

from slipd.config import Config, device_options, transport_of
from slipd.config import Stream as StreamConfig
from slipd.devices import DEVICES, Decoder, Session
from slipd.devices.shared.device_interface import DecoderHealth
from slipd.engine.device_identity import DeviceIdentity, Identity
from slipd.engine.flood_limit import FLOOD_FACTOR, FloodLimit
from slipd.engine.silence import LinkActivity, why_silent
from slipd.engine.stream_meter import StreamMeter, make_stream
from slipd.events import LinkSpec
from slipd.types.samples import Sample
from slipd_client.messages import Health

FAULT_SHOWN_NS = 1_000_000_000
"""A flood, or an error in decoding, is reported for this long after it happened last."""
RESTART_NS = 1_000_000_000
"""A session that failed begins anew at once, but no more often than this."""
SILENT_NS = 1_000_000_000
"""A longer silence of a stream is explained; bytes count as arriving for this long."""


class DeviceLink:
    """A port or server, the conversation on it, and the streams that it carries.

    Readings of another device than before in this run, or than the config names, are refused: tare, calibration and
    mounting belong to the device that was there.

    Args:
        spec: What to open.
        config: Config of the first stream, which names the device and its options.

    Attributes:
        streams: The streams by sensor.
        session: The conversation with the device; None for a device that sends unasked.
        up: The link is open.
        flood: Limit of the readings that it may bring.
        reconnects: Times that the link came up again.
        failed: The session failed, and whoever relies on what it knew has not been told; reset it then.
    """

    def __init__(self, spec: LinkSpec, config: StreamConfig) -> None:
        device = DEVICES[config.device]
        options = device_options(config)
        self.spec = spec
        self._device = device
        self.session: Session | None = device.session(**options) if device.session is not None else None
        self._decoder: Session | Decoder = self.session or device.decoder(**options)
        self.streams: dict[str, StreamMeter] = {}
        self.up = False
        self.reconnects = 0
        self.failed = False
        self._identity = DeviceIdentity(config.hardware_id)
        self._message = "not opened yet"
        self.flood = FloodLimit()
        self._opened_ns = 0
        self._received_ns: int | None = None  # when bytes came last
        self._bad_bytes = 0  # of the decoder when the link was opened
        self._fault, self._fault_ns = "", 0
        self._begun_ns = 0  # the session
        self._begin_again_ns: int | None = None  # a session that failed

    def add(self, sensor: str, stream: StreamMeter) -> None:
        """Add a stream of the link."""
        self.streams[sensor] = stream
        self.flood.rate_hz += stream.expected_hz

    def open(self, identity: str, t_ns: int) -> bytes:
        """Begin anew on an opened link; return the first bytes for the device."""
        if self._identity.open(identity):
            self.reconnects += 1
        self.up, self._message = True, ""
        self.flood.open(t_ns)
        self._opened_ns, self._received_ns = t_ns, None
        self._bad_bytes, self._fault = self.counters.bad_bytes, ""
        greeting = self._begin(t_ns)
        self._identity.check(self.session)
        return greeting

    def _begin(self, t_ns: int) -> bytes:
        """Begin the conversation; return the first bytes for the device."""
        self.interrupt()
        self._begun_ns, self._begin_again_ns = t_ns, None
        if self.session is None:
            cast("Decoder", self._decoder).forget()
            return b""
        try:
            return self.session.start(t_ns)
        except Exception as error:  # a device of another package ends no other stream
            self._fail(error, t_ns)
            return b""

    @property
    def counters(self) -> DecoderHealth:
        """Counters of the decoder."""
        return self._decoder.health

    @property
    def opened(self) -> str:
        """Identity of what was opened last: a path or an address; "" before."""
        return self._identity.opened

    @property
    def identity(self) -> Identity:
        """What is known of the device."""
        return Identity(self.session.identity if self.session is not None else "", self._identity.opened)

    def interrupt(self) -> None:
        """Forget the model of the device's clock after a gap in which time passed unseen."""
        for stream in self.streams.values():
            stream.forget()

    def note_slew(self, slewed_ns: int) -> None:
        """Note how far the host's clock has been slewed: the delay of no stream grows by it."""
        for stream in self.streams.values():
            stream.clock.slewed_ns = slewed_ns

    def close(self, reason: str) -> None:
        """End the conversation on a link that went down or could not be opened."""
        self.farewell()
        self.up, self._message = False, reason

    def farewell(self) -> bytes:
        """End the conversation on an open link; return the last bytes for the device, if any."""
        if self.session is None or not self.up:
            return b""
        try:
            return self.session.stop()
        except Exception:  # the link closes in any case
            return b""

    def receive(self, data: bytes, t_ns: int, late_ns: int = 0) -> list[tuple[str, Sequence[Sample], list[int]]]:
        """Decode bytes into readings.

        Args:
            data: The bytes.
            t_ns: When they were received.
            late_ns: How long they may have waited for the daemon.

        Returns:
            Runs of readings of one stream each: its name, the readings, and when each was acquired, CLOCK_MONOTONIC.
        """
        self._received_ns = t_ns
        if self._begin_again_ns is not None:
            return []
        try:
            samples = self._decoder.receive(data, t_ns)
        except Exception as error:  # no bytes of a device may end the daemon or another stream
            self._fail(error, t_ns)
            return []
        session = self.session
        if session is not None and (self._identity.mismatch or session.identity != self._identity.first):
            self._identity.check(session)
        if not samples or self._identity.mismatch:
            return []
        runs = []
        for run in _runs(self.flood.limit(samples, t_ns)):
            stream = self.streams.get(run[0].source)
            if stream is not None:
                kept, times_ns = stream.update(run, late_ns)
                if kept:
                    runs.append((stream.name, kept, times_ns))
        return runs

    def due(self, t_ns: int) -> list[bytes]:
        """Return what the session writes at ``t_ns``, one item for each datagram that a device expects."""
        session = self.session
        if session is None or not self.up:
            return []
        try:
            if self._begin_again_ns is None:
                return self._due(session, t_ns)
        except Exception as error:  # the state of a conversation comes from bytes of the device
            self._fail(error, t_ns)
        if self._begin_again_ns is not None and self._begin_again_ns <= t_ns and (greeting := self._begin(t_ns)):
            return [greeting]
        return []

    @staticmethod
    def _due(session: Session, t_ns: int) -> list[bytes]:
        pieces: list[bytes] = []
        while (deadline := session.next_deadline()) is not None and deadline <= t_ns:
            piece = session.on_time(t_ns)
            if piece:
                pieces.append(piece)
            elif session.next_deadline() == deadline:
                break
        return pieces

    def dated(self, name: str) -> bool:
        """Return whether the newest times of a stream come from a clock, not from receipts."""
        return any(stream.dated for stream in self.streams.values() if stream.name == name)

    def condition(
        self, stream: StreamMeter, t_ns: int, unread_ns: int | None = None, late_ns: int = 0
    ) -> tuple[Health, str]:
        """Return the health of a stream, and a message for people.

        Args:
            stream: A stream of this link.
            t_ns: Now.
            unread_ns: For how long a line that brought nothing counts as unread; None: it is empty.
            late_ns: The longest recent stall of the daemon.
        """
        counters = self.counters
        stream.measure(t_ns, counters.bad_bytes, late_ns)
        if not self.up:
            return Health.ERROR, self._message
        if self._identity.mismatch:
            return Health.ERROR, self._identity.mismatch
        if self._fault and t_ns - self._fault_ns < FAULT_SHOWN_NS:
            return Health.ERROR, self._fault
        if self.flood.dropped_ns is not None and t_ns - self.flood.dropped_ns < FAULT_SHOWN_NS:
            return Health.WARN, f"sends more than {FLOOD_FACTOR:g} times its rate: the oldest readings are dropped"
        health, message = stream.condition(t_ns, unread_ns, late_ns)
        if health is Health.OK and counters.warning:
            return Health.WARN, counters.warning
        if health is not Health.STALE:
            return health, ": ".join(filter(None, (message, counters.warning, counters.note)))
        if t_ns - max(self._opened_ns, stream.last_ns or 0) <= SILENT_NS:
            return health, message
        why = counters.note or self._why_silent(stream, t_ns)
        return health, why if stream.last_ns is None else f"{message}: {why}"

    def _why_silent(self, stream: StreamMeter, t_ns: int) -> str:
        bad_bytes = self.counters.bad_bytes
        newest_ns = [other.last_ns for other in self.streams.values() if other.last_ns is not None]
        activity = LinkActivity(
            bytes_come=self._received_ns is not None and t_ns - self._received_ns <= SILENT_NS,
            garbled=bad_bytes > self._bad_bytes if stream.last_ns is None else stream.damage > 0,
            others=bool(newest_ns) and t_ns - max(newest_ns) <= SILENT_NS,
            state=self.session.state if self.session is not None else "",
        )
        sensor = next(name for name, held in self.streams.items() if held is stream)
        return why_silent(self._device, self.spec, sensor, activity)

    def _fail(self, error: Exception, t_ns: int) -> None:
        """Report bytes that the decoder cannot handle, and begin anew after them."""
        self._fault = f"its bytes cannot be read ({type(error).__name__}: {error}): they are dropped"
        self._fault_ns = t_ns
        if self.session is not None:
            self.failed, self._begin_again_ns = True, max(t_ns, self._begun_ns + RESTART_NS)
            return
        with suppress(Exception):
            cast("Decoder", self._decoder).forget()


def _runs(samples: Sequence[Sample]) -> list[Sequence[Sample]]:
    """Return the readings in runs of one source each."""
    if len(samples) == 1 or len({sample.source for sample in samples}) == 1:
        return [samples]
    return [list(run) for _, run in groupby(samples, key=attrgetter("source"))]


def make_links(config: Config) -> dict[str, DeviceLink]:
    """Return one link for each address, by the name of the first stream that uses it."""
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
        link.add(stream.sensor, make_stream(name, stream))
    return {link.spec.name: link for link in by_address.values()}
