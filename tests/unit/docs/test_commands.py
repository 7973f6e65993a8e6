"""Test that every command of the documents can be given as it stands; those that need no daemon are run."""

from __future__ import annotations

import argparse
import contextlib
import importlib.util
import io
import re
import shutil
from collections.abc import Sequence
from pathlib import Path

import pytest
from documented_commands import OTHERS, PAGES, PROGRAMS, Command, commands, mentions
from project import CONFIG, DOCS, ROOT

from slipd import cli, config
from slipd.tools import cli_commands
from slipd_client import slipctl_parser

ALL = [command for page in PAGES for command in commands(page)]
MENTIONED = [command for page in [*PAGES, *sorted(DOCS.glob("decisions/*.md"))] for command in mentions(page)]
RUN = ("slipd config", "slipd docs", "slipd check")
"""What is run here; the tests of the system run demo, import, plot, export, identify, evaluate and slipctl."""

MODULE = re.compile(r"python -m ([\w.]+)")
TARGETS = set(re.findall(r"^([a-z_]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))


def parser_of(program: str) -> argparse.ArgumentParser:
    return cli_commands.parser() if program == "slipd" else slipctl_parser.parser()


def ours(*programs: str) -> list[Command]:
    return [command for command in ALL if command.words[0] in programs]


def test_a_config_that_a_page_copies_runs_without_keys() -> None:
    shown = [each for each in ours("slipd") if each.words[1:3] == ("config", "show")]
    names = {each.words[3] for each in shown}
    rigs = [config.load(CONFIG / f"{name}.toml") for name in names if (CONFIG / f"{name}.toml").exists()]
    assert rigs
    assert [rig.bus.secret_key for rig in rigs] == [None] * len(rigs)


def test_there_are_commands_on_many_pages_and_each_program_is_ours_or_known() -> None:
    assert len(ours("slipd", "slipctl")) > 40
    assert len({command.page for command in ALL}) >= 6
    assert len(MENTIONED) > 40
    assert {command.words[0] for command in ALL} <= PROGRAMS | OTHERS


def test_a_command_has_arguments_that_the_parser_accepts() -> None:
    for command in ours("slipd", "slipctl"):
        program, *arguments = command.words
        with contextlib.redirect_stderr(io.StringIO()) as said:
            try:
                parsed = parser_of(program).parse_args(arguments)
            except SystemExit:
                pytest.fail(f"{command}: {said.getvalue()}")
        assert parsed.command or not arguments, f"{command}: a command is missing"


def test_a_command_in_the_text_names_a_command_and_options_that_exist() -> None:
    for command in MENTIONED:
        _follow(parser_of(command.words[0]), command.words[1:])


def _follow(parser: argparse.ArgumentParser, words: Sequence[str]) -> None:
    """Check the words of a command against its parser and the parsers below it."""
    for word in words:
        below = next((action for action in parser._actions if isinstance(action, argparse._SubParsersAction)), None)
        default = getattr(parser, "default", "")
        if below is not None and default and word not in below.choices:
            parser, below = below.choices[default], None
        if word.startswith("--"):
            assert word.partition("=")[0] in parser._option_string_actions, f"{parser.prog} has no {word}"
        elif below is not None:
            names = [name for name in word.split("|") if name.islower()]
            assert set(names) <= set(below.choices), f"{parser.prog} has no {word}"
            parser = below.choices[names[0]] if names else parser


def test_a_module_that_is_started_exists() -> None:
    for page in PAGES:
        for module in MODULE.findall(page.read_text(encoding="utf-8")):
            assert importlib.util.find_spec(module) is not None, f"{page.name}: {module}"


def test_a_target_of_make_exists() -> None:
    named = {command.words[1] for command in ours("make")}
    for page in PAGES:
        named |= set(re.findall(r"`make ([a-z_]+)[^`]*`", page.read_text(encoding="utf-8")))
    assert named
    assert named <= TARGETS


def test_a_file_of_the_project_that_a_command_takes_exists() -> None:
    taken = {
        word
        for command in ALL
        for word in command.words[1:]
        if re.match(r"(\./)?(tests|benchmarks|config|docs|clients)\b", word)
    }
    assert taken
    for word in taken:
        assert (ROOT / word.partition("[")[0]).exists(), word


@pytest.mark.parametrize(
    "page", [page for page in PAGES if any(" ".join(c.words).startswith(RUN) for c in commands(page))]
)
def test_the_commands_that_need_no_daemon_run_in_their_order(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("rig.toml", "other.toml", "my_rig.toml"):  # the last by slipd init, which needs devices
        shutil.copy(CONFIG / "demo.toml", name)
    for command in commands(page):
        if " ".join(command.words).startswith(RUN):
            assert cli.main(list(command.words[1:])) == 0, command
            printed = capsys.readouterr().out
            if command.output:
                Path(command.output).write_text(printed, encoding="utf-8")
