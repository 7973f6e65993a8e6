"""Nothing that a command reads is ever its output, and what a command refuses leaves every file as it was."""

from __future__ import annotations

import argparse
import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from project import DATA, TRIAL
from replays import RECORDINGS

from slipd.cli import WRONG, main
from slipd.tools.cli_commands import parser

pytest.importorskip("pyarrow")

Call = tuple[str, ...]
COMMANDS: dict[str, Call] = {
    "evaluate": ("evaluate", "RUN", "--config", "RIG", "--out", "OUT"),
    "plot": ("plot", "RUN", "--config", "RIG", "--out", "OUT"),
    "recover": ("recover", "RUN", "OUT"),
    "import grips": ("import", "grips", "TRIAL", "OUT", "--config", "RIG"),
    "import arq": ("import", "arq", "PUSHES", "GGCNN2/none", "OUT"),
    "import papillarray": ("import", "papillarray", "PILLARS", "OUT"),
    "import pushes": ("import", "pushes", "PUSHES", "OUT"),
    **{f"export {to}": ("export", "RUN", "OUT", "--to", to, "--overwrite") for to in ("ros2", "csv", "parquet")},
    "export lerobot": ("export", "RUN", "OUT", "--to", "lerobot", "--rate", "10", "--overwrite"),
}
"""Every command of ``slipd`` that reads files and writes a file or folder that its arguments name."""

SUFFIXES = {"evaluate": ".parquet", "plot": ".html"}
WAYS: dict[str, Callable[[Path, Path], object]] = {
    "itself": lambda name, target: target.rename(name),
    "a symbolic link": lambda name, target: name.symlink_to(target),
    "a hard link": lambda name, target: name.hardlink_to(target),
}
"""How the output may be a file that is read, under a name that the command accepts."""


def writers(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> Iterator[str]:
    """Names of the commands with an argument ``out``."""
    for command in commands.choices.values():
        for action in command._actions:
            if isinstance(action, argparse._SubParsersAction):
                yield from writers(action)
            elif action.dest == "out":
                yield str(command.get_default("command"))


def test_every_command_with_an_output_is_tried() -> None:
    (commands,) = (each for each in parser()._actions if isinstance(each, argparse._SubParsersAction))
    tried = {" ".join(call[:2]) if call[0] == "import" else call[0] for call in COMMANDS.values()}
    assert set(writers(commands)) - {"doctor"} == tried, "slipd doctor reads no file and names its own"


def content(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(
    name=st.sampled_from(sorted(COMMANDS)),
    target=st.sampled_from(["RUN", "RIG", "TRIAL"]),
    way=st.sampled_from(sorted(WAYS)),
    around=st.sampled_from(["", "./", "sub/../"]),
)
def test_what_a_command_reads_is_never_its_output(
    name: str, target: str, way: str, around: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("run")
    (folder / "sub").mkdir()
    shutil.copy(RECORDINGS / "bota.mcap", folder / "run.mcap")
    shutil.copy(RECORDINGS.parents[2] / "config" / "grips.toml", folder / "rig.toml")
    shutil.copytree(TRIAL, folder / "trial")
    shutil.copy(DATA / "pushes" / "runs" / "robot_push_1.npz", folder / "pushes.npz")
    (folder / "pillars.csv").write_text(2 * (",".join(73 * "0") + "\n"))
    places = {"RUN": "run.mcap", "RIG": "rig.toml", "TRIAL": "trial", "PUSHES": "pushes.npz", "PILLARS": "pillars.csv"}
    out = folder / f"out{SUFFIXES.get(name, '')}"
    if target == "TRIAL":
        way = "a symbolic link" if way == "a hard link" else way
    WAYS[way](out, folder / places[target])
    if way == "itself":
        places[target] = out.name
    before = content(folder)
    words = [around + places.get(word, out.name if word == "OUT" else word) if word in {*places, "OUT"} else word
             for word in COMMANDS[name]]  # fmt: skip
    here = Path.cwd()
    os.chdir(folder)
    try:
        assert main(words) == WRONG
    finally:
        os.chdir(here)
    assert content(folder) == before
