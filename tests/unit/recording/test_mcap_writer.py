"""A file is byte for byte that of the library's own writer."""

from __future__ import annotations

from functools import partial
from io import BytesIO
from pathlib import Path

import pytest
import zstandard
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from slipd.recording.mcap_writer import McapWriter, RecordStream

CONFIG = "config.toml", "application/toml", b"mu = 0.5"


def of_the_library(chunks: int) -> bytes:
    output = BytesIO()
    writer = Writer(output, compression=CompressionType.ZSTD)
    writer.start("slipd", "slipd 1")
    writer.add_metadata("begin", {"a": "b"})
    writer.add_attachment(0, 0, *CONFIG)
    channels: dict[str, int] = {}
    for n in range(chunks):
        for topic in ("a", "b", "c")[: 1 + n % 3]:
            if topic not in channels:
                schema = writer.register_schema(f"slipd.{topic}", "", b"")
                channels[topic] = writer.register_channel(topic, "msgpack", schema)
            writer.add_message(channels[topic], 1000 - n, bytes([n % 256]), 1000 - n, n)
        writer.flush()
    writer.add_metadata("end", {})
    writer.finish()
    return output.getvalue()


@pytest.mark.parametrize("chunks", [0, 1, 500])
def test_the_file_is_that_of_the_library(tmp_path: Path, chunks: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(zstandard, "compress", partial(zstandard.compress, level=1))
    stream = RecordStream(tmp_path / "run.mcap")
    writer = McapWriter(stream, "slipd", "slipd 1")
    writer.add_metadata("begin", {"a": "b"})
    writer.add_attachment(*CONFIG)
    for n in range(chunks):
        for topic in ("a", "b", "c")[: 1 + n % 3]:
            writer.add_message(topic, n, 1000 - n, bytes([n % 256]))
        writer.end_chunk()
    writer.add_metadata("end", {})
    writer.finish()
    stream.close()
    data = (tmp_path / "run.mcap").read_bytes()
    assert data == of_the_library(chunks)
    summary = make_reader(BytesIO(data)).get_summary()
    assert summary is not None
    assert len(summary.chunk_indexes) == chunks
