"""Whatever a device sends, the work of its decoder is proportional to the bytes, counted in calls and characters."""

from __future__ import annotations

import random
import sys
from collections.abc import Callable
from typing import Any

import pytest

from slipd.devices import DEVICES, external, xela
from slipd.devices import papillarray as pts
from slipd.devices.shared import rdt_records as rdt
from slipd.devices.shared.device_interface import DecoderHealth
from slipd.tools.sim import emulated_pads as sim
from slipd.tools.sim import emulated_rdt as sim_rdt

READ = 1024
SIZE = 64 * READ
CALLS_A_BYTE = 12
"""A good stream takes about one call per ten bytes, a search byte by byte with checksums about ten calls per byte."""

XELA_NUMBERS = b'{"message":1,"1":{"taxels":368,"calibrated":[' + b".5," * 1103 + b".5]}}"


def repeat(piece: bytes, size: int = SIZE) -> bytes:
    return (piece * (size // len(piece) + 1))[:size]


RECORD = sim_rdt.encode_record((1, 2, 3, 4, 5, 6), 70_000, 7)
HOSTILE: dict[str, tuple[bytes, ...]] = {
    "bota": (b"\xaa", b"App Init\r", b"r,0,C,1\r\n", b"App Init\rname: a\r", b"App Init\rname: a" + b"\r" * 490),
    "optoforce": (b"\xaa", b"\xaa\x07\x08\x1c", b"\xaa\x07\x08\x0a"),
    "netft": (RECORD, RECORD[1:], b"\x00"),
    "robotous": (b"\x55", b"\x55\x0b\xaa"),
    "gauges": (b"\xc3\x3c\x01", b"\xc3"),
    "pvdf": (b"\xa5\x5a\x01", b"\xa5\x5a\x01\x00"),
    "dsacon32": (b"\xaa", b"\xaa\xaa\xaa\x00\x05\x10", b"\xaa\xaa\xaa\x00\xff\x0f" + bytes(6)),
    "wts": (b"\xaa", b"\xaa\xaa\xaa\x00\x05\x10", b"\xaa\xaa\xaa\x00\xff\x00" + bytes(3)),
    "tsf85": (b"\x9a", b"\x9a\x00\x58\xff\x10", b"\x9a\x00\xe3\xff   a"),
    "papillarray": (
        pts.START,
        pts.START * 100 + pts.END * 100,
        pts.START + pts.END * 40,
        pts.START + bytes(8) + pts.END + b"\0",
        sim.encode_blocks([sim.encode_hub(1, 1), (pts.UNDEFINED, pts.END * 100)])[:-6],
    ),
    "external": (
        b"\x83\xa3",
        b"\x83\xa6stream",
        b"\x83\xa4t_ns\x01",
        b"\x84\xa4t_ns\x01\xa6values\xdc\x0f\xff\x01\x01",
    ),
    "xela": (b"{", b"}", b'{"', b'{"a":}', b'{"message":1,"time":.5,.}', b'{"a":[', XELA_NUMBERS),
}
OPTIONS: dict[str, dict[str, Any]] = {"netft": {"calibration": "config"}, "pvdf": {"rows": 8, "cols": 16}}
READ_DEVICES = [name for name, device in DEVICES.items() if device.kind != "gripper"]
STREAMS = [(name, number) for name in READ_DEVICES for number in range(len(HOSTILE[name]) + 1)]


def calls(work: Callable[[], object]) -> int:
    """Count the calls of Python and C functions."""
    count = 0

    def note(frame: object, event: str, argument: object) -> None:
        nonlocal count
        count += event in ("call", "c_call")

    sys.setprofile(note)
    try:
        work()
    finally:
        sys.setprofile(None)
    return count


def receiving(reader: Any, stream: bytes, piece: int = READ) -> int:
    """Count the calls that a decoder or session makes of a stream."""
    return calls(lambda: [reader.receive(stream[at : at + piece], at * 1000) for at in range(0, len(stream), piece)])


@pytest.mark.parametrize(("name", "number"), STREAMS)
def test_a_decoder_makes_a_bounded_number_of_calls_per_byte(name: str, number: int) -> None:
    device = DEVICES[name]
    pieces = [*HOSTILE[name], random.Random(1).randbytes(SIZE)]
    reader: Any = (device.session or device.decoder)(**OPTIONS.get(name, {}))
    if device.session is not None:
        reader.start(0)
    assert receiving(reader, repeat(pieces[number])) <= CALLS_A_BYTE * SIZE


@pytest.mark.parametrize("size", [1 << 12, 1 << 15, 1 << 17])
@pytest.mark.parametrize(
    "text",
    [
        XELA_NUMBERS,
        b'{"message":1,"a":[' + b".5," * 5000,
        b'{"a":' * 900 + b"[" + b"1," * 10_000 + b"}" * 900,
        b'{"message":' * 900 + b"[" + b"1," * 10_000 + b"}" * 900,
        b'{"message":1,"time":.5,.}',
    ],
)
def test_xela_parses_no_character_more_than_four_times(text: bytes, size: int, monkeypatch: pytest.MonkeyPatch) -> None:
    real, parsed = xela.json.loads, []

    def loads(text: str) -> Any:
        parsed.append(len(text))
        return real(text)

    monkeypatch.setattr(xela.json, "loads", loads)
    stream = repeat(text, size)
    receiving(xela.Decoder(), stream)
    assert sum(parsed) <= 4 * size + stream.count(b"."), "a zero is put before each dot"


def run(first: int, count: int) -> bytes:
    return b"".join(sim_rdt.encode_record((n % 1000, 0, 0, 0, 0, n % 7), n, 7 * n) for n in range(first, first + count))


@pytest.mark.parametrize("seed", range(20))
def test_L1_records_are_those_of_a_search_place_by_place_also_of_whole_datagrams(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = random.Random(seed)
    datagrams = []
    for _ in range(12):
        good = run(rng.choice((1, 70_000, (1 << 32) - 4)), rng.randrange(1, 9))
        junk = (rng.randbytes(rng.randrange(200)), bytes(rng.randrange(200)), good[: rng.randrange(len(good))])
        late = good[:36] + good[36:72] * rng.randrange(3) + good[72:]
        datagrams += [good, rng.choice((*junk, late, good))]
    stream = b"".join(datagrams)
    splits = [datagrams, *([stream[at : at + n] for at in range(0, len(stream), n)] for n in (8000, 1000, 11))]
    found = [records_of(pieces) for pieces in splits]
    monkeypatch.setattr(rdt.RecordScanner, "_next_stream", lambda _, buffer, at: buffer.find(b"", at))
    assert found == [records_of(splits[3])] * 4


def records_of(pieces: list[bytes]) -> tuple[str, DecoderHealth]:
    health = DecoderHealth()
    records = rdt.RecordScanner(health, 0xF000)
    return str([each for piece in pieces for each in zip(*records.records(piece), strict=True)]), health


@pytest.mark.parametrize("junk", [bytes(60_000), random.Random(3).randbytes(60_000), repeat(RECORD, 60_000)])
def test_a_search_for_records_in_garbage_takes_far_fewer_calls_than_it_checks_places(junk: bytes) -> None:
    scanner = rdt.RecordScanner(DecoderHealth(), 0xF000)
    assert calls(lambda: scanner.records(junk)) < len(junk) // 20


def test_a_reading_after_any_garbage_is_found() -> None:
    decoder = external.Decoder()
    reading = external.encode_reading("left", 1, force_n=(1.0, 2.0, 3.0))
    for junk in (b"\x83\xa3" * 500, b"\x83\xa6stream" * 500, bytes(5000)):
        assert len(decoder.receive(junk + reading, 0)) == 1
