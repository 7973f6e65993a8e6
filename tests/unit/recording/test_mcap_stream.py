"""The packed index of a recording is byte for byte that of the library."""

from __future__ import annotations

from io import BytesIO

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from slipd.recording.mcap_records import keep_index_packed


def written(*, packed: bool, chunks: int) -> bytes:
    output = BytesIO()
    writer = Writer(output, compression=CompressionType.ZSTD)
    assert writer._Writer__chunk_indices == [], "else a new version of the library keeps its index elsewhere"
    if packed:
        keep_index_packed(writer)
    writer.start()
    channels = [writer.register_channel(f"topic-{n}", "msgpack", 0) for n in range(3)]
    for n in range(chunks):
        for channel in channels[: 1 + n % 3]:
            writer.add_message(channel, n, bytes([n % 256]), n)
        writer.flush()
    if packed:
        assert len(writer._Writer__chunk_indices._packed) <= 100 * chunks
    writer.finish()
    return output.getvalue()


def test_the_file_is_that_of_the_library() -> None:
    for chunks in (0, 1, 600):
        data = written(packed=True, chunks=chunks)
        assert data == written(packed=False, chunks=chunks)
    summary = make_reader(BytesIO(data)).get_summary()
    assert summary is not None
    assert len(summary.chunk_indexes) == chunks
