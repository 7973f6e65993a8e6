"""Split, damaged, random and torn bytes for every device, made of the traffic of its emulator.

A failure names its seed: ``FUZZ_SEED=S pytest tests/unit/devices/test_every_decoder.py`` repeats it.
"""

from __future__ import annotations

import gc
import inspect
import re
from dataclasses import asdict
from random import Random

import pytest
from fuzz import mutations, noise, splits, talks
from fuzz.corpus import T_NS, key, record
from fuzz.extent import ROUNDS, SEED, SEEDS
from fuzz.outcome import allowed
from fuzz.strength import STRENGTHS
from project import DOCS

from slipd.devices import DEVICES

DAMAGED = 300
NOISE = 1 << 20
NOISE_OF_A_SLOW_ONE = 1 << 16
SPLITS, SPLIT_FRAMES = 0.01, 12
TORN = 8
"""Bytes; each frame has more."""
SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
LONGEST = {"xela": 140_000, "external": 70_000}
"""Bytes that a decoder may keep of noise; elsewhere 4096."""

devices = pytest.mark.parametrize("device", sorted(DEVICES))


@pytest.mark.uncovered
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


@devices
def test_L3_noise_full_of_beginnings_gives_nothing_and_is_not_kept(device: str) -> None:
    rng, begin, decoder = Random(device), record(device).units[0][:4], record(device).receiver()
    for _ in range(200):
        assert list(decoder.receive(rng.randbytes(1000) + begin[: rng.randrange(5)], T_NS)) == []
    held, waiting = {id(decoder): decoder}, [decoder]
    while waiting:
        for part in gc.get_referents(waiting.pop()):
            if id(part) not in held and not isinstance(part, type) and type(part).__module__ != "types":
                held[id(part)] = part
                if not inspect.isroutine(part) and not inspect.ismodule(part) and not isinstance(part, str | bytes):
                    waiting.append(part)
    kept = sum(len(part) for part in held.values() if isinstance(part, str | bytes) and len(part) > 300)
    assert kept < LONGEST.get(device, 4096)


@pytest.mark.parametrize("device", [name for name in sorted(DEVICES) if DEVICES[name].session is not None])
def test_L4_a_session_begins_whatever_the_line_did_to_it_before(device: str) -> None:
    for seed in SEEDS:
        assert talks.fuzz(device, seed).faults == [], seed


@devices
def test_L5_a_frame_that_an_unplug_tore_is_not_completed_by_what_comes_after(device: str) -> None:
    corpus = record(device)
    decoder = corpus.receiver()
    decoder.receive(b"".join(corpus.units[:5]), T_NS)
    torn = corpus.units[5]
    decoder.receive(torn[:-TORN], T_NS)
    decoder.forget()
    before = asdict(decoder.health)
    assert list(decoder.receive(torn[-TORN:], T_NS)) == []
    decoder.forget()
    later = {key(sample) for unit in corpus.units[:5] for sample in decoder.receive(unit, T_NS)}
    assert later.issuperset(corpus.keys[4])
    after = asdict(decoder.health)
    assert all(after[name] == before[name] for name in ("lost", "duplicates", "restarts")), "the numbers are new too"


def test_the_document_states_the_strength_of_every_device_that_the_bounds_come_from() -> None:
    page = (DOCS / "devices.md").read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| `(\w+)`(.*2⁻.*)", page, re.MULTILINE))
    assert rows.keys() == STRENGTHS.keys() == set(DEVICES)
    for device, strength in STRENGTHS.items():
        stated = "2⁻" + str(strength.position_bits).translate(SUPERSCRIPTS)
        assert re.search(f"{stated}(?![⁰¹²³⁴⁵⁶⁷⁸⁹])", rows[device]), device
