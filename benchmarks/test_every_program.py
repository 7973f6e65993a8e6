"""Every module of the programs imports what the product has, every program has ``--help``, and the quick ones run."""

from __future__ import annotations

import importlib
import runpy
import sys

import pytest
from project import ROOT

pytestmark = pytest.mark.filterwarnings("ignore:.*found in sys.modules:RuntimeWarning")  # it was imported before

PROGRAMS = ROOT / "benchmarks"
MODULES = {
    ".".join(path.relative_to(PROGRAMS).with_suffix("").parts): path.read_text(encoding="utf-8")
    for path in sorted(PROGRAMS.rglob("*.py"))
    if path.parent != PROGRAMS
}
WITH_HELP = [name.removesuffix(".__main__") for name, text in MODULES.items() if 'prog="python -m ' in text]
MEASURING = {
    "matplotlib", "clarabel",
    "bota_driver", "NetFT", "optoforce", "pynetft", "pyrobotiqgripper", "websocket",
}  # fmt: skip
"""What the extras `chart` and `peers` install, and `make check` does without: modules that import it are skipped."""

LEAST = (
    ("motion limits 2", "limits above the true one: 0 of 1 (of 2 grips, 1 do not hold at rest)"),
    ("motion time 1", "check of one with a swing: p50"),
    ("motion latency 4", "; a reading of the arm"),
)
"""The least that runs a program from end to end, where no other test does and it is quick, and what it prints then."""


@pytest.mark.parametrize("name", MODULES)
def test_every_module_imports(name: str) -> None:
    try:
        importlib.import_module(name)
    except ModuleNotFoundError as missing:
        skip_without(missing)


def skip_without(missing: ModuleNotFoundError) -> None:
    if missing.name not in MEASURING:
        raise missing
    pytest.skip(f"needs {missing.name}, which only measurements do")


def run(monkeypatch: pytest.MonkeyPatch, command: str) -> None:
    name, *arguments = command.split()
    monkeypatch.setattr(sys, "argv", [name, *arguments])
    runpy.run_module(name, run_name="__main__", alter_sys=True)


@pytest.mark.parametrize("name", WITH_HELP)
def test_every_program_has_help(name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    try:
        with pytest.raises(SystemExit, match="0"):
            run(monkeypatch, f"{name} --help")
    except ModuleNotFoundError as missing:
        skip_without(missing)
    assert f"usage: python -m {name} " in capsys.readouterr().out


@pytest.mark.timeout(340)  # a change of the kernels compiles them here
@pytest.mark.parametrize(("command", "says"), LEAST)
def test_the_least_run_of_a_program(
    command: str, says: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run(monkeypatch, command)
    assert says in capsys.readouterr().out
