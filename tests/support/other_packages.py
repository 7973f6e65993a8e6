"""Packages beside slipd, as an installation leaves them: metadata with entry points, and modules."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from slipd import devices

Install = Callable[..., None]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    """Install a package: its name, its device's name, what the entry point names, and the text of its module."""

    def clear() -> None:
        for cached in (devices.installed, devices._other, devices.providers):
            cached.cache_clear()

    def install(package: str, device: str, names: str, module: str = "", folder: str = "site") -> None:
        site = tmp_path / folder
        metadata = site / f"{package.replace('-', '_')}-1.2.dist-info"
        metadata.mkdir(parents=True)
        (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.2\n")
        (metadata / "entry_points.txt").write_text(f"[slipd.devices]\n{device} = {names}\n")
        if module:
            (site / f"{names.partition(':')[0]}.py").write_text(module)
        monkeypatch.syspath_prepend(site)
        sys.modules.pop(names.partition(":")[0], None)
        clear()

    yield install
    monkeypatch.undo()
    clear()
