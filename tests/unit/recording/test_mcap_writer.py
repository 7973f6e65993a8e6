"""A file is byte for byte that of the library's own writer."""

from __future__ import annotations

from functools import cache, partial
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest
import zstandard
from mcap.reader import make_reader
from mcap.writer import Writer

from slipd.recording.mcap_writer import McapWriter, RecordStream


class OfTheLibrary(Writer):
    """The writer of the library, to be called as ours."""

    end_chunk = Writer.flush

    @cache  # noqa: B019 - it lives no longer than its file
    def channel(self, topic: str) -> int:
        return self.register_channel(topic, "msgpack", self.register_schema(f"slipd.{topic}", "", b""))

    def add_message(self, topic: str, sequence: int, t_ns: int, data: bytes) -> None:
        super().add_message(self.channel(topic), t_ns, data, t_ns, sequence)


def write(writer: Any, chunks: int) -> None:
    """Write metadata, and chunks of one to three topics, the newest message first."""
    writer.add_metadata("begin", {"a": "b"})
    for n in range(chunks):
        for topic in ("a", "b", "c")[: 1 + n % 3]:
            writer.add_message(topic, n, 1000 - n, bytes([n % 256]))
        writer.end_chunk()
    writer.add_metadata("end", {})
    writer.finish()


@pytest.mark.parametrize("chunks", [0, 1, 500])
def test_the_file_is_that_of_the_library(tmp_path: Path, chunks: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(zstandard, "compress", partial(zstandard.compress, level=1))
    output = BytesIO()
    theirs = OfTheLibrary(output)
    theirs.start("slipd", "slipd 1")
    theirs.add_attachment(0, 0, "config.toml", "application/toml", b"mu = 0.5")
    write(theirs, chunks)
    stream = RecordStream(tmp_path / "run.mcap")
    ours = McapWriter(stream, "slipd", "slipd 1")
    ours.add_attachment("config.toml", "application/toml", b"mu = 0.5")
    write(ours, chunks)
    stream.close()
    assert (tmp_path / "run.mcap").read_bytes() == output.getvalue()
    summary = make_reader(BytesIO(output.getvalue())).get_summary()
    assert summary is not None
    assert len(summary.chunk_indexes) == chunks
