"""The copy of an emulated config goes with the emulation; one that was changed is kept."""

from __future__ import annotations

from pathlib import Path

import pytest

from slipd import config
from slipd.errors import SlipdError
from slipd.tools.commission.config_update import changed_text
from slipd.tools.sim.emulate_command import emulated_copy
from slipd.tools.sim.touched_devices import TouchedDevices

RIG = """# One finger.
[finger.left.wrench]
device = "bota"
port = "/dev/left"
rate_hz = 100.0
sign = -1  # MEASURE
"""


def test_a_copy_that_was_changed_is_kept_and_is_itself_emulated(tmp_path: Path) -> None:
    source, copy = tmp_path / "rig.toml", tmp_path / "run" / "rig.toml"
    source.write_text(RIG, encoding="utf-8")
    copy.parent.mkdir()
    text = TouchedDevices(config.parse(RIG, "rig"), copy.parent).config_text()
    for name in (None, "rig.commissioned.toml", "rig.commissioned-2.toml"):
        with emulated_copy(copy, text, source):
            if name is not None:
                found = changed_text(copy.read_text(encoding="utf-8"), {("finger", "left", "wrench", "sign"): "1"})
                copy.write_text(found, encoding="utf-8")
        assert not copy.exists()
        assert [*copy.parent.glob(name or "*")] == ([copy.parent / name] if name else [])
    again = config.load(copy.parent / "rig.commissioned.toml")
    assert "\nsign = 1  # slipd commission\n" in TouchedDevices(again, tmp_path).config_text()


def test_a_file_that_no_emulation_wrote_is_not_replaced(tmp_path: Path) -> None:
    source, copy = tmp_path / "rig.toml", tmp_path / "run" / "rig.toml"
    source.write_text(RIG, encoding="utf-8")
    copy.parent.mkdir()
    copy.write_bytes(b"\xff\xfe")
    with (
        pytest.raises(SlipdError, match=r"run/rig\.toml exists, and no emulation wrote it"),
        emulated_copy(copy, "", source),
    ):
        pass
    assert copy.read_bytes() == b"\xff\xfe"
