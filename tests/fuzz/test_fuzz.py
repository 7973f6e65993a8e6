"""Split, damaged and random bytes for every device, and that the fuzzing finds decoders that are broken on purpose.

A failure names its seed: ``FUZZ_SEED=S pytest tests/fuzz`` repeats it.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from random import Random
from typing import ClassVar

import pytest
from fuzz import mutations, noise, splits, talks
from fuzz.corpus import Corpus, key, record
from fuzz.damage import KINDS, damage
from fuzz.extent import ROUNDS, SEED, SEEDS
from fuzz.outcome import allowed
from fuzz.strength import STRENGTHS
from project import DOCS

from slipd.devices import DEVICES, Decoder, bota
from slipd.devices.bota import FRAME_LENGTH
from slipd.devices.shared.frame_scanner import FixedLengthScanner
from slipd.types.samples import WrenchSample

DAMAGED = 600
NOISE = 1 << 20
NOISE_OF_A_SLOW_ONE = 1 << 16
SPLITS, SPLIT_FRAMES = 0.04, 24
SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")

devices = pytest.mark.parametrize("device", sorted(DEVICES))


@devices
def test_L1_every_split_of_the_frames_gives_the_same(device: str) -> None:
    outcome = splits.fuzz(record(device), SEED, min(ROUNDS * SPLITS, 1.0), SPLIT_FRAMES)
    assert outcome.amount > 0
    assert outcome.faults == []


@devices
def test_L2_damaged_frames_are_not_believed_and_cost_at_most_one_good_frame(device: str) -> None:
    bits = STRENGTHS[device].mishap_bits
    for seed in SEEDS:
        outcome = mutations.fuzz(record(device), seed, DAMAGED)
        assert outcome.faults == [], seed
        assert bits is None or outcome.false <= allowed(outcome.amount, 2.0**-bits), seed


@devices
def test_L3_random_bytes_are_no_readings(device: str) -> None:
    for seed in SEEDS:
        outcome = noise.fuzz(record(device), seed, NOISE_OF_A_SLOW_ONE if record(device).messages else NOISE)
        assert outcome.faults == [], seed
        assert outcome.false <= allowed(outcome.amount, 2.0 ** -STRENGTHS[device].position_bits), seed


@pytest.mark.parametrize("device", [name for name in sorted(DEVICES) if DEVICES[name].session is not None])
def test_L4_a_session_begins_whatever_the_line_did_to_it_before(device: str) -> None:
    for seed in SEEDS:
        assert talks.fuzz(device, seed).faults == [], seed


class Broken(Corpus):
    """A recording whose receiver is not the device's own."""

    maker: ClassVar[type]

    def receiver(self) -> Decoder:
        return self.maker()


class Believing(bota.Decoder):
    """Looks at the header alone."""

    def __init__(self) -> None:
        super().__init__()
        self._frames = FixedLengthScanner(b"\xaa", FRAME_LENGTH, lambda *_: True, self.health)


class Forgetful(bota.Decoder):
    """Passes over two frames behind each damaged one."""

    def receive(self, data: bytes, t_ns: int) -> list[WrenchSample]:
        samples, bad, missed = [], 0, 0
        for at in range(len(data)):
            for sample in super().receive(data[at : at + 1], t_ns):
                missed = 2 if self.health.bad > bad else missed - 1
                bad = self.health.bad
                samples += [sample] if missed <= 0 else []
        return samples


class Raising(bota.Decoder):
    """Takes damage ill."""

    def receive(self, data: bytes, t_ns: int) -> list[WrenchSample]:
        samples = super().receive(data, t_ns)
        if self.health.bad:
            raise ValueError("bad frame")
        return samples


class Impatient(bota.Decoder):
    """Does not wait for the rest of a frame."""

    def receive(self, data: bytes, t_ns: int) -> list[WrenchSample]:
        samples = super().receive(data, t_ns)
        self._frames.forget()
        return samples


UNITS = tuple(bota.encode_frame((0.1 * n, -n, 7.5), (0.01 * n, 0.0, 0.3), 1250 * n) for n in range(240))


def broken(maker: type) -> Corpus:
    kind = type("Broken", (Broken,), {"maker": maker})
    keys = tuple((key(bota.Decoder().receive(unit, 0)[0]),) for unit in UNITS)
    return kind("bota", {}, (), UNITS, keys, messages=False)


def test_the_decoder_that_is_broken_here_is_sound_when_it_is_not() -> None:
    sound = broken(bota.Decoder)
    assert mutations.fuzz(sound, SEED, DAMAGED).faults == splits.fuzz(sound, SEED, SPLITS).faults == []


def test_a_decoder_that_believes_damage_is_found() -> None:
    outcome = mutations.fuzz(broken(Believing), SEED, DAMAGED)
    assert outcome.false > allowed(outcome.amount, 2.0 ** -STRENGTHS["bota"].position_bits)
    assert noise.fuzz(broken(Believing), SEED, 1 << 24).false > 0


@pytest.mark.parametrize(
    ("maker", "fuzz", "extent", "fault"),
    [
        (Forgetful, mutations.fuzz, DAMAGED, "2 good frames lost"),
        (Raising, mutations.fuzz, DAMAGED, "ValueError"),
        (Raising, noise.fuzz, 1 << 16, "ValueError"),
        (Impatient, splits.fuzz, 1.0, "other samples or health than whole"),
    ],
)
def test_a_decoder_that_is_broken_is_found(maker: type, fuzz: Callable, extent: float, fault: str) -> None:
    assert any(fault in found for found in fuzz(broken(maker), SEED, extent).faults)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_a_mishap_changes_a_reading_and_never_into_another_whole_one(kind) -> None:
    one, other = UNITS[:2]
    rng = Random(SEED)
    changed = [kind(one, other, rng) for _ in range(200)]
    assert sum(damaged != one for damaged in changed) > 100
    assert all(damage(one, other, rng) not in (one, other) for _ in range(200))


def test_the_document_states_the_strength_of_every_device_that_the_bounds_come_from() -> None:
    rows = re.findall(r"^\| `(\w+)`(.*)", (DOCS / "devices.md").read_text(encoding="utf-8"), re.MULTILINE)
    stated = {
        device: "2⁻" + str(strength.position_bits).translate(SUPERSCRIPTS) for device, strength in STRENGTHS.items()
    }
    assert set(stated) == set(DEVICES)
    for device, text in stated.items():
        assert any(device == named and re.search(f"{text}(?![⁰¹²³⁴⁵⁶⁷⁸⁹])", row) for named, row in rows), device
