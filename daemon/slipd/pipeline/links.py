"""One link: the device behind it, the streams it carries, and how they are doing."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from slipd.config import Config, Pad, Stream, device_options, transport_of
from slipd.devices import DEVICES, Decoder, Session
from slipd.pipeline.events import LinkSpec
from slipd.pipeline.finger import stale_after_ns
from slipd.pipeline.report import number
from slipd.samples import Sample, TactileSample
from slipd_client.messages import Health

#: A rate that is off by more than this share of the expected one is told.
RATE_TOLERANCE = 0.2
#: The rate is counted over at least this time: a shorter one counts jitter.
RATE_WINDOW_NS = 500_000_000


@dataclass(slots=True)
class StreamMeter:
    """Counts the samples of one stream."""

    name: str
    expected_hz: float
    stale_ns: int
    last_ns: int | None = None
    count: int = 0
    rate_hz: float | None = None
    damage: int = 0
    taxels: int | None = None
    misfit: int | None = None
    _since_ns: int | None = field(default=None, repr=False)
    _counted: int = field(default=0, repr=False)
    _bad_bytes: int = field(default=0, repr=False)

    def tick(self, t_ns: int) -> None:
        """Counts one sample."""
        self.last_ns = t_ns
        self.count += 1
        self.misfit = None

    def measure(self, t_ns: int, bad_bytes: int) -> None:
        """Takes rate and damage of the time since they were last taken; ``bad_bytes`` is the link's running count."""
        if self._since_ns is not None and t_ns - self._since_ns >= RATE_WINDOW_NS:
            self.rate_hz = (self.count - self._counted) * 1e9 / (t_ns - self._since_ns)
            self.damage = bad_bytes - self._bad_bytes
            self._since_ns, self._counted, self._bad_bytes = t_ns, self.count, bad_bytes
        elif self._since_ns is None and self.last_ns is not None:
            self._since_ns, self._counted, self._bad_bytes = t_ns, self.count, bad_bytes


class Link:
    """A port or server, what is spoken on it, and the streams it carries.

    Args:
        spec: What to open.
        stream: The first stream's config, for the device and its options.
    """

    def __init__(self, spec: LinkSpec, stream: Stream) -> None:
        device = DEVICES[stream.device]
        options = device_options(stream)
        self.spec = spec
        self.session: Session | None = device.session(**options) if device.session is not None else None
        self._decoder: Session | Decoder = self.session or device.decoder(**options)
        self.streams: dict[str, StreamMeter] = {}
        self.up = False
        self.reconnects = 0
        self._identity: str | None = None
        self._message = "not opened yet"

    def open(self, identity: str, t_ns: int) -> bytes:
        """The link came up; returns what is to be written first."""
        if self._identity is not None:
            self.reconnects += 1
        self.up, self._identity, self._message = True, identity, ""
        return self.session.start(t_ns) if self.session is not None else b""

    def close(self, reason: str) -> None:
        """The link went down or could not be opened."""
        self.up, self._message = False, reason
        if self.session is not None:
            self.session.stop()

    def receive(self, data: bytes, t_ns: int) -> list[tuple[str, Sample]]:
        """Decodes bytes into samples, each with the name of its stream; what belongs to no stream is passed over."""
        found = []
        for sample in self._decoder.receive(data, t_ns):
            meter = self.streams.get(getattr(sample, "source", ""))
            if meter is None:
                continue
            if isinstance(sample, TactileSample) and len(sample.values) != meter.taxels:
                meter.misfit = len(sample.values)
                continue
            meter.tick(sample.t_ns)
            found.append((meter.name, sample))
        return found

    def due(self, t_ns: int) -> bytes:
        """What the session wants written at ``t_ns``."""
        if self.session is None or not self.up:
            return b""
        written = b""
        while (deadline := self.session.next_deadline()) is not None and deadline <= t_ns:
            chunk = self.session.on_time(t_ns)
            if not chunk and self.session.next_deadline() == deadline:
                break
            written += chunk
        return written

    def health(self, meter: StreamMeter, t_ns: int) -> dict[str, Any]:
        """``status.streams.<name>``."""
        counters = self._decoder.health
        meter.measure(t_ns, counters.bad_bytes)
        level, message = self._level(meter, t_ns)
        return {
            "health": int(level),
            "message": message,
            "hardware_id": self._identity,
            "address": self.spec.address,
            "state": self.session.state if self.session is not None else None,
            "expected_hz": meter.expected_hz,
            "rate_hz": number(meter.rate_hz),
            "age_s": None if meter.last_ns is None else (t_ns - meter.last_ns) * 1e-9,
            "samples": meter.count,
            "good": counters.good,
            "bad": counters.bad,
            "lost": counters.lost,
            "bad_bytes": counters.bad_bytes,
            "reconnects": self.reconnects,
        }

    def _level(self, meter: StreamMeter, t_ns: int) -> tuple[Health, str]:
        if not self.up:
            return Health.ERROR, self._message
        if meter.misfit is not None:
            return Health.ERROR, f"images of {meter.misfit} taxels, where rows and cols say {meter.taxels}"
        if meter.last_ns is None:
            return Health.STALE, "open, but no reading yet"
        age = t_ns - meter.last_ns
        if age > meter.stale_ns:
            return Health.STALE, f"no reading for {age * 1e-9:.2f} s"
        if meter.damage > 0:
            return Health.WARN, f"{meter.damage} bytes of late belong to no frame"
        rate = meter.rate_hz
        if rate is not None and abs(rate - meter.expected_hz) > RATE_TOLERANCE * meter.expected_hz:
            return Health.WARN, f"{rate:.0f} Hz instead of {meter.expected_hz:.0f} Hz"
        return Health.OK, ""


def make_links(config: Config) -> dict[str, Link]:
    """One link an address; streams that share an address share the link, named after the first of them."""
    by_address: dict[str, Link] = {}
    for name, stream in config.streams().items():
        link = by_address.get(stream.port)
        if link is None:
            device = DEVICES[stream.device]
            inquiry = device.inquiry(**device_options(stream)) if device.inquiry is not None else None
            spec = LinkSpec(name, transport_of(stream.port), stream.port, stream.baud or device.baud or 0, inquiry)
            link = by_address[stream.port] = Link(spec, stream)
        meter = StreamMeter(name, stream.rate_hz, stale_after_ns(stream))
        if isinstance(stream, Pad):
            meter.taxels = stream.rows * stream.cols
        link.streams[stream.sensor] = meter
    return {link.spec.name: link for link in by_address.values()}
