"""Kinds of arguments, the recordings that they name, and the package that some need."""

from __future__ import annotations

import inspect
import pkgutil
import sys
from argparse import ArgumentParser, ArgumentTypeError
from pathlib import Path

import pytest

from slipd.errors import SlipdError, UsageError
from slipd.tools.cli_arguments import chosen, shard
from slipd.tools.cli_commands import COMMANDS
from slipd.tools.outputs import parquet_library
from slipd_client.arguments import Add, Command


def test_a_folder_stands_for_its_recordings_and_each_counts_once(tmp_path: Path) -> None:
    day, missing = tmp_path / "day", tmp_path / "missing.mcap"
    (day / "two").mkdir(parents=True)
    for name in ("b.mcap", "two/a.mcap", "notes.txt"):
        (day / name).touch()
    assert chosen([missing, day, day / "b.mcap"]) == [missing, day / "b.mcap", day / "two/a.mcap"]


def test_a_folder_without_recordings_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"no recording \(\*\.mcap\) in this folder"):
        chosen([tmp_path])


@pytest.mark.parametrize("of", [1, 3, 10])
def test_shards_share_nothing_and_miss_nothing(of: int) -> None:
    paths = [Path(f"{number}.mcap") for number in range(7)]
    shards = [chosen(paths, shard(f"{number}/{of}")) for number in range(1, of + 1)]
    assert sorted(path for shard in shards for path in shard) == sorted(paths)
    assert max(map(len, shards)) - min(map(len, shards)) <= 1


@pytest.mark.parametrize("text", ["", "1", "0/2", "3/2", "a/b", "1/2/3", "-1/2", "1/0"])
def test_what_is_no_share_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(ArgumentTypeError, match=r"such as 2/8, got"):
        shard(text)


def test_without_pyarrow_the_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(SlipdError, match=r"--table needs the package pyarrow: pip install 'slipd\[batch\]'"):
        parquet_library("--table", "batch")
    with pytest.raises(SlipdError, match=r"--to lerobot needs the package pyarrow: pip install 'slipd\[parquet\]'"):
        parquet_library("--to lerobot")


def arguments_of(add: Add) -> set[str]:
    """Return the names under which a command gets what a part of its parser adds."""
    made = ArgumentParser(add_help=False)
    add(made)
    return {action.dest for action in made._actions}


@pytest.mark.parametrize("command", [each for each in COMMANDS if each.run], ids=lambda each: each.name)
def test_what_carries_out_a_command_takes_its_arguments(command: Command) -> None:
    names = set(command.given).union(*map(arguments_of, command.arguments))
    inspect.signature(pkgutil.resolve_name(command.run)).bind(**dict.fromkeys(names))
