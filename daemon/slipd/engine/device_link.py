"""One link: the device behind it, whether it is the right one, and the streams it carries."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from itertools import groupby
from operator import attrgetter
from typing import Any, cast

from slipd.config import Config, device_options, transport_of
from slipd.config import Stream as StreamConfig
from slipd.devices import DEVICES, Decoder, Session
from slipd.engine.silence import LinkActivity, why_silent
from slipd.engine.stream_meter import StreamMeter, make_stream
from slipd.events import LinkSpec
from slipd.samples import Sample
from slipd_client.messages import Health

#: A device may send so many times its expected rate, for a config is easily wrong by two; beyond it floods.
FLOOD_FACTOR = 4.0
#: Readings that may come at once, as time at the expected rate: what waits in the kernel after the daemon stalled.
BURST_S = 1.0
#: Slow streams too come in bunches.
LEAST_BURST = 32.0
#: A flood, or a fault in reading the bytes, is reported for this long after the last one.
FLOOD_TOLD_NS = 1_000_000_000
#: A stream that is silent for longer is looked into; bytes that came within it arrive now.
SILENT_NS = 1_000_000_000


class DeviceLink:
    """A port or server, what is spoken on it, and the streams it carries.

    A device that says it is another than before in this run, or than the config names, is refused: tare, calibration
    and mounting belong to the one that was there.

    Args:
        spec: What to open.
        config: The first stream's config, for the device and its options.

    Attributes:
        streams: The streams by sensor.
        session: The conversation with the device; None where it speaks unasked.
        up: The link is open.
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
        self.dropped = 0
        self._hardware_id = config.hardware_id
        self._opened = self._first_opened = ""
        self._first_said = ""
        self._message = "not opened yet"
        self._stranger = ""
        self._allowed = self._rate_hz = 0.0
        self._allowed_ns = 0
        self._dropped_ns: int | None = None
        self._opened_ns = 0
        self._heard_ns: int | None = None  # bytes came last
        self._bad_bytes = 0  # as the link was opened
        self._fault = ""
        self._fault_ns = 0

    def add(self, sensor: str, stream: StreamMeter) -> None:
        """Adds a stream of the link."""
        self.streams[sensor] = stream
        self._rate_hz += stream.expected_hz

    def open(self, identity: str, t_ns: int) -> bytes:
        """The link came up; returns what is to be written first."""
        if self._first_opened:
            self.reconnects += 1
        self._first_opened = self._first_opened or identity
        self.up, self._opened, self._message, self._stranger = True, identity, "", ""
        self._allowed_ns, self._allowed = t_ns, self._burst()
        self._opened_ns, self._heard_ns = t_ns, None
        self._bad_bytes, self._fault = self._decoder.health.bad_bytes, ""
        self.interrupt()
        greeting = b""
        if self.session is not None:
            greeting = self.session.start(t_ns)
        else:
            cast("Decoder", self._decoder).forget()
        self._recognise()
        return greeting

    @property
    def opened(self) -> str:
        """What was opened last: a path, an address; "" before."""
        return self._opened

    def interrupt(self) -> None:
        """Time passed that nobody saw: what was learned of the device's clock is over."""
        for stream in self.streams.values():
            stream.forget()

    def close(self, reason: str) -> None:
        """The link went down or could not be opened."""
        self.up, self._message = False, reason
        if self.session is not None:
            self.session.stop()

    def farewell(self) -> bytes:
        """Ends the conversation; returns what the device hears last, if anything."""
        return self.session.stop() if self.session is not None and self.up else b""

    def receive(self, data: bytes, t_ns: int, late_ns: int = 0) -> list[tuple[str, Sequence[Sample], list[int]]]:
        """Decodes bytes into runs of samples of one stream: its name, and when each was acquired, CLOCK_MONOTONIC.

        Args:
            data: What was received.
            t_ns: When it was received.
            late_ns: How long the bytes may have waited for the daemon.
        """
        self._heard_ns = t_ns
        try:
            samples = self._decoder.receive(data, t_ns)
        except Exception as error:  # whatever a device sends, it ends neither the daemon nor the other streams
            self._fail(error, t_ns)
            return []
        session = self.session
        if session is not None and (self._stranger or session.identity != self._first_said):
            self._recognise()
        if not samples or self._stranger:
            return []
        if len(samples) > self._allowed:
            samples = self._within_rate(samples, t_ns)
        self._allowed -= len(samples)
        found = []
        for run in [samples] if len(samples) == 1 else _runs(samples):
            stream = self.streams.get(run[0].source)
            if stream is not None:
                kept, times_ns = stream.take(run, late_ns)
                if kept:
                    found.append((stream.name, kept, times_ns))
        return found

    def due(self, t_ns: int) -> list[bytes]:
        """What the session wants written at ``t_ns``, piece by piece: some devices take one request a datagram."""
        session = self.session
        if session is None or not self.up:
            return []
        try:
            return self._due(session, t_ns)
        except Exception as error:  # as above: the conversation rests on what the device sent
            self._fail(error, t_ns)
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
        """Whether the newest times of a stream are those of a clock, not of its receipts."""
        return any(stream.dated for stream in self.streams.values() if stream.name == name)

    def level(
        self, stream: StreamMeter, t_ns: int, unread_ns: int | None = None, late_ns: int = 0
    ) -> tuple[Health, str]:
        """Return how a stream is doing, and a message for people.

        Args:
            stream: One of the link's.
            t_ns: Now.
            unread_ns: For how long a line that brought nothing counts as unread; None: it is empty.
            late_ns: The daemon's longest stall of late.
        """
        counters = self._decoder.health
        stream.measure(t_ns, counters.bad_bytes, late_ns)
        if not self.up:
            return Health.ERROR, self._message
        if self._stranger:
            return Health.ERROR, self._stranger
        if self._fault and t_ns - self._fault_ns < FLOOD_TOLD_NS:
            return Health.ERROR, self._fault
        if self._dropped_ns is not None and t_ns - self._dropped_ns < FLOOD_TOLD_NS:
            return Health.WARN, f"sends more than {FLOOD_FACTOR:g} times its rate: the oldest readings are dropped"
        health, message = stream.level(t_ns, unread_ns, late_ns)
        if health is not Health.STALE:
            return health, message or counters.note
        if t_ns - max(self._opened_ns, stream.last_ns or 0) <= SILENT_NS:
            return health, message
        why = counters.note or self._why_silent(stream, t_ns)
        return health, why if stream.last_ns is None else f"{message}: {why}"

    def _why_silent(self, stream: StreamMeter, t_ns: int) -> str:
        bad_bytes = self._decoder.health.bad_bytes
        newest_ns = [other.last_ns for other in self.streams.values() if other.last_ns is not None]
        heard = LinkActivity(
            bytes_come=self._heard_ns is not None and t_ns - self._heard_ns <= SILENT_NS,
            garbled=bad_bytes > self._bad_bytes if stream.last_ns is None else stream.damage > 0,
            others=bool(newest_ns) and t_ns - max(newest_ns) <= SILENT_NS,
            state=self.session.state if self.session is not None else "",
        )
        sensor = next(name for name, held in self.streams.items() if held is stream)
        return why_silent(self._device, self.spec, sensor, heard)

    def _fail(self, error: Exception, t_ns: int) -> None:
        """Drops what the decoder could not bear, and begins anew behind it."""
        self._fault = f"its bytes cannot be read ({type(error).__name__}: {error}): they are dropped"
        self._fault_ns = t_ns
        if self.session is None:
            with suppress(Exception):
                cast("Decoder", self._decoder).forget()

    def told(self, stream: StreamMeter, t_ns: int) -> dict[str, Any]:
        """``status.streams.<name>`` but for health and message."""
        counters = self._decoder.health
        said = self.session.identity if self.session is not None else ""
        return {
            "hardware_id": said or self._opened or None,
            "address": self.spec.address,
            "state": self.session.state if self.session is not None else None,
            **stream.told(t_ns),
            "good": counters.good,
            "bad": counters.bad,
            "lost": counters.lost,
            "duplicates": counters.duplicates,
            "restarts": counters.restarts,
            "bad_bytes": counters.bad_bytes,
            "dropped": self.dropped,
            "reconnects": self.reconnects,
        }

    def _recognise(self) -> None:
        """Compares what was opened, and what the device says it is, with the config and with the run so far."""
        said = self.session.identity if self.session is not None else ""
        self._first_said = self._first_said or said
        wanted = self._hardware_id
        if wanted and wanted not in (said, self._opened):
            self._stranger = (
                f"another device answers: {said!r}, where hardware_id says {wanted!r}"
                if said
                else f"waits for the device to say that it is {wanted!r}"
            )
        elif not said and self._first_said and self.session is not None and self.session.state != "running":
            self._stranger = "waits for the device to say who it is: another one may have taken its place"
        elif said != self._first_said and said:
            self._stranger = f"another device answers: {said!r}, where {self._first_said!r} was; start the daemon anew"
        elif self._opened != self._first_opened:
            self._stranger = f"another port answers: {self._opened!r}, where {self._first_opened!r} was"
        else:
            self._stranger = ""

    def _within_rate(self, samples: Sequence[Sample], t_ns: int) -> Sequence[Sample]:
        """Refills what may pass, and drops the oldest readings beyond it."""
        refill = (t_ns - self._allowed_ns) * 1e-9 * FLOOD_FACTOR * self._rate_hz
        self._allowed, self._allowed_ns = min(self._allowed + refill, self._burst()), t_ns
        surplus = len(samples) - int(self._allowed)
        if surplus <= 0:
            return samples
        self.dropped += surplus
        self._dropped_ns = t_ns
        return samples[surplus:]

    def _burst(self) -> float:
        return max(BURST_S * self._rate_hz, LEAST_BURST)


def _runs(samples: Sequence[Sample]) -> list[list[Sample]]:
    """Samples of one source each."""
    return [list(run) for _, run in groupby(samples, key=attrgetter("source"))]


def make_links(config: Config) -> dict[str, DeviceLink]:
    """One link an address; streams that share an address share the link, named after the first of them."""
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
