"""The page on adding a device, followed in a copy of the project."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from project import ROOT

pytestmark = pytest.mark.no_cover

PAGE = (ROOT / "docs" / "adding_a_device.md").read_text(encoding="utf-8")
FILE = re.compile(r"<!-- file: (\S+) -->\n```python\n(.*?)```", re.DOTALL)
CONFIG = re.compile(r"<!-- config -->\n```toml\n(.*?)```", re.DOTALL)


def run(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": f"{folder / 'daemon'}{os.pathsep}{folder / 'clients'}"}
    return subprocess.run(
        [sys.executable, *command], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


@pytest.mark.process
def test_what_the_page_says_works(tmp_path: Path) -> None:
    caches = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "daemon", tmp_path / "daemon", ignore=caches)
    shutil.copytree(ROOT / "clients", tmp_path / "clients", ignore=caches)
    (tmp_path / "tests/unit/devices").mkdir(parents=True)
    for name in ("pyproject.toml", "tests/unit/devices/conftest.py"):
        shutil.copy(ROOT / name, tmp_path / name)
    files = FILE.findall(PAGE)
    assert [Path(name).parent.name for name, _ in files] == ["devices", "devices"]
    for name, text in files:
        (tmp_path / name).write_text(text, encoding="utf-8")
    tests = run(tmp_path, "-m", "pytest", "-q", "-p", "no:cacheprovider", "tests/unit/devices")
    assert tests.returncode == 0, tests.stdout + tests.stderr
    for check in (("ruff", "check"), ("ruff", "format", "--check")):
        found = run(tmp_path, "-m", *check, *(name for name, _ in files))
        assert found.returncode == 0, found.stdout + found.stderr
    config = CONFIG.search(PAGE)
    assert config is not None
    (tmp_path / "rig.toml").write_text(config[1], encoding="utf-8")
    checked = run(tmp_path, "-m", "slipd", "check", "rig.toml")
    assert (checked.returncode, checked.stderr) == (0, ""), checked.stdout
    (tmp_path / "rig.toml").write_text(config[1].replace("32.765, 32.765, 32.765, ", ""), encoding="utf-8")
    assert "six positive numbers" in run(tmp_path, "-m", "slipd", "check", "rig.toml").stderr
