"""Ctrl-C: what is stopped before its work is done does not end as if it were."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from replays import RECORDINGS
from service_rig import Rig

from slipd import cli
from slipd.__main__ import main as slipd
from slipd_client.__main__ import main as slipctl

PATIENCE_S = 110.0


def interrupt(*_: object) -> None:
    raise KeyboardInterrupt


@pytest.mark.parametrize("program", [slipd, slipctl])
def test_an_interrupt_while_a_program_is_loaded_ends_it_without_a_message(
    program: Callable[[], int], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(importlib, "import_module", interrupt)
    assert (program(), capsys.readouterr().err) == (130, "")


@pytest.mark.parametrize(
    ("command", "code", "error"),
    [
        (["plot", "run.mcap"], 130, "slipd: interrupted\n"),
        (["export", "run.mcap", "out", "--to", "csv"], 130, "slipd: interrupted; nothing was written\n"),
        (["check", "rig.toml"], 130, "slipd: interrupted\n"),
        (["replay", "run.mcap"], 130, "slipd: interrupted\n"),
        (["run", "rig.toml"], 0, ""),
    ],
)
def test_an_interrupt_is_an_end_only_of_what_is_ended_by_hand(
    command: list[str], code: int, error: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(cli, "carry_out", interrupt)
    assert cli.main(command) == code
    assert capsys.readouterr().err == error


def interrupted(callback: str, *command: str, **variables: str) -> tuple[int, str, str]:
    """Run slipd with SIGINT in a callback of Numba's cache; return exit code, output and errors."""
    program = [sys.executable, "-m", "interrupted_load", callback, *command]
    path = os.pathsep.join(sys.path)
    ended = subprocess.run(
        program, env=os.environ | {"PYTHONPATH": path} | variables, capture_output=True, text=True, timeout=PATIENCE_S
    )
    errors = ended.stderr.replace("compiling kernels, once (about a minute)\n", "")
    return ended.returncode, ended.stdout, errors


@pytest.mark.process
@pytest.mark.parametrize(
    ("command", "code", "error"),
    [
        (["replay", "RECORDING"], 130, "slipd: interrupted\n"),
        (["view", "RECORDING", "--listen", "127.0.0.1:0"], 130, ""),
        (
            ["evaluate", "RECORDING", "--results", "FOLDER"],
            130,
            "slipd: interrupted; the same command goes on from here\n",
        ),
    ],
)
def test_an_interrupt_while_a_kernel_is_loaded_ends_the_command(
    command: list[str], code: int, error: str, tmp_path: Path
) -> None:
    places = {"RECORDING": str(RECORDINGS / "bota.mcap"), "FOLDER": str(tmp_path)}
    filled = [word.replace("FOLDER", places["FOLDER"]).replace("RECORDING", places["RECORDING"]) for word in command]
    assert interrupted("load", *filled) == (code, "", error)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.process
@pytest.mark.parametrize("callback", ["load", "store"])
def test_P4_an_interrupt_while_kernels_are_loaded_or_compiled_ends_the_daemon_before_it_serves(
    callback: str, rig: Rig, runtime: Path, tmp_path: Path
) -> None:
    variables = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")} if callback == "store" else {}
    code, output, errors = interrupted(callback, "run", str(rig.file), **variables)
    assert (code, output) == (0, "")
    assert all(line.startswith("WARNING slipd.service") for line in errors.splitlines()), "remarks on the config"
    assert not list(tmp_path.rglob("motion_scale*")), "the last kernels were compiled too"
