"""Healthy traffic of each device: its emulator's bytes, recorded through its own session or decoder."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any, cast

import numpy as np
from fuzz.conversation import STEP_NS, Conversation
from permits import activate, move

from slipd.devices import DEVICES, Decoder, GripperSession, Session
from slipd.tools.sim.emulators import Emulator
from slipd.types.samples import GripperSample, Sample, TactileSample, WrenchSample

READINGS = 240
"""Enough that a round of damage seldom meets the same neighbours again."""

SETTLED = 8
"""Readings passed over: answers to the last commands still stand between them."""

PATIENCE_STEPS = 60_000
"""A device that has not spoken for a minute of its own time will not."""

MOST_PRESSED = 500.0
"""In a pad's own units; within the range of every one of them."""

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
        host, decoder = _make(self.device, self.options)
        for piece in self.opening:
            host.receive(piece, T_NS)
        return decoder


def key(sample: Sample) -> Key:
    """What a sample says, without when it was received."""
    if isinstance(sample, WrenchSample):
        torque = None if sample.torque_nm is None else sample.torque_nm.tobytes()
        return sample.source, sample.device_time_ns, sample.force_n.tobytes(), torque, sample.status
    if isinstance(sample, GripperSample):
        return (
            *(sample.active, sample.width_m, sample.moving, sample.object),
            *(sample.fault, sample.echo_ok, sample.current_a, sample.force_n),
        )
    return sample.source, sample.device_time_ns, sample.values.tobytes(), sample.status, sample.dwell_ns


@cache
def record(device: str, readings: int = READINGS) -> Corpus:
    """Lets the device's emulator and session talk until enough readings have come."""
    talk = _talk(device, readings + SETTLED)
    host, probe = _make(device, talk.emulator.options)
    opening: list[bytes] = []
    units: list[bytes] = []
    keys: list[tuple[Key, ...]] = []
    begun, passed = b"", 0
    for piece in talk.heard:
        if passed < SETTLED:
            opening.append(piece)
            passed += bool(host.receive(piece, T_NS))
            continue
        begun += piece
        if samples := probe.receive(piece, T_NS):
            units.append(begun)
            keys.append(tuple(key(sample) for sample in samples))
            begun = b""
    messages = not {"serial", "tcp"} & set(DEVICES[device].transports)
    return Corpus(device, talk.emulator.options, tuple(opening), tuple(units), tuple(keys), messages)


def _make(device: str, options: dict[str, Any]) -> tuple[Decoder | Session, Decoder]:
    """What hears the device from the beginning, and the decoder within it; a session has started."""
    known = DEVICES[device]
    if known.session is None:
        decoder = known.decoder(**options)
        return decoder, decoder
    session = known.session(**options)
    session.start(T_NS)
    decoder = getattr(session, "decoder", None) or known.decoder()
    return (session if hasattr(session, "decoder") else decoder), decoder


def _talk(device: str, readings: int) -> Conversation:
    """Let emulator and session talk until the latter has handed on so many readings."""
    talk, rng = Conversation(device, 7), np.random.default_rng(11)
    shapes: dict[str, tuple[int, ...]] = {}
    counted = 0
    while counted < readings:
        if talk.now_ns > PATIENCE_STEPS * STEP_NS:
            raise RuntimeError(f"{device}: {counted} of {readings} readings in a minute")
        for samples in talk.step():
            counted += 1
            shapes |= {sample.source: sample.values.shape for sample in samples if isinstance(sample, TactileSample)}
            _stir(talk.emulator, list(shapes.values()), rng)
            if isinstance(samples[-1], GripperSample):
                _command(cast("GripperSession", talk.host), samples[-1], rng, talk.now_ns)
    return talk


def _stir(emulator: Emulator, shapes: list[tuple[int, ...]], rng: np.random.Generator) -> None:
    """Lets the world change, so that no two readings are alike; pads on one port are pressed as one where they can."""
    feel, press = getattr(emulator, "feel", None), getattr(emulator, "press", None)
    if feel is not None:
        feel(rng.normal(scale=5.0, size=3), rng.normal(scale=0.1, size=3))
    if press is not None and shapes:
        whole = (sum(shape[0] for shape in shapes), *shapes[0][1:])
        try:
            press(rng.uniform(0.0, MOST_PRESSED, size=whole))
        except ValueError:  # this one is pressed alike on all its sensors
            press(rng.uniform(0.0, MOST_PRESSED, size=shapes[0]))


def _command(host: GripperSession, sample: GripperSample, rng: np.random.Generator, now_ns: int) -> None:
    """Lets a gripper move, so that its readings differ: it echoes what it was told."""
    if not sample.active and host.state != "activating":
        activate(host, now_ns)
    elif sample.active:
        speed_mps = None if host.speed_range_mps is None else float(rng.uniform(*host.speed_range_mps))
        move(host, float(rng.uniform(*host.width_range_m)), speed_mps, float(rng.uniform(*host.force_range_n)))
