"""The page on adding a device: the package that it prints is written, tested, installed and used."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from fresh_environment import OFFLINE, Environment
from project import ROOT

pytestmark = pytest.mark.no_cover

PAGE = (ROOT / "docs" / "adding_a_device.md").read_text(encoding="utf-8")
FILE = re.compile(r"<!-- file: (\S+) -->\n```\w+\n(.*?)```", re.DOTALL)
CONFIG = re.compile(r"<!-- config -->\n```toml\n(.*?)```", re.DOTALL)


@pytest.mark.process
def test_what_the_page_says_works(tmp_path: Path) -> None:
    package = tmp_path / "package"
    (package / "slipd_dynpick").mkdir(parents=True)
    files = dict(FILE.findall(PAGE))
    assert len(files) == 4
    for name, text in files.items():
        (package / name).write_text(text, encoding="utf-8")
    environment = Environment(tmp_path)
    environment.pip(*OFFLINE, package)
    python = [name for name in files if name.endswith(".py")]
    for check in (
        (environment.python, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-c", "/dev/null", "."),
        (sys.executable, "-m", "ruff", "check", "--config", ROOT / "pyproject.toml", "--ignore", "D,S,I", *python),
        (sys.executable, "-m", "ruff", "format", "--check", "--config", ROOT / "pyproject.toml", *python),
    ):
        done = subprocess.run(check, cwd=package, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    assert "slipd-dynpick 0.1.0  document only" in environment.slipd("devices").stdout
    assert "Counts per N (3) and per N·m (3)" in environment.slipd("devices", "dynpick").stdout
    config = CONFIG.search(PAGE)
    assert config is not None
    (tmp_path / "rig.toml").write_text(config[1], encoding="utf-8")
    checked = environment.slipd("check", "rig.toml")
    assert (checked.returncode, checked.stderr) == (0, ""), checked.stdout
    (tmp_path / "rig.toml").write_text(config[1].replace("32.765, 32.765, 32.765, ", ""), encoding="utf-8")
    assert "six positive numbers" in environment.slipd("check", "rig.toml").stderr
