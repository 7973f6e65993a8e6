"""Every module of the programs imports what the product has; `make check` tests few of them further."""

from __future__ import annotations

import importlib

import pytest
from project import ROOT

PROGRAMS = ROOT / "benchmarks"
MODULES = sorted(
    ".".join(path.relative_to(PROGRAMS).with_suffix("").parts)
    for path in PROGRAMS.rglob("*.py")
    if path.parent != PROGRAMS
)
MEASURING = {
    "matplotlib", "clarabel",
    "bota_driver", "NetFT", "optoforce", "pynetft", "pyrobotiqgripper", "websocket",
}  # fmt: skip
"""What the extras `chart` and `peers` install, and `make check` does without: modules that import it are skipped."""


@pytest.mark.parametrize("name", MODULES)
def test_every_module_imports(name: str) -> None:
    try:
        importlib.import_module(name)
    except ModuleNotFoundError as missing:
        if missing.name not in MEASURING:
            raise
        pytest.skip(f"needs {missing.name}, which only measurements do")
