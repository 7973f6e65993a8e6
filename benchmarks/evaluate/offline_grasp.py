"""A simulated grasp through the emulated sensors and the engine, as fast as the processor allows.

The bytes are those that the devices send; they enter the engine as the reads of a live run do, so that everything from
the decoder on runs as in the daemon. Nothing here has a clock, and all randomness comes from the seed.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any, NamedTuple, Protocol

import numpy as np
from evaluate.finger_sensing import FingerSensing, ForceSensing, PadSensing
from simulated_grasp.trace import GraspTrace

from slipd import config
from slipd.engine.engine import Engine
from slipd.events import Bytes, Event, LinkUp, Publish, Reply, Request, Tick
from slipd.recording.mcap_file import EVENTS
from slipd.tools.sim.emulated_pvdf import PvdfPad
from slipd.tools.sim.emulated_wrenches import GaugeAmplifier
from slipd.types.arrays import Array
from slipd_client.messages import encode

LEAD_S = 1.5
"""Time before the trace in which streams run free, both fingers are tared, and the gripper closes."""

TARE_AFTER_S, TARE_S = 0.2, 0.5
CLOSE_S = 0.3
"""How long the grip grows to that of the first sample, just before the trace."""

READ_NS = 2_000_000
"""Default time from one read of the lines to the next, ns."""

TICK_NS = 5_000_000
"""Time from one tick of the engine to the next, as in the daemon, ns."""

KNOT_NS = 1_000_000
"""Grid on which the loads of the taxels are known, ns; linear between."""

PART = 10_000
"""Knots whose images are kept at once."""

BEGIN_NS = 10_000_000_000
"""CLOCK_MONOTONIC at the first sample of the trace, ns."""

PAD_PHASE_NS, RIGHT_PHASE_NS = 250_000, 400_000
"""Nothing keeps the devices in step, so they begin one after another."""

BOOT = "offline"
DEADLINE_NS = 100_000_000


class Heard(NamedTuple):
    """A message: when it left the engine, ns since the first sample of the trace, its topic and its body.

    Times in the body are CLOCK_MONOTONIC; that is `BEGIN_NS` at the first sample.
    """

    t_ns: int
    topic: str
    body: dict[str, Any]


class Asked(NamedTuple):
    """A request: when it is made, s since the first sample of the trace, its operation and its fields."""

    t_s: float
    op: str
    fields: dict[str, Any]


class Log(Protocol):
    """Where a run is written, such as a `slipd.recording.mcap_file.RecordingFile`."""

    def add(self, n: int, t_ns: int, topic: str, content: Event | bytes) -> None:
        """Write the entry of running index ``n``: an event of ``t_ns``, or the bytes that it published."""


def run_offline(
    trace: GraspTrace,
    sensors: Mapping[str, FingerSensing],
    config_text: str,
    seed: int,
    *,
    requests: Sequence[Asked] = (),
    read_ns: int = READ_NS,
    log: Log | None = None,
) -> list[Heard]:
    """Play a simulated grasp to the engine; return every message.

    Before the trace come `LEAD_S` in which the fingers are free, are tared, and close. Its loads then act on them.

    Args:
        trace: The grasp.
        sensors: Sensors of "left", "right" or both; configured by `finger_sensing.offline_config`.
        config_text: Config of the engine, TOML. Its fingers have strain gauges and PVDF pads.
        seed: Seed of all noise, gains and offsets.
        requests: Requests of a client.
        read_ns: Time from one read of the lines to the next.
        log: Gets every event and message, for a recording.

    Raises:
        ConfigError: The config has faults.
        ValueError: The config lacks a sensor or has another device for it, or a request is refused.
    """
    settings = config.parse(config_text, "config of an offline run")
    engine = Engine(settings, boot=BOOT, wall_minus_monotonic_ns=0)
    heard: list[Heard] = []
    entries = 0
    for t_ns, event in _events(trace, sensors, settings, seed, requests, read_ns):
        if log is not None:
            log.add(entries, t_ns, EVENTS, event)
            entries += 1
        for output in engine.handle(event, t_ns):
            if isinstance(output, Publish):
                heard.append(Heard(t_ns - BEGIN_NS, output.topic, output.body))
                if log is not None:
                    log.add(entries, t_ns, output.topic, encode(output.body))
                    entries += 1
            elif isinstance(output, Reply) and not output.body["ok"]:
                raise ValueError(f"a request of an offline run must be granted, got {output.body['error']}")
    return heard


def _events(
    trace: GraspTrace,
    sensors: Mapping[str, FingerSensing],
    settings: config.Config,
    seed: int,
    requests: Sequence[Asked],
    read_ns: int,
) -> Iterator[tuple[int, Event]]:
    """Yield every event in order of time."""
    start_ns = BEGIN_NS - round(LEAD_S * 1e9)
    end_ns = BEGIN_NS + round((trace.t_s[-1] - trace.t_s[0]) * 1e9)
    ups, lines = [], []
    for (name, finger), rng in zip(sensors.items(), np.random.default_rng(seed).spawn(len(sensors)), strict=True):
        view = _View(trace, start_ns, end_ns, right=name == "right")
        options = _options(settings, f"{name}.wrench", "gauges")
        ups.append((start_ns, LinkUp(f"{name}.wrench", f"offline {name}")))
        lines.append(_reads(f"{name}.wrench", view.frames(finger.force, options, rng), read_ns))
        if finger.pad is not None:
            _options(settings, f"{name}.pad", "pvdf")
            ups.append((start_ns, LinkUp(f"{name}.pad", f"offline {name}")))
            lines.append(_reads(f"{name}.pad", view.scans(finger.pad, rng), read_ns))
    tares = [Asked(TARE_AFTER_S - LEAD_S, "tare", {"finger": name, "seconds": TARE_S}) for name in sensors]
    asked = sorted((*tares, *requests), key=lambda request: request.t_s)
    ticks = ((t_ns, Tick()) for t_ns in range(start_ns, end_ns + 1, TICK_NS))
    yield from ups
    yield from heapq.merge(ticks, _requests(asked), *lines, key=lambda timed: timed[0])


def _options(settings: config.Config, stream: str, device: str) -> dict[str, Any]:
    """Return the options of a stream's device in the config."""
    found = settings.streams().get(stream)
    if found is None or found.device != device:
        raise ValueError(f"{stream} must be in the config as {device}, got {found.device if found else 'nothing'}")
    return dict(found.options)


def _reads(link: str, pieces: Iterable[tuple[int, bytes]], read_ns: int) -> Iterator[tuple[int, Event]]:
    """Yield the bytes of a line as they are read: together, at the first read at which they have come."""
    for read, come in groupby(pieces, key=lambda piece: -(-piece[0] // read_ns)):
        yield read * read_ns, Bytes(link, b"".join(data for _, data in come))


def _requests(asked: Iterable[Asked]) -> Iterator[tuple[int, Event]]:
    for number, request in enumerate(asked, start=1):
        t_ns = BEGIN_NS + round(request.t_s * 1e9)
        envelope = {"v": 1, "id": number, "op": request.op, "boot": BOOT, "deadline_ns": t_ns + DEADLINE_NS}
        yield t_ns, Request(b"offline", envelope | request.fields)


class PlayedAmplifier(GaugeAmplifier):
    """An amplifier that plays the loads of a whole run at once, which is faster than to feel each of them."""

    def play(self, times_ns: list[int], loads: Array) -> list[bytes]:
        """Return the frames of readings at these times, of loads of shape (n, 6)."""
        values = loads + [self._stream.next_noise() for _ in loads]
        counts = values @ self._counts_per_unit.T + self._offset
        return [self.encode(taken_ns, row) for taken_ns, row in zip(times_ns, counts, strict=True)]


class _View:
    """What one finger feels of a trace, before and during it.

    Args:
        trace: The grasp.
        start_ns: When the sensors start, CLOCK_MONOTONIC.
        end_ns: When the run ends.
        right: Whether it is the right finger.
    """

    def __init__(self, trace: GraspTrace, start_ns: int, end_ns: int, *, right: bool) -> None:
        self._trace, self._right = trace, right
        self._start_ns, self._end_ns = start_ns, end_ns
        self._phase_ns = RIGHT_PHASE_NS if right else 0

    def frames(
        self, force: ForceSensing, options: dict[str, Any], rng: np.random.Generator
    ) -> Iterator[tuple[int, bytes]]:
        """Yield the frames of the force sensor, and when each has come."""
        begun_ns = self._start_ns + self._phase_ns
        sensor = PlayedAmplifier(
            int(rng.integers(1 << 32)), force.rate_hz, noise_n=force.noise_n, noise_nm=force.noise_nm, **options
        )
        period_ns = 1e9 / force.rate_hz
        taken_ns = np.rint(np.arange(1, (self._end_ns - begun_ns) / period_ns) * period_ns).astype(np.int64)
        t_s = np.asarray((taken_ns + (begun_ns - BEGIN_NS)) * 1e-9, dtype=np.float64)
        wrenches = self._trace.wrench_right if self._right else self._trace.wrench_left
        known_s = self._trace.t_s - self._trace.t_s[0]
        on_pad = np.column_stack([np.interp(t_s, known_s, component) for component in wrenches.T])
        felt = force.felt(t_s, _pressed(t_s)[:, None] * on_pad)
        yield from zip((taken_ns + begun_ns).tolist(), sensor.play(taken_ns.tolist(), felt), strict=True)

    def scans(self, pad: PadSensing, rng: np.random.Generator) -> Iterator[tuple[int, bytes]]:
        """Yield the scans of the pad, and when each has come."""
        begun_ns = self._start_ns + self._phase_ns + PAD_PHASE_NS
        device = PvdfPad(pad.rows, pad.cols, pad.electronics, rng)
        knots_ns = np.arange(KNOT_NS, self._end_ns - begun_ns, KNOT_NS)
        for part_ns in np.split(knots_ns, range(PART, len(knots_ns), PART)):
            loads_n = self._taxel_loads(pad, np.asarray((part_ns + (begun_ns - BEGIN_NS)) * 1e-9, dtype=np.float64))
            for knot_ns, loads in zip(part_ns.tolist(), loads_n, strict=True):
                device.press(loads)
                yield from ((knot_ns + begun_ns, data) for data in device.advance(knot_ns))

    def _taxel_loads(self, pad: PadSensing, t_s: Array) -> Array:
        """Return the load on each taxel at some times, shape (n, taxels), N.

        The normal force is that of each time. How it is distributed changes slowly, so it is computed at every scan.
        """
        first_s = self._trace.t_s[0]
        normal_n = np.interp(t_s + first_s, self._trace.t_s, self._trace.normal_n) * _pressed(t_s)
        step = max(round(1e9 / pad.electronics.rate_hz / KNOT_NS), 1)
        known_s = np.unique(np.clip(np.append(t_s[::step], t_s[-1]), 0.0, None))
        images = self._trace.taxel_loads(pad, known_s + first_s, right=self._right)
        whole_n = np.interp(known_s + first_s, self._trace.t_s, self._trace.normal_n)[:, None]
        shares = np.divide(images, whole_n, out=np.zeros_like(images), where=whole_n > 0.0)
        at = np.interp(t_s, known_s, np.arange(len(known_s)))
        before = at.astype(np.int64)
        after, late = np.minimum(before + 1, len(known_s) - 1), (at - before)[:, None]
        return np.asarray(normal_n[:, None] * (shares[before] * (1.0 - late) + shares[after] * late))


def _pressed(t_s: Array) -> Array:
    """Return the part of the grip that has grown: from none at ``-CLOSE_S`` to all of it at 0."""
    return np.asarray(np.clip(1.0 + t_s / CLOSE_S, 0.0, 1.0), dtype=np.float64)
