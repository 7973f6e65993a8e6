"""The hash of source code."""

from __future__ import annotations

from pathlib import Path

from slipd.types.source_stamp import source_stamp


def folder(path: Path, **files: str) -> Path:
    (path / "room").mkdir(parents=True)
    for name, text in files.items():
        (path / "room" / f"{name}.py").write_text(text, encoding="utf-8")
    return path


def test_the_stamp_changes_with_names_and_contents_of_source_files_only(tmp_path: Path) -> None:
    first = source_stamp(folder(tmp_path / "first", a="x = 1\n", b="y = 2\n"))
    same = folder(tmp_path / "same", a="x = 1\n", b="y = 2\n")
    (same / "room" / "cache.pyc").write_bytes(b"compiled")
    assert source_stamp(same) == first
    others = [
        folder(tmp_path / "renamed", a="x = 1\n", c="y = 2\n"),
        folder(tmp_path / "changed", a="x = 1\n", b="y = 3\n"),
        folder(tmp_path / "moved", a="x = 1\ny = 2\n", b=""),
    ]
    assert len({first, *map(source_stamp, others)}) == 4
