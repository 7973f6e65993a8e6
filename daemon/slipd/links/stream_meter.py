"""One stream of a link: the times of its readings, their count and rate."""

from __future__ import annotations

from collections.abc import Iterable

from slipd.config import Arm, Gripper, ObservedObject, Pad, Wrench, axes_of, stale_after_ns
from slipd.config import Stream as StreamConfig
from slipd.devices import DEVICES
from slipd.finger.freshness import PROMPT, Arrival, Freshness, Read
from slipd.signals.clock import DeviceClock
from slipd.types.samples import ArmSample, GripperSample, ObjectSample, Sample, TactileSample, WrenchSample

RATE_TOLERANCE = 0.2
"""Relative deviation from the expected rate that is reported."""

RATE_WINDOW_NS = 500_000_000
"""Least time over which the rate is counted; a shorter one counts jitter."""

OLDEST_HOST_NS = 10_000_000_000
"""Oldest time that another process may state: the longest wait of a reading for a stalled loop."""


_KINDS: dict[type[StreamConfig], type[Sample]] = {
    Wrench: WrenchSample,
    Pad: TactileSample,
    ObservedObject: ObjectSample,
    Arm: ArmSample,
    Gripper: GripperSample,
}
"""Class of the readings of each stream."""


class StreamMeter:
    """The readings of one sensor.

    Args:
        name: Name, e.g. ``left.wrench``.
        config: Its table of the config.
        freshness: Freshness that the finger updates with each verdict; None for a stream that belongs to no finger.

    Attributes:
        name: Its name.
        expected_hz: Rate of the config.
        freshness: Whether readings are missing.
        host_clock: The times of the readings are those of this host's CLOCK_MONOTONIC.
        clock: Model of the device's clock.
        rate_hint: How to set the rate on the device; "" where slipd does.
        last_ns: When the newest reading was received; None before the first.
        count: Number of readings.
        rate_hz: Measured rate; None: not known yet.
        damage: Bytes that belong to no frame, in the time over which ``rate_hz`` was measured.
        misfit: Why the newest reading does not fit the config; "" where it does.
        bad_time_ns: When a reading last had a time that is not of this host's clock; None: never.
    """

    def __init__(self, name: str, config: StreamConfig, freshness: Freshness | None = None) -> None:
        device = DEVICES[config.device]
        self.name, self.expected_hz = name, config.rate_hz
        self.freshness, self._judged = freshness or Freshness(stale_after_ns(config)), freshness is not None
        self.host_clock, self.rate_hint = device.host_clock, device.rate_hint
        delay_ns, poll_ns = round(config.delay_s * 1e9), round(config.poll_s * 1e9)
        self.clock = DeviceClock(device.clock_span_ns, delay_ns=delay_ns, poll_ns=poll_ns)
        self._kind, self._shape = _KINDS[type(config)], _shape(config) if isinstance(config, Pad) else ()
        self.last_ns: int | None = None
        self.rate_hz: float | None = None
        self.bad_time_ns: int | None = None
        self.count = self.damage = self._dated_ns = self._counted = self._bad_bytes = 0
        self.misfit = ""
        self._since_ns: int | None = None

    def update(self, samples: Iterable[Sample], arrival: Arrival = PROMPT) -> Read | None:
        """Count and date the readings of one read; None where none of them fits the config."""
        fitting: list[Sample] = []
        times_ns: list[int] = []
        for sample in samples:
            self.misfit = self._misfit(sample)
            if not self.misfit:
                acquired_ns = self._host_time(sample) if self.host_clock else self._device_time(sample, arrival)
                if acquired_ns > self._dated_ns:  # charge and drift are integrated: their times must never go back
                    self._dated_ns = acquired_ns
                fitting.append(sample)
                times_ns.append(self._dated_ns)
        if not fitting:
            return None
        self.last_ns = fitting[-1].t_ns
        self.count += len(fitting)
        if arrival is not PROMPT:
            arrival = arrival._replace(dated=self.host_clock or self.clock.locked)
        if not self._judged:
            self.freshness.update(self.last_ns, self._dated_ns, arrival)
        return Read(fitting, times_ns, arrival, self.name)

    def _host_time(self, sample: Sample) -> int:
        """Return the time that a reading states, of this host's CLOCK_MONOTONIC; its receipt if that is not believed.

        A time in the future is not, nor one older than ``OLDEST_HOST_NS``.
        """
        stated_ns = sample.device_time_ns
        if stated_ns is None:
            return sample.t_ns
        if 0 <= sample.t_ns - stated_ns <= OLDEST_HOST_NS:
            return stated_ns
        self.bad_time_ns = sample.t_ns
        return sample.t_ns

    def _device_time(self, sample: Sample, arrival: Arrival) -> int:
        device_ns = sample.device_time_ns
        if device_ns is not None and isinstance(sample, TactileSample):  # a scan is sent at its end
            device_ns += (len(sample.values) - 1) * sample.dwell_ns
        acquired_ns = self.clock.map(device_ns, sample.t_ns)
        return acquired_ns if self.clock.locked else acquired_ns - arrival.late_ns

    def _misfit(self, sample: Sample) -> str:
        if not isinstance(sample, self._kind):
            return f"readings of kind {type(sample).__name__}, which this stream does not have"
        if isinstance(sample, TactileSample) and sample.values.shape != self._shape:
            return f"images of {_text(sample.values.shape)}, where the config says {_text(self._shape)}"
        return ""

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


def _shape(config: Pad) -> tuple[int, ...]:
    taxels = config.rows * config.cols
    return (taxels, 3) if axes_of(config) == 3 else (taxels,)


def _text(shape: tuple[int, ...]) -> str:
    axes = "three axes" if len(shape) > 1 else "one axis"
    return f"{shape[0]} taxels of {axes}"
