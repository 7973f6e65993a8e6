"""Examine a capture: decode it as the daemon does, and compare the readings with what is expected of the device.

A capture is what a device sent and was sent, with times: a text file that can be sent to others and replayed as a test.
Its first line is a map: format, versions, device, line and options. Each further line is a list: ns since the line was
opened, "in" (from the device) or "out", and the bytes in hexadecimal. It names no port, host or user; the bytes are as
they came, and may contain the serial number of the device.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple, cast

import numpy as np

from slipd import __version__
from slipd.devices import DEVICES, Device
from slipd.devices.shared.device_interface import DecoderHealth
from slipd.errors import SlipdError
from slipd.events import LinkSpec
from slipd.grasp.arm_motion import LEAST_MEAN_MPS2, MOST_MEAN_MPS2
from slipd.publish.stream_health import why_silent
from slipd.tools.discovery.port_probe import recognise
from slipd.types.arrays import Array
from slipd.types.samples import ArmSample, GripperSample, ObjectSample, Sample, TactileSample, WrenchSample

FORMAT = 1
SUFFIX = ".capture"


class Piece(NamedTuple):
    """Bytes of one read ("in", from the device) or write ("out"), and the time since the line was opened."""

    t_ns: int
    direction: Literal["in", "out"]
    data: bytes


@dataclass(frozen=True, slots=True)
class Capture:
    """What went over a line.

    Attributes:
        device: Name of the device that was expected.
        package: Package that provides it, with its version.
        transport: Kind of the line.
        baud: Speed of a serial line, bit/s; 0 for others.
        options: Options of its decoder or session.
        seconds: Time for which the line was read.
        pieces: The bytes, in the order of their times.
        slipd: Version of slipd that wrote it.
    """

    device: str
    package: str
    transport: str
    baud: int
    options: Mapping[str, Any]
    seconds: float
    pieces: list[Piece] = field(default_factory=list)
    slipd: str = __version__

    def text(self) -> str:
        """Return the file."""
        head = {"capture": FORMAT} | {name: getattr(self, name) for name in _HEAD}
        lines = [json.dumps((t_ns, direction, data.hex())) for t_ns, direction, data in self.pieces]
        return "\n".join([json.dumps(head), *lines, ""])


_HEAD = ("slipd", "device", "package", "transport", "baud", "options", "seconds")


def read_capture(path: Path) -> Capture:
    """Read a capture.

    Raises:
        SlipdError: The file cannot be read, or is not a capture.
    """
    try:
        first, *lines = path.read_text(encoding="utf-8").splitlines()
        head = json.loads(first)
        if head["capture"] != FORMAT:
            raise SlipdError(f"{path}: must be a capture of format {FORMAT}, got {head['capture']}")
        pieces = [Piece(int(t_ns), way, bytes.fromhex(data)) for t_ns, way, data in map(json.loads, lines)]
        return Capture(**{name: head[name] for name in _HEAD}, pieces=pieces)
    except OSError as error:
        raise SlipdError(f"{path}: cannot be read: {error.strerror}") from error
    except (ValueError, KeyError, TypeError) as error:
        raise SlipdError(f"{path}: is not a capture of slipd doctor ({type(error).__name__}: {error})") from error


MARGIN = 1.25
"""Factor by which a rate may differ from the one expected."""

LARGEST_N, LARGEST_NM = 10_000.0, 1_000.0
"""No force/torque sensor of a gripper measures more."""

BUNCH_S, SILENCE_S = 0.005, 0.05
"""Readings that come together after a longer pause were held back on their way; the longest usual pause."""

CLOCK_ERROR = 0.01
"""Larger relative difference between the clocks of device and host: no crystal is that wrong."""

BAD_SHARE = 0.01
"""Larger share of bytes that belong to no frame: not a rare disturbance."""

Level = Literal["ok", "look", "wrong"]


class Finding(NamedTuple):
    """One line of the report: "look" is unusual, "wrong" means that the device cannot be used like this."""

    level: Level
    text: str


@dataclass(frozen=True, slots=True)
class Decoded:
    """What a capture decodes to.

    Attributes:
        samples: The readings.
        health: Counters of the decoder.
        bad_bytes_before: Bytes that belong to no frame before the first reading, such as boot text.
        state: State of the conversation; "" for a device that sends unasked.
        identified: The device reported an identity.
    """

    samples: list[Sample]
    health: DecoderHealth
    bad_bytes_before: int
    state: str
    identified: bool


def decode(capture: Capture) -> Decoded:
    """Decode a capture by the decoder or session of its device.

    Raises:
        KeyError: The device is not installed.
    """
    device = DEVICES[capture.device]
    session = device.session(**capture.options) if device.session is not None else None
    listener: Any = session or device.decoder(**capture.options)
    if session is not None:
        session.start(0)
    samples: list[Sample] = []
    before = 0
    for t_ns, direction, data in capture.pieces:
        if direction == "in":
            samples += listener.receive(data, t_ns)
            before = before if samples else listener.health.bad_bytes
        elif session is not None and t_ns > 0:
            session.on_time(t_ns)
    state, identity = ("", "") if session is None else (session.state, session.identity)
    return Decoded(samples, listener.health, before, state, bool(identity))


def examine(capture: Capture, rate_hz: float | None = None) -> list[Finding]:
    """Return what is right and wrong with a capture.

    Args:
        capture: The capture.
        rate_hz: Expected readings per second; None: any rate of the device.
    """
    device, decoded = DEVICES[capture.device], decode(capture)
    received = [piece for piece in capture.pieces if piece.direction == "in"]
    total = sum(len(piece.data) for piece in received)
    if not decoded.samples:
        return list(_why_nothing(capture, device, decoded, total))
    findings = [Finding("ok", f"{total} bytes in {len(received)} reads, {len(decoded.samples)} readings")]
    sources: dict[str, list[Sample]] = {}
    for sample in decoded.samples:
        sources.setdefault(sample.source, []).append(sample)
    for source, samples in sources.items():
        name = f"sensor {source!r}: " if source else ""
        about = (*_timing(device, samples, rate_hz), *_values(samples))
        findings += [Finding(finding.level, name + finding.text) for finding in about]
    findings += _damage(decoded, total)
    identity = "reports an identity" if decoded.identified else "reports no identity: its port identifies it"
    return [*findings, Finding("ok", identity)]


def _why_nothing(capture: Capture, device: Device, decoded: Decoded, total: int) -> Iterator[Finding]:
    spec = LinkSpec("", capture.transport, "the given address", capture.baud)
    garbled = decoded.health.bad_bytes > 0
    why = why_silent(device, spec, "", bytes_come=total > 0, garbled=garbled, state=decoded.state)
    yield Finding("wrong", decoded.health.note or why)
    if decoded.state:
        yield Finding("look", f"the start-up of the device got as far as: {decoded.state}")
    if total and capture.transport == "serial":
        found = recognise([(piece.t_ns, piece.data) for piece in capture.pieces if piece.direction == "in"])
        if found is not None and found.device != device.name:
            yield Finding("look", f"the bytes are those of the device {found.device!r}")


def _timing(device: Device, samples: Sequence[Sample], rate_hz: float | None) -> Iterator[Finding]:
    t_ns = np.array([sample.t_ns for sample in samples])
    span_s = float(t_ns[-1] - t_ns[0]) * 1e-9
    if span_s <= 0.0:
        yield Finding("look", f"{len(samples)} readings at one time: too few for a rate")
        return
    measured_hz = (len(samples) - 1) / span_s
    low_hz, high_hz = (rate_hz, rate_hz) if rate_hz is not None else device.rates_hz
    expected = f"{low_hz:.4g} Hz" if low_hz == high_hz else f"{low_hz:.4g} to {high_hz:.4g} Hz"
    fits = low_hz / MARGIN <= measured_hz <= high_hz * MARGIN
    yield Finding("ok" if fits else "look", f"{measured_hz:.4g} readings/s, expected {expected}")
    arrivals, counts = np.unique(t_ns, return_counts=True)
    pauses_s = np.diff(arrivals) * 1e-9
    together, pause_s = float(np.median(counts)), float(np.median(pauses_s))
    if together >= 2 and pause_s > BUNCH_S:
        hint = "an FTDI adapter holds bytes back for its latency timer, 16 ms by default (docs/first_hardware.md)"
        yield Finding("look", f"{together:.0f} readings come together every {pause_s * 1e3:.1f} ms: {hint}")
    longest_s = float(pauses_s.max())
    if longest_s > max(SILENCE_S, 5.0 / measured_hz):
        yield Finding("look", f"the longest pause between readings is {longest_s * 1e3:.0f} ms")
    yield from _clock(samples, span_s)


def _clock(samples: Sequence[Sample], span_s: float) -> Iterator[Finding]:
    first, last = samples[0].device_time_ns, samples[-1].device_time_ns
    if first is None or last is None or last <= first:  # no clock, or it wrapped
        return
    ratio = (last - first) * 1e-9 / span_s
    level: Level = "look" if abs(ratio - 1.0) > CLOCK_ERROR else "ok"
    yield Finding(level, f"the device's clock advances by {ratio:.4f} s per second of this computer")


def _values(samples: Sequence[Sample]) -> Iterator[Finding]:
    words = Counter(word for sample in samples for word in getattr(sample, "status", ()))
    for word, count in words.items():
        yield Finding("look", f"status {word!r} in {count} of {len(samples)} readings")
    newest = samples[-1]
    if isinstance(newest, GripperSample):
        width = "unknown" if newest.width_m is None else f"{newest.width_m * 1e3:.1f} mm"
        active = "active" if newest.active else "not active"
        yield Finding("ok", f"gripper {active}, width {width}, fault {newest.fault or 'none'}")
        return
    if isinstance(newest, ArmSample):
        yield _arm(cast("Sequence[ArmSample]", samples))
        return
    if isinstance(newest, ObjectSample):
        return
    sensed = cast("Sequence[WrenchSample | TactileSample]", samples)
    rows = [np.ravel(each.numbers if isinstance(each, WrenchSample) else each.values) for each in sensed]
    if len({len(row) for row in rows}) > 1:
        yield Finding("wrong", "the number of taxels changes from image to image")
        return
    values = np.array(rows, dtype=np.float64)
    if not np.all(np.isfinite(values)):
        yield Finding("wrong", "some values are not finite")
        return
    if len(values) > 1 and np.all(values == values[0]):
        yield Finding("look", "every reading is the same to the last digit: is a sensor connected to its electronics?")
    if isinstance(newest, WrenchSample):
        yield from _wrench(values, has_torque=newest.has_torque)
        return
    flat = int(np.sum(np.all(values == values[0], axis=0)))
    span = f"from {values.min():g} to {values.max():g}"
    yield Finding("ok", f"{values.shape[1]} values per image, {span}, {flat} of them never change")


def _arm(samples: Sequence[ArmSample]) -> Finding:
    long_mps2 = float(np.mean(np.linalg.norm([sample.gravity_mps2 for sample in samples], axis=1)))
    fastest_radps = float(np.max(np.linalg.norm([sample.angular_velocity_radps for sample in samples], axis=1)))
    text = f"gravity {long_mps2:.3g} m/s² in the mean, turns of up to {fastest_radps:.3g} rad/s"
    if LEAST_MEAN_MPS2 <= long_mps2 <= MOST_MEAN_MPS2:
        return Finding("ok", text)
    return Finding("wrong", f"{text}: it must be near 9.81; is it in g, or without gravity?")


def _wrench(values: Array, *, has_torque: bool) -> Iterator[Finding]:
    mean, scatter = values.mean(axis=0), values.std(axis=0)
    parts: list[tuple[str, slice, str, float]] = [("force", slice(0, 3), "N", LARGEST_N)]
    if has_torque:
        parts.append(("torque", slice(3, 6), "N·m", LARGEST_NM))
    for name, part, unit, most in parts:
        level: Level = "wrong" if np.abs(values[:, part]).max() > most else "ok"
        hint = f": beyond {most:g} {unit}, is the unit or the calibration right?" if level == "wrong" else ""
        shown = ", ".join(f"{a:.4g} ± {b:.2g}" for a, b in zip(mean[part], scatter[part], strict=True))
        yield Finding(level, f"{name} {shown} {unit} (mean ± standard deviation){hint}")


def _damage(decoded: Decoded, total: int) -> Iterator[Finding]:
    health = decoded.health
    bad = health.bad_bytes - decoded.bad_bytes_before
    checks = (
        (bad, "bytes after the first reading belong to no frame", bad > BAD_SHARE * total),
        (health.lost, "readings are missing by the device's own count", health.lost > health.good),
        (health.duplicates, "readings were repeated", False),
        (health.restarts, "restarts of the device's counter", False),
    )
    found = [Finding("wrong" if grave else "look", f"{count} {text}") for count, text, grave in checks if count]
    yield from found or [Finding("ok", "no damaged, lost or repeated reading")]
    for text in filter(None, (health.note, health.warning)):
        yield Finding("look", text)
