from __future__ import annotations

import os
from pathlib import Path

import pytest
from replays import RECORDINGS

from slipd.errors import SlipdError
from slipd.tools.draft import draft
from slipd.tools.export.export_command import EXPORT

EXPORTED = "published_ns,v\n"


def names(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir()]


def test_a_result_stands_in_its_place_only_when_it_is_whole(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with draft(out, EXPORT, overwrite=False) as written:
        written.mkdir()
        (written / "a.csv").write_text("1")
        assert not out.exists()
    assert (out / "a.csv").read_text() == "1"
    assert names(tmp_path) == ["out"]


def test_nothing_stays_after_an_error(tmp_path: Path) -> None:
    def fail() -> None:
        with draft(tmp_path / "out", EXPORT, overwrite=False) as written:
            written.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert names(tmp_path) == []


def test_a_result_has_the_permissions_that_the_user_wants(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        with draft(tmp_path / "file", EXPORT, overwrite=False) as written:
            written.write_text("")
        with draft(tmp_path / "folder", EXPORT, overwrite=False) as written:
            written.mkdir()
    finally:
        os.umask(before)
    assert [(tmp_path / name).stat().st_mode & 0o777 for name in ("file", "folder")] == [0o640, 0o750]


@pytest.mark.parametrize("kind", ["file", "folder", "link"])
def test_what_exists_is_refused_and_stays(tmp_path: Path, kind: str) -> None:
    out = tmp_path / "out"
    make = {"file": lambda: out.write_text("old"), "folder": out.mkdir, "link": lambda: out.symlink_to("nowhere")}
    make[kind]()
    with pytest.raises(SlipdError, match="out: exists already; give a new name, or --overwrite"):
        draft(out, EXPORT, overwrite=False).__enter__()
    assert names(tmp_path) == ["out"]


def test_an_earlier_result_is_replaced_as_a_whole(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "old.csv").write_text(EXPORTED)
    (out / "metadata.yaml").write_text("old")
    with draft(out, EXPORT, overwrite=True) as written:
        written.mkdir()
        (written / "new.csv").write_text("new")
    assert names(out) == ["new.csv"]
    assert names(tmp_path) == ["out"]


def test_an_earlier_result_stays_where_the_new_one_fails(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.write_text(EXPORTED)
    with pytest.raises(ValueError, match="bad"), draft(out, EXPORT, overwrite=True):
        raise ValueError("bad")
    assert out.read_text() == EXPORTED


def test_an_earlier_result_returns_where_the_new_one_is_gone(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "old.csv").write_text(EXPORTED)

    def lose() -> None:
        with draft(out, EXPORT, overwrite=True) as written:
            written.mkdir()
            (written.parent / "replaced").write_text("in the way")

    with pytest.raises(SlipdError, match="out: cannot be written"):
        lose()
    assert names(out) == ["old.csv"]


def test_a_folder_with_other_files_is_never_replaced(tmp_path: Path) -> None:
    out = tmp_path / "home"
    out.mkdir()
    (out / "thesis.tex").write_text("years of work")
    with pytest.raises(SlipdError, match=r"is a folder that also holds 'thesis.tex', and is not overwritten"):
        draft(out, EXPORT, overwrite=True).__enter__()
    assert (out / "thesis.tex").exists()


@pytest.mark.parametrize("name", ["xela_sensor1.csv", "rosbag_0.mcap", "rig.yaml"])
def test_data_and_settings_of_other_programs_are_never_replaced(tmp_path: Path, name: str) -> None:
    folder, file = tmp_path / "trial", tmp_path / "trial" / name
    folder.mkdir()
    file.write_bytes(b"\x89MCAP0\r\n" if name.endswith("mcap") else b"time,force\n")
    with pytest.raises(SlipdError, match=f"is a folder that also holds '{name}', and is not overwritten"):
        draft(folder, EXPORT, overwrite=True).__enter__()
    with pytest.raises(SlipdError, match="is not an export of slipd, and is not overwritten"):
        draft(file, EXPORT, overwrite=True).__enter__()
    assert names(folder) == [name]


def test_what_came_meanwhile_stays(tmp_path: Path) -> None:
    out = tmp_path / "out"

    def meet() -> None:
        with draft(out, EXPORT, overwrite=False) as written:
            written.write_text("new")
            out.write_text("of another program")

    with pytest.raises(SlipdError, match="exists already"):
        meet()
    assert out.read_text() == "of another program"
    assert names(tmp_path) == ["out"]


def test_a_recording_is_never_replaced(tmp_path: Path) -> None:
    for out in (tmp_path / "run.mcap", tmp_path / "recordings" / "damaged.mcap"):
        out.parent.mkdir(exist_ok=True)
        out.write_bytes((RECORDINGS / "bota.mcap").read_bytes()[:4000])
    with pytest.raises(SlipdError, match="is a recording of slipd, and is not overwritten"):
        draft(tmp_path / "run.mcap", EXPORT, overwrite=True).__enter__()
    with pytest.raises(SlipdError, match=r"is a folder that also holds 'damaged\.mcap'"):
        draft(tmp_path / "recordings", EXPORT, overwrite=True).__enter__()


def test_a_link_or_a_device_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "file")
    for out in (tmp_path / "link", Path("/dev/null")):
        with pytest.raises(SlipdError, match=r"is (a symbolic link|not a regular file), and is not overwritten"):
            draft(out, EXPORT, overwrite=True).__enter__()


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(SlipdError, match="nowhere/out: cannot be written: No such file or directory"):
        draft(tmp_path / "nowhere" / "out", EXPORT, overwrite=False).__enter__()
    with pytest.raises(SlipdError, match="out: cannot be written: No space left"):
        fill(tmp_path / "out")


def fill(out: Path) -> None:
    with draft(out, EXPORT, overwrite=False), Path("/dev/full").open("w") as file:
        file.write("x")
