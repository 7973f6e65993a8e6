"""What every decoder keeps to, whatever a line does to its bytes: shown on the traffic of each emulated device."""

from __future__ import annotations

import gc
import inspect
from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from random import Random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slipd.devices import DEVICES, Device
from slipd.tools.sim.emulators import make_emulator

MS = 1_000_000
READINGS = 5
ROUNDS = 16
"""Pieces of traffic that give readings, one after another."""

UNCHECKED = {"external", "external_gripper", "netft", "tsf85", "xela"}
"""Formats without a checksum of their own: a flipped bit may be another reading."""
COSTS = {"tsf85": 2, "netft": 2, "wsg": 2}
"""Rounds that damage to one may cost; elsewhere itself alone."""
LONGEST = {"xela": 140_000, "external": 70_000}
"""Bytes that a decoder may keep of noise; elsewhere 4096."""

every = pytest.mark.parametrize("name", DEVICES)


def plain(sample: Any) -> tuple[Any, ...]:
    fields = (getattr(sample, name) for name in sample.__slots__)
    return tuple(field.tolist() if hasattr(field, "tolist") else repr(field) for field in fields)


def decoder_of(name: str) -> Any:
    make = DEVICES[name].decoder
    options = make_emulator(name).options
    return make(**{key: options[key] for key in inspect.signature(make).parameters if key in options})


def decode(name: str, pieces: list[bytes]) -> tuple[list[tuple[Any, ...]], Any]:
    decoder = decoder_of(name)
    return [plain(sample) for piece in pieces for sample in decoder.receive(piece, 0)], decoder.health


def listener_to(device: Device) -> Any:
    return (device.session or device.decoder)(**make_emulator(device.name).options)


def new_link(device: Device, listener: Any, seed: int = 0) -> Iterator[tuple[bytes, int]]:
    """Start again, and yield the data of the device with their times; the caller has processed all earlier data."""
    emulator: Any = make_emulator(device.name, seed)
    emulator.opened(0)
    session = listener if device.session is not None else None
    output = emulator.receive(session.start(0), 0) if session else listener.forget() or []
    if device.inquiry is not None and (inquiry := device.inquiry(**emulator.options)) is not None:
        yield emulator.inquire(inquiry.request), 0
    for now_ns in range(MS, 20_000 * MS, MS):
        for data in output + emulator.advance(now_ns):
            yield data, now_ns
        output = []
        while session and (due := session.next_deadline()) is not None and due <= now_ns:
            output += emulator.receive(session.on_time(now_ns), now_ns)
    raise AssertionError(f"{device.name} says too little")


@cache
def rounds(name: str) -> list[bytes]:
    """Return the traffic of a device that runs, in pieces that end with a reading."""
    listener, decoder, begun, found = listener_to(DEVICES[name]), decoder_of(name), b"", []
    for data, now_ns in new_link(DEVICES[name], listener, 5):
        listener.receive(data, now_ns)
        begun += data
        if decoder.receive(data, now_ns):
            found.append(begun)
            begun = b""
        if len(found) > ROUNDS:
            break
    return found[1:]


@every
def test_L1_every_split_reads_the_same(name: str) -> None:
    traffic, rng = rounds(name), Random(name)
    torn = traffic[3][: rng.randrange(1, len(traffic[3]))]
    stream = b"".join((rng.randbytes(40), *traffic[:3], torn, *traffic[4:9]))
    expected = decode(name, [stream])
    assert expected[0]
    for size in (1, 2, 3, 7, 36, 38):
        assert decode(name, [stream[at : at + size] for at in range(0, len(stream), size)]) == expected, size
    for _ in range(40):
        cuts = [0, *sorted(rng.sample(range(len(stream)), 3)), len(stream)]
        assert decode(name, [stream[begin:end] for begin, end in pairwise(cuts)]) == expected, cuts


@every
def test_L2_damage_costs_at_most_what_it_hits(name: str) -> None:
    traffic, rng, middle, strangers = rounds(name), Random(name), ROUNDS // 3, 0
    wanted, _ = decode(name, traffic)
    hit = decode(name, traffic[: middle + COSTS.get(name, 1)])[0]
    kept = [sample for sample in wanted if sample not in hit or sample in decode(name, traffic[:middle])[0]]
    for _ in range(60):
        piece, at = traffic[middle], rng.randrange(len(traffic[middle]))
        flipped = bytes((piece[at] ^ 1 << rng.randrange(8),))
        cut, put = rng.choice([(1, flipped), (1, b""), (0, b"\x5a"), (3, b"\x01\x02\x03")])
        wrong = piece[:at] + put + piece[at + cut :]
        found, health = decode(name, [*traffic[:middle], wrong, *traffic[middle + 1 :]])
        assert [sample for sample in kept if sample in found] == kept, (at, cut, put)
        assert health.good == len(found)
        strangers += any(sample not in wanted for sample in found)
    assert name in UNCHECKED or strangers <= 2


@every
def test_L3_noise_full_of_beginnings_gives_nothing_and_is_not_kept(name: str) -> None:
    rng, begin = Random(name), rounds(name)[0][:4]
    decoder = decoder_of(name)
    for _ in range(200):
        assert list(decoder.receive(rng.randbytes(1000) + begin[: rng.randrange(5)], 0)) == []
    assert decoder.health.bad_bytes > 0
    held, waiting = {id(decoder): decoder}, [decoder]
    while waiting:
        for part in gc.get_referents(waiting.pop()):
            if id(part) not in held and not isinstance(part, type) and type(part).__module__ != "types":
                held[id(part)] = part
                if not inspect.isroutine(part) and not inspect.ismodule(part) and not isinstance(part, str | bytes):
                    waiting.append(part)
    kept = sum(len(part) for part in held.values() if isinstance(part, str | bytes) and len(part) > 300)
    assert kept < LONGEST.get(name, 4096)


@every
@settings(max_examples=20)
@given(parts=st.lists(st.tuples(st.integers(0, 5), st.binary(max_size=60), st.integers(0, 300)), max_size=6))
def test_L4_nothing_raises_and_readings_after_anything_are_read(name: str, parts: list[tuple[int, bytes, int]]) -> None:
    traffic = rounds(name)
    before = [traffic[at][:cut] + noise for at, noise, cut in parts]
    found, _ = decode(name, before + traffic[6:])
    last = decode(name, traffic[6:])[0][-1]
    assert last in found


def counted(health: Any) -> tuple[int, int, int]:
    return health.lost, health.duplicates, health.restarts


def first_readings(device: Device, listener: Any) -> tuple[list[Any], int]:
    """Return the first readings of a new link, and the number of pieces before the last."""
    readings: list[Any] = []
    before = 0
    for data, now_ns in new_link(device, listener):
        readings += [plain(sample) for sample in listener.receive(data, now_ns)]
        if len(readings) >= READINGS:
            break
        before += 1
    return readings, before


@every
def test_L5_a_frame_that_an_unplug_tore_is_not_completed_by_what_comes_after(name: str) -> None:
    device = DEVICES[name]
    expected, last = first_readings(device, listener_to(device))
    listener = listener_to(device)
    for at, (data, now_ns) in enumerate(new_link(device, listener)):
        if at == last:
            break
        listener.receive(data, now_ns)
    listener.receive(data[: len(data) // 2], now_ns)
    next(new_link(device, listener), None)  # the link is opened again
    assert list(listener.receive(data[len(data) // 2 :], now_ns)) == []
    before = counted(listener.health)
    assert (first_readings(device, listener)[0], counted(listener.health)) == (expected, before)
