from __future__ import annotations

from pathlib import Path

import pytest

from slipd.errors import SlipdError
from slipd.tools.sim.emulated_copy import EmulatedCopy


@pytest.fixture
def copy(tmp_path: Path) -> EmulatedCopy:
    source = tmp_path / "rig.toml"
    source.write_text('port = "/dev/left"\n', encoding="utf-8")
    (tmp_path / "run").mkdir()
    return EmulatedCopy(tmp_path / "run" / "rig.toml", 'port = "/pts"\n', source, {"/dev/left": "/pts"})


def test_a_copy_that_did_not_change_goes(copy: EmulatedCopy) -> None:
    copy.remove()
    assert not list(copy.path.parent.iterdir())


def test_a_copy_that_is_no_text_any_more_stays_with_the_reason(copy: EmulatedCopy) -> None:
    copy.path.write_bytes(b"\xff\xfe")
    with pytest.raises(SlipdError, match=r"run/rig\.toml: changed meanwhile, and is not UTF-8 text now; it stays"):
        copy.remove()
    assert copy.path.read_bytes() == b"\xff\xfe"
