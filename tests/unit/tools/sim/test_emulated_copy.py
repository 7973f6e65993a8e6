"""What changed in the copy of an emulated config is kept in the config that it comes from."""

from __future__ import annotations

from pathlib import Path

import pytest

from slipd import config
from slipd.errors import SlipdError
from slipd.tools.commission.config_update import changed_text
from slipd.tools.sim.emulate_command import emulated_copy, keep, with_changes
from slipd.tools.sim.touched_devices import TouchedDevices

RIG = """# Two fingers.
[finger.left.wrench]
device = "bota"
port = "/dev/left"
hardware_id = "of the real one"
rate_hz = 100.0
sign = -1  # MEASURE

[finger.right.wrench]
device = "bota"
port = "/dev/right"  # behind the table
rate_hz = 100.0

[bus]
publish = "ipc:///run/mine/publish"
"""


def test_values_that_changed_are_in_the_config_and_all_else_is_as_it_was(tmp_path: Path) -> None:
    found = {("finger", "left", "wrench", "sign"): "1", ("finger", "left", "mu"): "0.5"}
    found |= {("finger", "right", "wrench", "mass_kg"): "0.08"}
    text = RIG + "\n[finger.left]\nmu = 0.3\n"
    devices = TouchedDevices(config.parse(text, "rig"), tmp_path)
    copy = devices.config_text()
    kept = with_changes(text, copy, changed_text(copy, found), devices.addresses)
    assert kept == changed_text(text, found)
    assert "of the real one" in kept
    assert "ipc:///run/mine/publish" in kept


def test_ports_that_changed_hands_are_those_of_the_config(tmp_path: Path) -> None:
    devices = TouchedDevices(config.parse(RIG, "rig"), tmp_path)
    copy = devices.config_text()
    left, right = (f'"{devices.addresses[port]}"' for port in ("/dev/left", "/dev/right"))
    swapped = {("finger", "left", "wrench", "port"): right, ("finger", "right", "wrench", "port"): left}
    kept = with_changes(RIG, copy, changed_text(copy, swapped), devices.addresses)
    found = config.parse(kept, "kept").finger
    assert [finger.wrench and finger.wrench.port for finger in found.values()] == ["/dev/right", "/dev/left"]


def test_a_kept_config_replaces_none_and_goes_elsewhere_where_the_folder_cannot_be_written(tmp_path: Path) -> None:
    paths = [keep(text, "rig.toml", tmp_path) for text in ("a", "b", "c")]
    assert paths == [tmp_path / f"rig.commissioned{number}.toml" for number in ("", "-2", "-3")]
    assert [path.read_text() for path in paths] == ["a", "b", "c"]
    elsewhere = keep("a", "rig.toml", tmp_path / "missing")
    assert elsewhere.read_text() == "a"
    elsewhere.unlink()
    elsewhere.parent.rmdir()


def test_a_copy_goes_but_one_that_is_no_text_any_more_stays_with_the_reason(tmp_path: Path) -> None:
    source = tmp_path / "rig.toml"
    source.write_text('port = "/dev/left"\n', encoding="utf-8")
    (tmp_path / "run").mkdir()
    copy = tmp_path / "run" / "rig.toml"
    with (
        pytest.raises(SlipdError, match=r"run/rig\.toml: changed meanwhile, and is not UTF-8 text now; it stays"),
        emulated_copy(copy, 'port = "/pts"\n', source, {"/dev/left": "/pts"}),
    ):
        copy.write_bytes(b"\xff\xfe")
    copy.write_text('port = "/pts"\n', encoding="utf-8")
    with emulated_copy(copy, 'port = "/pts"\n', source, {"/dev/left": "/pts"}):
        assert len(list(copy.parent.iterdir())) == 2
    assert not list(copy.parent.iterdir())
