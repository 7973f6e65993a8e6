from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
from replays import RECORDINGS

from slipd.errors import RecordingError, SlipdError
from slipd.tools.evaluation.run_figures import TABLE
from slipd.tools.export.export_command import EXPORT
from slipd.tools.outputs import NEW, Kind, draft
from slipd.tools.plot.plot_command import PLOT

EXPORTED = "published_ns,v\n"


def names(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir()]


def test_a_result_stands_in_its_place_only_when_it_is_whole(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with draft(out, EXPORT) as written:
        written.mkdir()
        (written / "a.csv").write_text("1")
        assert not out.exists()
    assert (out / "a.csv").read_text() == "1"
    assert names(tmp_path) == ["out"]


def test_nothing_stays_after_an_error(tmp_path: Path) -> None:
    def fail() -> None:
        with draft(tmp_path / "out", EXPORT) as written:
            written.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    full = pytest.raises(RecordingError, match=f"^{re.escape(str(tmp_path / 'out'))}: full$")
    with full, draft(tmp_path / "out", NEW) as written:
        raise RecordingError(f"{written}: full")
    assert names(tmp_path) == []


def test_a_result_has_the_permissions_that_the_user_wants(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        with draft(tmp_path / "file", EXPORT) as written:
            written.write_text("")
        with draft(tmp_path / "folder", EXPORT) as written:
            written.mkdir()
    finally:
        os.umask(before)
    assert [(tmp_path / name).stat().st_mode & 0o777 for name in ("file", "folder")] == [0o640, 0o750]


RECORDING = (RECORDINGS / "bota.mcap").read_bytes()[:4000]
REFUSED = [
    ({"out": EXPORTED}, None, "out: exists already; give a new name, or --overwrite"),
    ({"out/a.csv": EXPORTED}, None, "out: exists already; give a new name, or --overwrite"),
    ({"out": Path("nowhere")}, None, "out: exists already; give a new name, or --overwrite"),
    ({"out": Path("file")}, EXPORT, "is a symbolic link, and is not overwritten"),
    ({"out": Path("/dev/null")}, EXPORT, "is a symbolic link, and is not overwritten"),
    ({"out/a.csv": EXPORTED, "out/thesis.tex": "of years"}, EXPORT, "is a folder that also holds 'thesis.tex', and"),
    ({"out/xela_sensor1.csv": "time,force\n"}, EXPORT, "is a folder that also holds 'xela_sensor1.csv', and is not"),
    ({"out/rosbag_0.mcap": b"\x89MCAP0\r\n"}, EXPORT, "is a folder that also holds 'rosbag_0.mcap', and is not"),
    ({"out/rig.yaml": "a: 1"}, EXPORT, "is a folder that also holds 'rig.yaml', and is not overwritten"),
    ({"out/damaged.mcap": RECORDING}, EXPORT, "is a folder that also holds 'damaged.mcap', and is not overwritten"),
    ({"out": "time,force\n"}, EXPORT, "is not an export of slipd, and is not overwritten"),
    ({"out": b"\x89MCAP0\r\n"}, EXPORT, "is not an export of slipd, and is not overwritten"),
    ({"out": RECORDING}, EXPORT, "is a recording of slipd, and is not overwritten"),
    ({"out": "<!doctype html>\n<title>thesis</title>"}, PLOT, "is not a plot of slipd, and is not overwritten"),
    ({"out/a.csv": EXPORTED}, PLOT, "is a folder, and is not overwritten"),
    ({"out": RECORDING}, TABLE, "is a recording of slipd, and is not overwritten"),
    ({"out": b"PAR1 notes"}, TABLE, "is not a table of slipd evaluate, and is not overwritten"),
]
"""Files and links that are there, what may replace an earlier one of its kind, and why it does not."""


@pytest.mark.parametrize(("there", "kind", "why"), REFUSED)
def test_what_is_no_earlier_result_is_never_replaced(
    tmp_path: Path, there: dict[str, str | bytes | Path], kind: Kind | None, why: str
) -> None:
    for name, content in there.items():
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        if isinstance(content, Path):
            path.symlink_to(content)
        else:
            path.write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(SlipdError, match=re.escape(why)):
        draft(tmp_path / "out", kind or EXPORT, overwrite=kind is not None).__enter__()
    assert names(tmp_path) == ["out"]
    assert {path.name for path in tmp_path.rglob("*")} == {Path(name).name for name in there} | {"out"}


@pytest.fixture
def earlier(tmp_path: Path) -> Path:
    """An earlier export, a folder."""
    out = tmp_path / "out"
    out.mkdir()
    (out / "old.csv").write_text(EXPORTED)
    (out / "metadata.yaml").write_text("old")
    return out


def test_an_earlier_result_is_replaced_as_a_whole(earlier: Path) -> None:
    with draft(earlier, EXPORT, overwrite=True) as written:
        written.mkdir()
        (written / "new.csv").write_text("new")
    assert (names(earlier), names(earlier.parent)) == (["new.csv"], ["out"])


def test_an_earlier_result_returns_where_the_new_one_is_gone(earlier: Path) -> None:
    def lose() -> None:
        with draft(earlier, EXPORT, overwrite=True) as written:
            written.mkdir()
            (written.parent / "replaced").write_text("in the way")

    with pytest.raises(SlipdError, match="out: cannot be written"):
        lose()
    assert sorted(names(earlier)) == ["metadata.yaml", "old.csv"]


@pytest.mark.parametrize(("kind", "remedy"), [(EXPORT, "give a new name, or --overwrite"), (NEW, "give a new name")])
def test_what_came_meanwhile_stays_and_the_remedy_is_one_that_the_command_has(
    tmp_path: Path, kind: Kind, remedy: str
) -> None:
    out = tmp_path / "out"

    def meet() -> None:
        with draft(out, kind) as written:
            written.write_text("new")
            out.write_text("of another program")

    with pytest.raises(SlipdError, match=f"out: exists already; {remedy}$"):
        meet()
    assert out.read_text() == "of another program"
    assert names(tmp_path) == ["out"]


@pytest.mark.parametrize(
    ("out", "why"),
    [
        ("nowhere/out", "nowhere/out: cannot be written: No such file or directory"),
        ("/dev/null", "is not a regular file, and is not overwritten"),
        ("out", "out: cannot be written: No space left"),
    ],
)
def test_a_place_that_cannot_be_written_is_named(tmp_path: Path, out: str, why: str) -> None:
    with (
        pytest.raises(SlipdError, match=why),
        draft(tmp_path / out, EXPORT, overwrite=True),
        Path("/dev/full").open("w") as file,
    ):
        file.write("x")
