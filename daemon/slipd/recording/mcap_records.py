"""Read and write the records of an MCAP file, but only kinds and lengths that slipd writes.

The ``mcap`` library decodes each record; this module decides which records it gets, and up to what length.
"""

from __future__ import annotations

import errno
import os
import struct
import zlib
from collections.abc import Iterator
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import zstandard
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Chunk, ChunkIndex, Header, McapRecord, Metadata
from mcap.writer import MCAP0_MAGIC, Writer

from slipd.errors import RecordingError

HEAD = struct.Struct("<BQ")  # opcode and length of an MCAP record
_INDEX_HEAD = struct.Struct("<HI")  # channel, and length of the offsets
_READ: dict[int, type[Header | Metadata | Attachment | Chunk]] = {
    Opcode.HEADER: Header,
    Opcode.METADATA: Metadata,
    Opcode.ATTACHMENT: Attachment,
    Opcode.CHUNK: Chunk,
}
_INNER = frozenset({Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE})
BAD_RECORD = (McapError, ValueError, struct.error, OverflowError, zstandard.ZstdError)
ENTRY_LIMIT_BYTES = 2 * 1024 * 1024
"""Longest entry, bytes: 32 times the longest piece of bytes that a transport hands on."""
RECORD_LIMIT_BYTES = 2 * ENTRY_LIMIT_BYTES
"""Longest record, bytes: a chunk has `slipd.recording.mcap_file.CHUNK_BYTES` and at most one entry more."""


class DamageError(Exception):
    """A recording is damaged or cut off here."""


def open_mcap(path: Path) -> BinaryIO:
    """Open a file and read the magic bytes at its start.

    Raises:
        RecordingError: The file cannot be opened, is empty, or is not an MCAP file.
    """
    try:
        file = path.open("rb")
    except OSError as error:
        raise RecordingError(f"{path}: cannot be opened: {error.strerror}") from error
    magic = file.read(len(MCAP0_MAGIC))
    if magic == MCAP0_MAGIC:
        return file
    file.close()
    if not magic:
        raise RecordingError(f"{path}: is empty: the writer ended before it wrote anything")
    raise RecordingError(f"{path}: not an MCAP file, and so not a recording of slipd")


def ends_closed(file: BinaryIO) -> bool:
    """Return whether the file was closed in good order, by its last bytes."""
    here = file.tell()
    file.seek(0, 2)
    file.seek(max(here, file.tell() - len(MCAP0_MAGIC)))
    closed = file.read() == MCAP0_MAGIC
    file.seek(here)
    return closed


def data_records(file: BinaryIO) -> Iterator[McapRecord]:
    """Yield the relevant records of the data section, up to its end or the end of the file.

    Raises:
        DamageError: A record is cut off, damaged, or not of a kind that slipd writes.
    """
    while True:
        place = file.tell()
        head = _read(file, HEAD.size, place, may_end=True)
        if not head:
            return
        opcode, length = HEAD.unpack(head)
        if opcode == Opcode.DATA_END:
            return
        if length > RECORD_LIMIT_BYTES:
            raise DamageError(f"is damaged at byte {place}: a record of {length} bytes")
        body = _read(file, length, place)
        if opcode in _READ:
            yield _parse(opcode, body, place)
        elif opcode != Opcode.MESSAGE_INDEX or not _is_message_index(body):
            raise DamageError(f"has a record of kind {opcode} at byte {place}, which slipd cannot have written")


def _is_message_index(body: bytes) -> bool:
    """Return whether a record that is skipped is what it claims to be: a chunk must not be skipped in its stead."""
    return len(body) >= _INDEX_HEAD.size and _INDEX_HEAD.unpack_from(body)[1] == len(body) - _INDEX_HEAD.size


def _read(file: BinaryIO, length: int, place: int, *, may_end: bool = False) -> bytes:
    data = file.read(length)
    if len(data) < length and not (may_end and not data):
        raise DamageError(f"was cut off in the record at byte {place}")
    return data


def _parse(opcode: int, body: bytes, place: int) -> McapRecord:
    rest = BytesIO(body)
    try:
        record: McapRecord = _READ[opcode].read(ReadDataStream(rest))
    except BAD_RECORD as error:
        raise DamageError(f"is damaged at byte {place}: {error}") from error
    if rest.tell() < len(body):  # its length, or its kind, is not what was written
        raise DamageError(f"is damaged at byte {place}: a record of {len(body)} bytes that holds {rest.tell()}")
    return record


def unpack_chunk(chunk: Chunk) -> bytes:
    """Return the records of a chunk.

    Raises:
        DamageError: The chunk is damaged, or not one that slipd writes.
    """
    try:
        # The library would allocate whatever length the compressed data claims.
        if chunk.compression != "zstd" or not (
            zstandard.frame_content_size(chunk.data) == chunk.uncompressed_size <= RECORD_LIMIT_BYTES
        ):
            raise DamageError("has a chunk that slipd cannot have written")
        data = zstandard.decompress(chunk.data)
    except BAD_RECORD as error:
        raise DamageError(f"has a damaged chunk: {error}") from error
    if zlib.crc32(data) != chunk.uncompressed_crc:  # of any value: MCAP takes 0 for "not known"
        raise DamageError("has a damaged chunk: its checksum does not match its bytes")
    return data


def inner_records(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and body of each record of a chunk.

    Raises:
        DamageError: A record is cut off, or not of a kind that slipd writes.
    """
    size, at = len(data), 0
    while at < size:
        if size - at < HEAD.size:
            raise DamageError("has a chunk that ends within a record")
        opcode, length = HEAD.unpack_from(data, at)
        if opcode not in _INNER:
            raise DamageError(f"has a chunk with a record of kind {opcode}, which slipd cannot have written")
        begin = at + HEAD.size
        at = begin + length
        if at > size:
            raise DamageError("has a chunk that ends within a record")
        yield opcode, data[begin:at]


class RecordStream:
    """A new file, written record by record.

    Nothing is buffered here, so no part of a failed record can reach the file later.

    Args:
        path: File to create; an existing one is never overwritten.

    Attributes:
        path: The file.

    Raises:
        OSError: The file exists or cannot be created. All methods except `cut_back`, `remove` and `close` raise it when
            the disk fails.
    """

    def __init__(self, path: Path) -> None:
        # A device file exists already, and holds nothing that could be lost.
        self._file = path.open("wb" if path.is_char_device() else "xb", buffering=0)
        self.path = path
        self._written = self._whole = 0

    def write(self, data: bytes) -> int:
        """Write all of ``data``; a disk that is nearly full may take only a part at first."""
        rest = memoryview(data)
        while rest:
            count = self._file.write(rest) or 0
            self._written += count
            rest = rest[count:]
        return len(data)

    def tell(self) -> int:
        """Return the number of bytes written."""
        return self._written

    def flush(self) -> None:
        """Mark everything written so far as complete records; the kernel has them already."""
        self._whole = self._written

    def sync(self) -> None:
        """Pass everything to the disk, so that it survives a power cut; a file that was deleted is a failed disk."""
        os.fdatasync(self._file.fileno())
        if not os.fstat(self._file.fileno()).st_nlink:
            raise OSError(errno.ENOENT, "the file was deleted while it was written")

    def cut_back(self) -> None:
        """Remove everything after the last `flush`; leave a device file unchanged."""
        with suppress(OSError):
            os.ftruncate(self._file.fileno(), self._whole)
            self._file.seek(self._whole)
        self._written = self._whole

    def remove(self) -> None:
        """Close the file, and remove it from its folder."""
        with suppress(OSError):
            if not self.path.is_char_device():
                self.path.unlink()
        self.close()

    def close(self) -> None:
        """Close the file."""
        with suppress(OSError):
            self._file.close()


class PackedChunkIndices:
    """Keeps the index of the chunks compressed until it is written, once, at the end.

    The library keeps an object for each chunk, about 1 kB, and the recorder writes fourteen chunks a second. This takes
    the place of its list, of which it uses `append` and iteration, and of the only item of that list.
    """

    def __init__(self) -> None:
        self._compressor = zstandard.ZstdCompressor(level=1).compressobj()
        self._packed = bytearray()

    def append(self, index: ChunkIndex) -> None:
        """Add the entry of a chunk."""
        builder = RecordBuilder()
        index.write(builder)
        self._packed += self._compressor.compress(bytes(builder.end()))  # type: ignore[no-untyped-call]

    def __iter__(self) -> Iterator[PackedChunkIndices]:
        """Yield what writes all entries."""
        yield self

    def write(self, stream: RecordBuilder) -> None:
        """Write all entries, in order."""
        packed = bytes(self._packed) + self._compressor.flush()
        stream.write(zstandard.ZstdDecompressor().decompressobj().decompress(packed))


def keep_index_packed(writer: Writer) -> None:
    """Let a writer without chunks keep its index packed."""
    writer._Writer__chunk_indices = PackedChunkIndices()  # type: ignore[attr-defined]  # noqa: SLF001 - no public way
