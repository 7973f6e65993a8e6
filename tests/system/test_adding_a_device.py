"""The page on adding a device: the package that it explains is tested, installed and used, and is as printed."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from fresh_environment import OFFLINE, Environment
from project import ROOT

pytestmark = pytest.mark.uncovered

EXAMPLE = ROOT / "clients" / "examples" / "devices" / "dynpick"
PAGE = (ROOT / "docs" / "adding_a_device.md").read_text(encoding="utf-8")
FILE = re.compile(r"<!-- file: (\S+) -->\n```\w+\n(.*?)```", re.DOTALL)
CONFIG = re.compile(r"<!-- config -->\n```toml\n(.*?)```", re.DOTALL)


def test_the_code_that_the_page_prints_is_that_of_the_package() -> None:
    parts = FILE.findall(PAGE)
    assert parts
    for name, text in parts:
        assert text in (EXAMPLE / name).read_text(encoding="utf-8"), name


@pytest.mark.process
def test_what_the_page_says_works(tmp_path: Path) -> None:
    package = shutil.copytree(EXAMPLE, tmp_path / "package", ignore=shutil.ignore_patterns("__pycache__"))
    environment = Environment(tmp_path)
    environment.pip(*OFFLINE, package)
    tests = (environment.python, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-c", "/dev/null", ".")
    done = subprocess.run(tests, cwd=package, capture_output=True, text=True, check=False)
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
