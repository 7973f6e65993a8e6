"""The files of the ROS package slipd_msgs are those of the types."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

import slipd_client.ros
from slipd_client.ros.message_package import files, main, write
from slipd_client.ros.slipd_types import SLIPD_TYPES

SHIPPED = Path(slipd_client.ros.__file__).parent / "slipd_msgs"


def test_the_shipped_files_are_those_of_the_types(tmp_path: Path) -> None:
    """``python -m slipd_client.ros.message_package clients/slipd_client/ros`` writes them."""
    written = write(tmp_path)
    names = {str(path.relative_to(written)) for path in written.rglob("*") if path.is_file()}
    assert names == set(files())
    assert {str(path.relative_to(SHIPPED)) for path in SHIPPED.rglob("*") if path.is_file()} == names
    for name in names:
        assert (SHIPPED / name).read_bytes() == (written / name).read_bytes(), name


def test_the_package_depends_on_every_package_it_uses_and_names_every_message() -> None:
    texts = files()
    depends = {each.text for each in ET.fromstring(texts["package.xml"]).iter("depend")}
    used = {field.type.partition("/")[0] for kind in SLIPD_TYPES.values() for field in kind.fields if "/" in field.type}
    assert depends == used - {"slipd_msgs"}
    for name in SLIPD_TYPES:
        assert f'"msg/{name.partition("/")[2]}.msg"' in texts["CMakeLists.txt"]


def test_the_command_says_what_it_wrote_or_why_not(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(tmp_path)]) == 0
    assert capsys.readouterr().out == f"{tmp_path / 'slipd_msgs'}\n"
    (tmp_path / "file").touch()
    assert main([str(tmp_path / "file")]) == 1
    assert capsys.readouterr().err == f"{tmp_path / 'file'}: cannot be written: Not a directory\n"
    with pytest.raises(SystemExit):
        main([])
