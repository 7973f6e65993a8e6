"""One stream of a link: the times of its readings, their count and rate, and its health."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import accumulate
from typing import cast

from slipd.config import ObservedObject, Pad, Wrench, axes_of, stale_after_ns
from slipd.config import Stream as StreamConfig
from slipd.devices import DEVICES
from slipd.finger.freshness import PROMPT, Arrival, Freshness
from slipd.signals.clock import DeviceClock
from slipd.signals.host_time import host_time
from slipd.types.samples import GripperSample, ObjectSample, Sample, TactileSample, WrenchSample
from slipd_client.messages import Health
from slipd_client.messages.names import DAEMON_LATE

RATE_TOLERANCE = 0.2
"""Relative deviation from the expected rate that is reported."""

RATE_WINDOW_NS = 500_000_000
"""Least time over which the rate is counted; a shorter one counts jitter."""

BAD_TIME_SHOWN_NS = 1_000_000_000
"""Times that are not of this host's clock are reported for this long after the last one."""


@dataclass(slots=True)
class StreamMeter:
    """The readings of one sensor.

    Attributes:
        name: Name, e.g. ``left.wrench``.
        expected_hz: Rate of the config.
        freshness: Whether readings are missing.
        host_clock: The times of the readings are those of this host's CLOCK_MONOTONIC.
        clock: Model of the device's clock.
        kind: Class of the readings.
        shape: Shape of an image; empty where the readings are not images.
        rate_hint: How to set the rate on the device; "" where slipd does.
        last_ns: When the newest reading was received; None before the first.
        count: Number of readings.
        rate_hz: Measured rate; None: not known yet.
        damage: Bytes that belong to no frame, within the newest count of the rate.
        misfit: Why the newest reading does not fit the config; "" where it does.
    """

    name: str
    expected_hz: float
    freshness: Freshness
    host_clock: bool
    clock: DeviceClock
    kind: type[Sample]
    shape: tuple[int, ...] = ()
    rate_hint: str = ""
    last_ns: int | None = None
    count: int = 0
    rate_hz: float | None = None
    damage: int = 0
    misfit: str = ""
    _bad_time_ns: int | None = field(default=None, repr=False)
    _since_ns: int | None = field(default=None, repr=False)
    _counted: int = field(default=0, repr=False)
    _bad_bytes: int = field(default=0, repr=False)

    def update(self, samples: Sequence[Sample], late_ns: int) -> tuple[Sequence[Sample], list[int]]:
        """Count and date the readings of one read.

        Args:
            samples: The readings, at least one.
            late_ns: How long they may have waited for the daemon: their possible age where the device has no clock.

        Returns:
            The readings that fit the config, and when each was acquired, CLOCK_MONOTONIC.
        """
        self.misfit = self._misfit(samples[-1])
        if self.misfit or (len(samples) > 1 and not self._are_wrenches(samples)):
            samples = [sample for sample in samples if not self._misfit(sample)]
            if not samples:
                return samples, []
        self.last_ns = received_ns = samples[-1].t_ns
        self.count += len(samples)
        times_ns = self._host_times(samples) if self.host_clock else self._device_times(samples, late_ns)
        if self.host_clock or times_ns[0] < self.freshness.acquired_ns:
            # charge and drift are integrated: their times must never go back
            times_ns = list(accumulate(times_ns, max, initial=self.freshness.acquired_ns))[1:]
        self.freshness.update(received_ns, times_ns[-1], Arrival(late_ns, dated=self.dated) if late_ns else PROMPT)
        return samples, times_ns

    @property
    def dated(self) -> bool:
        """The newest times come from a clock, not from receipts."""
        return self.host_clock or self.clock.locked

    def _host_times(self, samples: Sequence[Sample]) -> list[int]:
        times_ns = []
        for sample in samples:
            acquired_ns, believed = host_time(sample.device_time_ns, sample.t_ns)
            if not believed and sample.device_time_ns is not None:
                self._bad_time_ns = sample.t_ns
            times_ns.append(acquired_ns)
        return times_ns

    def _device_times(self, samples: Sequence[Sample], late_ns: int) -> list[int]:
        map_time = self.clock.map
        if self.kind is TactileSample:
            times_ns = [map_time(_scanned_ns(cast("TactileSample", sample)), sample.t_ns) for sample in samples]
        else:
            times_ns = [map_time(sample.device_time_ns, sample.t_ns) for sample in samples]
        if late_ns and not self.clock.locked:
            return [t_ns - late_ns for t_ns in times_ns]
        return times_ns

    def forget(self) -> None:
        """Forget the model of the device's clock: the link was opened anew, or the host slept."""
        self.clock.forget()

    def _misfit(self, sample: Sample) -> str:
        if not isinstance(sample, self.kind):
            return f"readings of kind {type(sample).__name__}, which this stream does not have"
        if isinstance(sample, TactileSample) and sample.values.shape != self.shape:
            return f"images of {_shape(sample.values.shape)}, where the config says {_shape(self.shape)}"
        return ""

    def _are_wrenches(self, samples: Sequence[Sample]) -> bool:
        """Return whether every reading is a wrench, in a stream of wrenches: then all fit the config."""
        return self.kind is WrenchSample and set(map(type, samples)) == {WrenchSample}

    def measure(self, t_ns: int, bad_bytes: int, late_ns: int = 0) -> None:
        """Update rate and damage, counted since the last update.

        Args:
            t_ns: Now.
            bad_bytes: The link's running count.
            late_ns: The longest recent stall of the daemon: a long one delays the count and so distorts the rate.
        """
        if self._since_ns is not None and late_ns > RATE_TOLERANCE * RATE_WINDOW_NS:
            self._since_ns = None
        if self._since_ns is not None and t_ns - self._since_ns >= RATE_WINDOW_NS:
            self.rate_hz = (self.count - self._counted) * 1e9 / (t_ns - self._since_ns)
            self.damage = bad_bytes - self._bad_bytes
            self._since_ns, self._counted, self._bad_bytes = t_ns, self.count, bad_bytes
        elif self._since_ns is None and self.last_ns is not None:
            self._since_ns, self._counted, self._bad_bytes = t_ns, self.count, bad_bytes

    def condition(self, t_ns: int, unread_ns: int | None = None, late_ns: int = 0) -> tuple[Health, str]:
        """Return the health of the stream of an open link, and a message for people; see `DeviceLink.condition`."""
        if self.misfit:
            return Health.ERROR, self.misfit
        if self.last_ns is None:
            return Health.STALE, "open, but no reading yet"
        if self.freshness.is_stale(t_ns, unread_ns):
            return Health.STALE, f"no reading for {self.freshness.silent_ns(t_ns, unread_ns) * 1e-9:.2f} s"
        if self.clock.late_ns > self.freshness.stale_ns:
            return (
                Health.STALE,
                f"its readings are {self.clock.late_ns * 1e-9:.2f} s older than before when they come:"
                " does a driver, gateway or adapter buffer them? restart it",
            )
        if late_ns > self.freshness.stale_ns:
            return Health.WARN, f"{DAEMON_LATE} {late_ns * 1e-9:.2f} s: readings waited, the sensor went on"
        if self.damage > 0:
            return Health.WARN, f"{self.damage} recent bytes belong to no frame"
        if self._bad_time_ns is not None and t_ns - self._bad_time_ns < BAD_TIME_SHOWN_NS:
            return Health.WARN, "its times are not of this host's CLOCK_MONOTONIC: receipt times are used"
        if self.clock.state == "not_a_clock":
            return (
                Health.WARN,
                "its clock is unusable (stuck, jumping, or off by more than 1000 ppm): receipt times are used",
            )
        rate = self.rate_hz
        if rate is not None and abs(rate - self.expected_hz) > RATE_TOLERANCE * self.expected_hz:
            hint = self.rate_hint and f": {self.rate_hint}"
            return Health.WARN, f"{rate:.0f} Hz instead of {self.expected_hz:.0f} Hz{hint}"
        return Health.OK, ""


def make_stream(name: str, config: StreamConfig) -> StreamMeter:
    """Return the stream of a table of the config."""
    device = DEVICES[config.device]
    poll_ns = round(config.poll_s * 1e9)
    clock = DeviceClock(device.clock_span_ns, delay_ns=round(config.delay_s * 1e9), poll_ns=poll_ns)
    kind: type[Sample] = GripperSample
    shape: tuple[int, ...] = ()
    if isinstance(config, Wrench):
        kind = WrenchSample
    elif isinstance(config, ObservedObject):
        kind = ObjectSample
    elif isinstance(config, Pad):
        taxels = config.rows * config.cols
        kind, shape = TactileSample, (taxels, 3) if axes_of(config) == 3 else (taxels,)
    return StreamMeter(
        name, config.rate_hz, Freshness(stale_after_ns(config)), device.host_clock, clock, kind, shape, device.rate_hint
    )


def _scanned_ns(sample: TactileSample) -> int | None:
    """Return the device time at the end of a scan: its values are sent together then."""
    start_ns = sample.device_time_ns
    return None if start_ns is None else start_ns + (len(sample.values) - 1) * sample.dwell_ns


def _shape(shape: tuple[int, ...]) -> str:
    axes = "three axes" if len(shape) > 1 else "one axis"
    return f"{shape[0]} taxels of {axes}"
