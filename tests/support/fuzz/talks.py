"""A session and its device on a bad line: no exception, and readings again once the line is good."""

from __future__ import annotations

from random import Random

from fuzz.corpus import STEP_NS, inquire
from fuzz.damage import damage
from fuzz.outcome import Outcome

from slipd.devices import DEVICES
from slipd.tools.sim.emulators import make_emulator

BAD_SHARE = 0.3
"""Of the pieces, in both directions, that suffer a mishap while the line is bad."""

BAD_NS = 6_000_000_000
PATIENCE_NS = 40_000_000_000
"""From the line's getting well to the readings: a device may have to be silent for 10 s before it is begun anew."""

ENOUGH = 20
"""Readings that show that the session runs."""


def fuzz(device: str, seed: int) -> Outcome:
    """One conversation; nothing to do where the device is not spoken to."""
    rng, outcome = Random(seed), Outcome(amount=1)
    emulator = make_emulator(device, seed)
    session = DEVICES[device].session
    if session is None:
        return outcome
    host = session(**emulator.options)
    emulator.opened(0)
    written = host.start(0)
    answer = inquire(device, emulator)
    if answer:
        host.receive(answer, 0)
    heard, now_ns = 0, 0
    while heard < ENOUGH and now_ns < BAD_NS + PATIENCE_NS:
        now_ns += STEP_NS
        bad = now_ns < BAD_NS
        said = emulator.receive(_carried(written, bad, rng), now_ns) if written else []
        for piece in (*said, *emulator.advance(now_ns)):
            samples = host.receive(_carried(piece, bad, rng), now_ns)
            heard += bool(samples) and not bad
        written = b""
        while (due := host.next_deadline()) is not None and due <= now_ns:
            chunk = host.on_time(now_ns)
            if not chunk and host.next_deadline() == due:
                break
            written += chunk
    if heard < ENOUGH:
        outcome.faults.append(f"no readings {PATIENCE_NS * 1e-9:.0f} s after a bad line; it says {host.state!r}")
    return outcome


def _carried(piece: bytes, bad: bool, rng: Random) -> bytes:
    if not (bad and len(piece) > 1 and rng.random() < BAD_SHARE):
        return piece
    return damage(piece, piece[::-1], rng)
