"""A daemon's config, its devices and its runtime directory."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from service_rig import Rig


@pytest.fixture
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SLIPD_RUNTIME_DIR", str(tmp_path / "run"))
    return tmp_path / "run"


@pytest.fixture
def rig(tmp_path: Path, runtime: Path) -> Iterator[Rig]:
    rig = Rig(tmp_path)
    yield rig
    rig.wrench.unplug()
    rig.pad.unplug()
