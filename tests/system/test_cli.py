"""The command ``slipd``: its output and exit code: 0 done, 1 the answer is no, 2 wrong use, 130 Ctrl-C."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from project import CONFIG, DOCS, TRIAL
from replays import RECORDINGS

from slipd.cli import main
from slipd.tools.cli_commands import parser
from slipd_client import slipctl, slipctl_parser

SLIPD = str(Path(sys.executable).with_name("slipd"))


@pytest.mark.parametrize(
    ("call", "ends", "told"),
    [
        (["replay", "none.mcap"], 2, "none.mcap: cannot be opened: No such file"),
        (["replay", "foreign"], 1, "foreign: not an MCAP file"),
        (["replay", "empty"], 1, "empty: "),
        (["check", "none.toml"], 2, "none.toml: cannot be read: No such file"),
        (["check", "foreign"], 1, "foreign:1: cannot be read: it is not UTF-8"),
        (["check", "empty"], 1, "empty: finger: is missing"),
        (["check", "."], 2, ".: cannot be read: Is a directory"),
        (["init", "empty", "--ports", "."], 2, "empty exists, and is not replaced"),
        (
            ["check", "demo"],
            2,
            "demo: cannot be read: No such file or directory; to copy a shipped config: slipd config",
        ),
        (["emulate", "demo", "--dir", "/proc/x"], 2, "--dir /proc/x: cannot be created: No such file"),
        (["info", "."], 2, ".: cannot be opened: Is a directory"),
        (["demo", "--record", "empty"], 2, "empty: exists already; give the name of a new file"),
        (["demo", "--without-advice"], 2, "--without-advice is for --scene carry"),
        (["service", "install", "--user", "--program", "none"], 2, "none: there is no such program"),
        (["doctor", "foo", "--device", "wsg"], 2, "PORT must be the tcp line of wsg, got foo"),
        (["run", "none.toml"], 2, "none.toml: cannot be read: No such file"),
        (["run", "empty"], 2, "empty: finger: is missing"),
        (["run", "."], 2, ".: cannot be read: Is a directory"),
        (["run", "--config", "none.toml"], 2, "none.toml: cannot be read: No such file"),
        (["check", "--config", "foreign"], 1, "foreign:1: cannot be read: it is not UTF-8"),
        (["config", "show", "../demo"], 2, "there is no config '../demo'; did you mean 'demo'?"),
        (["docs", "phyics"], 2, "there is no page 'phyics'; did you mean 'physics'?"),
        (["import", "grips", "none", "out.mcap"], 2, "robot_state.csv: cannot be read: No such file"),
        (["import", "grips", "foreign", "out.mcap"], 1, "robot_state.csv: cannot be read: Not a directory"),
        (["import", "grips", str(TRIAL), "none/out.mcap"], 2, "none/out.mcap: cannot be written"),
        (["import", "grips", str(TRIAL), "out.mcap", "--config", "none.toml"], 2, "none.toml: cannot be read"),
    ],
)
def test_a_missing_or_foreign_file_is_reported(
    call: list[str],
    ends: int,
    told: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "foreign").write_bytes(b"\xff\xfe\x00 no recording, no text" * 100)
    (tmp_path / "empty").write_bytes(b"")
    assert main(call) == ends
    captured = capsys.readouterr()
    assert told in captured.err
    assert captured.out == ""
    assert sorted(path.name for path in tmp_path.iterdir()) == ["empty", "foreign"], "nothing is left behind"


@pytest.mark.parametrize(
    "call",
    [
        ["fly"],
        ["run"],
        ["run", "a", "b"],
        ["run", "a", "--config", "b"],
        ["check"],
        ["check", "--config", "a", "b"],
        ["config"],
        ["config", "show"],
        ["config", "print", "demo"],
        ["docs", "a", "b"],
        ["replay"],
        ["replay", "a", "b"],
        ["replay", "a", "--speed", "0"],
        ["replay", "a", "--speed", "nan"],
        ["replay", "a", "--speed", "inf"],
        ["replay", "a", "--speed", "fast"],
        ["demo", "--seconds", "-1"],
        ["evaluate"],
        ["evaluate", "a", "--config"],
        ["evaluate", "a", "--out", "b.parquet", "--json"],
        ["plot"],
        ["plot", "a", "--out", "a.png"],
        ["import"],
        ["import", "rosbags", "a", "b"],
        ["import", "grips", "a"],
        ["import", "grips", "a", "b", "--tare-rows", "many"],
    ],
    ids=" ".join,
)
def test_wrong_arguments_print_the_usage(call: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(call)
    assert ended.value.code == 2
    assert "usage: slipd" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("program", "command", "words"),
    [(main, "slipd plot", "a b"), (main, "slipd config show", "a b"), (slipctl.main, "slipctl tare get", "left pad b")],
)
def test_a_surplus_argument_prints_the_usage_of_its_command(
    program: Callable[[list[str]], int], command: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        program([*command.split()[1:], *words.split()])
    said = capsys.readouterr().err
    assert said.startswith(f"usage: {command} [-h]")
    assert said.endswith(f"{command}: error: unrecognized arguments: b\n")


def test_slipd_alone_prints_the_first_steps(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 2
    shown = capsys.readouterr().out
    for command in (
        "slipd demo",
        "slipd init my_rig.toml",
        "slipd check my_rig.toml",
        "slipd run my_rig.toml",
        "slipd commission my_rig.toml",
        "slipd config list",
        "slipd docs",
    ):
        assert f"    {command}" in shown


def test_configs_and_pages_are_listed_with_what_they_are(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    assert main(["config", "list"]) == 0
    listed = capsys.readouterr().out.splitlines()
    assert listed[0] == f"{CONFIG}: `slipd config show NAME` prints one"
    described = [line.split(maxsplit=1) for line in listed]
    assert ["hex_tsf85", "An OnRobot HEX behind each fingertip of a Robotiq TSF-85, on a Robotiq 2F-85"] in described
    assert main(["docs"]) == 0
    listed = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["glossary", "Glossary"] in listed
    assert main(["docs", "glossary"]) == 0
    assert capsys.readouterr().out.startswith("# Glossary\n")


def test_a_command_that_is_misspelt_is_answered_with_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    for typed, meant in (("inf", "info"), ("repaly", "replay"), ("stats", "status")):
        with pytest.raises(SystemExit, match="2"):
            main([typed])
        assert capsys.readouterr().err.endswith(f": there is no command {typed!r}; did you mean {meant!r}?\n")


CODES = {
    0: (["slipd", "--version"], ["slipctl", "--version"], ["slipd", "config", "list"]),
    1: (["slipd", "check", "/etc/passwd"], ["slipctl", "status"], ["slipd", "info", "/etc/passwd"]),
    2: (
        ["slipd", "fly"],
        ["slipctl", "fly"],
        ["slipd", "replay", "/nowhere.mcap"],
        ["slipctl", "--key", "/no", "status"],
    ),
}
"""Calls of both programs for each exit code but that of Ctrl-C."""


@pytest.mark.process
@pytest.mark.parametrize("code", CODES)
def test_both_installed_programs_return_the_documented_exit_codes(code: int, tmp_path: Path) -> None:
    for program, *words in CODES[code]:
        command = [str(Path(SLIPD).with_name(program)), *words]
        nowhere = os.environ | {"SLIPD_RUNTIME_DIR": str(tmp_path)}
        done = subprocess.run(command, env=nowhere, capture_output=True, text=True, timeout=60, check=False)
        assert (command, done.returncode) == (command, code), done.stderr
        assert "Traceback" not in done.stderr


def test_the_docs_name_each_exit_code_and_no_other() -> None:
    """`test_interrupts.py` has that of Ctrl-C."""
    table = (DOCS / "commands.md").read_text(encoding="utf-8").partition("## Exit codes")[2].partition("## Rules")[0]
    assert {int(code) for code in re.findall(r"^\| (\d+) \|", table, re.MULTILINE)} == {*CODES, 130}


def test_a_command_of_the_other_program_is_named_to_those_who_mistake_them(capsys: pytest.CaptureFixture[str]) -> None:
    own, other = parser(), slipctl_parser.parser()
    assert (own.elsewhere[0], set(own.elsewhere[1])) == ("slipctl", {*other.names} - {*own.names})
    assert (other.elsewhere[0], set(other.elsewhere[1])) == ("slipd", {*own.names} - {*other.names})
    with pytest.raises(SystemExit, match="2"):
        main(["tare", "left"])
    assert capsys.readouterr().err == "slipd: tare is a command of slipctl: slipctl tare left\n"


def test_a_file_for_the_system_is_no_config(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["config", "show", "slipd.service"]) == 2
    assert "print it with: slipd service show slipd.service" in capsys.readouterr().err
    for names, told in (((), "slipd.service"), (("slipd",), f"ExecStart={SLIPD}")):
        assert main(["service", "show", *names]) == 0
        assert told in capsys.readouterr().out
    assert main(["config", "list"]) == 0
    assert "service" not in capsys.readouterr().out.partition("\n")[2]


@pytest.mark.parametrize(
    ("call", "code", "key"),
    [
        (["check", str(CONFIG / "demo.toml")], 0, "streams"),
        (["check", "bad.toml"], 1, "faults"),
        (["config", "list"], 0, "files"),
        (["docs"], 0, "files"),
        (["devices"], 0, 0),
        (["devices", "bota"], 0, "options"),
        (["info", str(RECORDINGS / "bota.mcap")], 0, "streams"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else None,
)
def test_json_is_one_document_and_nothing_else(
    call: list[str],
    code: int,
    key: str | int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("bad.toml").write_text("[finger.left]\nmu = 9.0\n", encoding="utf-8")
    assert main([*call, "--json"]) == code
    shown = capsys.readouterr()
    assert json.loads(shown.out)[key]
    assert shown.err == ""
