"""What a device says when it is well: its emulator's readings, recorded through its own session or decoder."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from slipd.devices import DEVICES, Decoder
from slipd.samples import GripperSample, Sample, WrenchSample
from slipd.sim.emulators import Emulator, make_emulator

READINGS = 240
"""Enough that a round of damage seldom meets the same neighbours again."""

STEP_NS = 1_000_000
SETTLED = 8
"""Readings passed over: answers to the last commands still stand between them."""

PATIENCE_STEPS = 60_000
"""A device that has not spoken for a minute of its own time will not."""

T_NS = 0
"""Receipt of everything that is fuzzed: the split must not show in the times either."""

Key = tuple[Any, ...]


@dataclass(frozen=True)
class Corpus:
    """A device's readings, in order.

    Attributes:
        device: Its name.
        options: With which its decoder was made.
        opening: What it said before the readings, piece by piece: a decoder may need it to understand them.
        units: Bytes of each reading.
        keys: What each unit's samples say, all but when they were received.
        messages: Units travel as whole messages, under the transport's own checks.
    """

    device: str
    options: dict[str, Any]
    opening: tuple[bytes, ...]
    units: tuple[bytes, ...]
    keys: tuple[tuple[Key, ...], ...]
    messages: bool

    def receiver(self) -> Decoder:
        """A decoder that has heard the opening and no reading."""
        receiver = _receiver(self.device, self.options)
        for piece in self.opening:
            receiver.receive(piece, T_NS)
        return receiver


def key(sample: Sample) -> Key:
    """What a sample says, without when it was received."""
    if isinstance(sample, WrenchSample):
        torque = None if sample.torque_nm is None else sample.torque_nm.tobytes()
        return sample.source, sample.device_time_ns, sample.force_n.tobytes(), torque, sample.status
    if isinstance(sample, GripperSample):
        return (
            sample.active,
            sample.closure,
            sample.moving,
            sample.object,
            sample.fault,
            sample.echo_ok,
            sample.current_a,
        )
    return sample.source, sample.device_time_ns, sample.values.tobytes(), sample.status, sample.dwell_ns


def recordable() -> list[str]:
    """The devices of which a recording can be made."""
    return list(DEVICES)


@cache
def record(device: str, readings: int = READINGS) -> Corpus:
    """Lets the device's emulator and session talk until enough readings have come."""
    emulator = make_emulator(device, 7)
    heard = _talk(device, emulator, readings + SETTLED)
    probe = _receiver(device, emulator.options)
    opening: list[bytes] = []
    units: list[bytes] = []
    keys: list[tuple[Key, ...]] = []
    begun = b""
    passed = 0
    for piece in heard:
        samples = probe.receive(piece, T_NS)
        begun += piece
        if passed < SETTLED:
            opening.append(piece)
            begun = b""
            passed += bool(samples)
        elif samples:
            units.append(begun)
            keys.append(tuple(key(sample) for sample in samples))
            begun = b""
    messages = not {"serial", "tcp"} & set(DEVICES[device].transports)
    return Corpus(device, emulator.options, tuple(opening), tuple(units), tuple(keys), messages)


def _receiver(device: str, options: dict[str, Any]) -> Decoder:
    known = DEVICES[device]
    if known.session is None:
        return known.decoder(**options)
    session = known.session(**options)
    return getattr(session, "decoder", None) or known.decoder()


def _talk(device: str, emulator: Emulator, readings: int) -> list[bytes]:
    """Everything that the emulator says until its session has handed on so many readings."""
    session = DEVICES[device].session
    host = session(**emulator.options) if session is not None else None
    listener: Decoder = host if host is not None else DEVICES[device].decoder(**emulator.options)
    rng = np.random.default_rng(11)
    heard: list[bytes] = []
    counted = 0
    emulator.opened(0)
    written = host.start(0) if host is not None else b""
    for step in range(1, PATIENCE_STEPS):
        now_ns = step * STEP_NS
        _stir(emulator, rng)
        said = emulator.receive(written, now_ns) if written else []
        said += emulator.advance(now_ns)
        heard += said
        for piece in said:
            counted += bool(listener.receive(piece, now_ns))
        if counted >= readings:
            return heard
        written = b""
        while host is not None and (due := host.next_deadline()) is not None and due <= now_ns:
            chunk = host.on_time(now_ns)
            if not chunk and host.next_deadline() == due:
                break
            written += chunk
    raise RuntimeError(
        f"{device}: {counted} of {readings} readings in a minute; its session says {host and host.state}"
    )


def _stir(emulator: Emulator, rng: np.random.Generator) -> None:
    """Lets the world change, so that no two readings are alike."""
    feel = getattr(emulator, "feel", None)
    if feel is not None:
        feel(rng.normal(scale=5.0, size=3), rng.normal(scale=0.1, size=3))
