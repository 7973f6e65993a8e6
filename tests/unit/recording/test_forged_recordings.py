"""Recordings that slipd does not write, made by hand: each is read up to what is wrong, and none costs much."""

import io
import itertools
import re
import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import zstandard
from mcap.writer import CompressionType, Writer
from recorded_entries import ABOUT_RUN, complete, contents

from slipd.errors import RecordingError
from slipd.events import Bytes, Tick
from slipd.recording import entry_walk, mcap_file, mcap_records
from slipd.recording.event_codec import encode_event
from slipd.recording.mcap_file import EVENTS
from slipd.recording.reader import Recording


class Forge:
    """Write files as an attacker or another version might: a valid start, then anything."""

    def __init__(self, path: Path, **other: str) -> None:
        self.path = path
        self.stream = io.BytesIO()
        self.writer = Writer(self.stream, compression=CompressionType.ZSTD)
        self.writer.start(profile="slipd")
        metadata = {"format": "1", "boot": "b", "wall_minus_monotonic_ns": "0", **other}
        metadata["crc32"] = mcap_file.checksum(metadata, "")
        self.writer.add_metadata("slipd", metadata)
        self.writer.add_attachment(0, 0, "config.toml", "", b"")

    def event(self, n: int, *, sequence: int, log_time: int, encoding: str = "msgpack") -> None:
        channel = self.writer.register_channel("slipd/event", encoding, 0)
        self.writer.add_message(channel, log_time, encode_event(n, log_time, Tick()), 0, sequence)

    def read(self, *, extra: bytes = b"") -> tuple[Recording, list]:
        self.writer.flush()
        self.path.write_bytes(self.stream.getvalue() + extra)
        return contents(self.path)


@pytest.fixture
def forge(tmp_path: Path) -> Forge:
    return Forge(tmp_path / "forged.mcap")


@pytest.mark.parametrize(
    ("start", "fault"),
    [({"format": "2"}, "must have format '1', got '2'"), ({"wall_minus_monotonic_ns": "noon"}, "start is damaged")],
)
def test_a_start_of_another_kind_is_refused(tmp_path: Path, start: dict[str, str], fault: str) -> None:
    with pytest.raises(RecordingError, match=fault):
        Forge(tmp_path / "forged.mcap", **start).read()


def test_a_pass_that_ends_early_reports_what_was_missing_until_then(forge: Forge) -> None:
    for n in (0, 5, 6, 7):
        forge.event(n, sequence=n, log_time=n)
    recording, _ = forge.read()
    recording.lost = 0
    assert [entry.n for entry in itertools.islice(recording.entries(), 3)] == [0, 5, 6]
    assert (recording.lost, recording.complete) == (4, False)


def test_an_index_beyond_32_bits_is_followed(forge: Forge) -> None:
    for t_ns, n in enumerate((0, 2**31, 2**32)):
        forge.event(n, sequence=n % 2**32, log_time=t_ns)
    recording, found = forge.read()
    assert ([item.n for item in found], recording.lost) == ([0, 2**31, 2**32], 2**32 - 2)


def inner(opcode: int, body: bytes = b"") -> bytes:
    return struct.pack("<BQ", opcode, len(body)) + body


def chunk(content: bytes, crc: int | None = None, packing: bytes = b"zstd", claimed: int | None = None) -> bytes:
    """Return a chunk record, which claims another size than that of its content if one is given."""
    packed = zstandard.compress(content)
    size = len(content) if claimed is None else claimed
    crc = zlib.crc32(content) if crc is None else crc
    return inner(6, struct.pack("<QQQII4sQ", 0, 0, size, crc, 4, packing, len(packed)) + packed)


def text(value: bytes) -> bytes:
    return struct.pack("<I", len(value)) + value


def channel(number: int, metadata: bytes = b"", topic: bytes = b"slip.left") -> bytes:
    return inner(4, struct.pack("<HH", number, 0) + text(topic) + text(b"msgpack") + text(metadata))


def message(number: int, n: int, payload: bytes) -> bytes:
    return inner(5, struct.pack("<HIQQ", number, n, 0, 0) + payload)


ONE, HIDDEN = channel(1) + message(1, 0, b""), chunk(message(1, 1, b""))
CUT = chunk(ONE)
BOMB = bytes(64 << 20)
LONGER = CUT[:1] + struct.pack("<Q", len(CUT) - 9 + len(HIDDEN)) + CUT[9:] + HIDDEN
END = "slipd/end"
FORGED: dict[str, tuple[Callable[[Forge], object], str]] = {
    "a channel in another encoding": (lambda f: f.event(0, sequence=0, log_time=5, encoding="json"), "not msgpack"),
    "a message on an unknown channel": (lambda f: f.writer.add_message(77, 0, b"", 0, 0), "never announced"),
    "an event of another index": (lambda f: f.event(3, sequence=0, log_time=5), r"entry 0 has another index \(3\)"),
    "an end without a number": (lambda f: f.writer.add_metadata(END, {"entries": "many"}), "end is damaged"),
    "an end of another checksum": (
        lambda f: f.writer.add_metadata(END, {"entries": "7", "crc32": mcap_file.end_metadata(6)["crc32"]}),
        "end is damaged: the number of entries does not match",
    ),
    "an end without its checksum": (
        lambda f: f.writer.add_metadata(END, {"entries": "0", "Crc32": mcap_file.end_metadata(0)["crc32"]}),
        "end is damaged: the number of entries does not match",
    ),
    "a chunk that claims no byte": (lambda f: f.stream.write(chunk(BOMB, claimed=0)), "cannot have written"),
    "a chunk that claims a kilobyte": (lambda f: f.stream.write(chunk(BOMB, claimed=1000)), "cannot have written"),
    "a chunk that claims a terabyte": (lambda f: f.stream.write(chunk(BOMB, claimed=1 << 40)), "cannot have written"),
    "a record of a huge length": (
        lambda f: f.stream.write(struct.pack("<BQ", 6, 1 << 62)),
        "a record of 4611686018427387904 bytes",
    ),
    "a chunk whose checksum is zero": (lambda f: f.stream.write(chunk(ONE, crc=0)), "does not match its bytes"),
    "a chunk of another packing": (lambda f: f.stream.write(chunk(ONE, packing=b"lz4 ")), "cannot have written"),
    "a chunk that claims to be an index": (lambda f: f.stream.write(b"\x07" + CUT[1:] + CUT), "a record of kind 7 at"),
    "a record longer than its content": (lambda f: f.stream.write(LONGER), "bytes that holds"),
    "an empty record outside of chunks": (lambda f: f.stream.write(inner(0x77) * 100_000), "a record of kind 119 at"),
}


@pytest.mark.parametrize(("write", "fault"), FORGED.values(), ids=FORGED)
def test_what_slipd_cannot_have_written_stops_the_reading_before_it(
    forge: Forge, write: Callable[[Forge], object], fault: str
) -> None:
    forge.writer.flush()
    write(forge)
    recording, found = forge.read()
    assert (found, recording.lost) == ([], 0)
    assert re.search(fault, str(recording.fault)), recording.fault


FILL = mcap_records.RECORD_LIMIT_BYTES
NESTED = inner(6, struct.pack("<QQQII4sQ", 0, 0, 0, 0, 4, b"zstd", 0))


@pytest.mark.parametrize(
    ("records", "fault"),
    [
        (inner(0x77) * (FILL // 9), "a record of kind 119"),
        (inner(15) * (FILL // 9), "a record of kind 15"),
        (NESTED * (FILL // len(NESTED)), "a record of kind 6"),
        (inner(3) * (FILL // 9), "more than 1024 schemas"),
        (channel(1) + channel(1, topic=b"slip.right"), "the number of another"),
        (b"".join(channel(n) for n in range(2000)), "one too many"),
        (channel(1, bytes(FILL // 2)), "a channel or schema of 2097184 bytes"),
        (inner(3, bytes(FILL // 2)), "a channel or schema of 2097152 bytes"),
        (inner(5) * (FILL // 9), "entry 0 is cut off"),
        (inner(4) * (FILL // 9), "damaged channel"),
        (channel(1) + message(1, 0, b"") * 100_000, "is where entry 1 should be"),
        (channel(1) + b"\x05", "ends within a record"),
        (channel(1) + struct.pack("<BQ", 5, 2**63), "ends within a record"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_few_bytes_that_unpack_to_a_mass_of_records_stop_the_reading_at_the_first_wrong_one(
    forge: Forge, records: bytes, fault: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    read: list[int] = []
    one_by_one = entry_walk.inner_records

    def noted(data: bytes) -> Iterator[tuple[int, memoryview]]:
        for opcode, body in one_by_one(data):
            read.append(opcode)
            yield opcode, body

    monkeypatch.setattr(entry_walk, "inner_records", noted)
    recording, _ = forge.read(extra=chunk(records) * 100)
    assert fault in str(recording.fault)
    assert len(read) <= 1026


def test_the_unpacked_size_of_a_whole_file_is_bounded(forge: Forge) -> None:
    zeros = bytes(FILL - 100)
    first = chunk(channel(1) + message(1, 0, zeros))
    rest = b"".join(chunk(message(1, n, zeros)) for n in range(1, 40))
    recording, found = forge.read(extra=first + rest)
    assert 10 <= len(found) <= 25, "64 MiB, or 4000 times some 18 kB"
    assert "bytes, which slipd cannot have written into" in str(recording.fault)


def test_the_most_compressible_of_what_slipd_writes_is_read(tmp_path: Path) -> None:
    """A device that sends only zeros, in the longest possible pieces."""
    file = mcap_file.RecordingFile(tmp_path / "run.mcap", ABOUT_RUN)
    sizes = [65_507] * 1280 + [1 << 20] * 80
    for n, size in enumerate(sizes):
        file.add(n, n, EVENTS, Bytes("left.wrench", bytes(size)))
    file.add(len(sizes), len(sizes), "tactile.left", bytes(mcap_records.ENTRY_LIMIT_BYTES))
    file.finish(len(sizes) + 1)
    assert len(complete(tmp_path / "run.mcap")) == len(sizes) + 1
