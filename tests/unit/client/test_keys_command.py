from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from slipd_client import slipctl_parser
from slipd_client.keys import KeyFileError, create, load_public, load_secret
from slipd_client.keys import run as run_keys


def run(*arguments: str) -> None:
    run_keys(slipctl_parser.parser().parse_args(["keys", *arguments]))


def test_keys_are_made_and_no_secret_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for command in ("new", "show"):
        run(command, "robot-1", "--dir", str(tmp_path))
    run("list", "--dir", str(tmp_path))
    public, secret = load_secret(tmp_path / "robot-1.key_secret")
    said = capsys.readouterr().out
    assert secret.decode() not in said
    assert said.splitlines()[2:] == [f"robot-1 {public.decode()} (with its secret key)"] * 2


def test_a_list_tells_which_secrets_can_be_used(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    create("a", tmp_path)[1].unlink()
    create("b", tmp_path)[1].chmod(0o644)
    create("c", tmp_path)[1].unlink()
    (tmp_path / "c.key_secret").write_bytes((create("d", tmp_path)[1]).read_bytes())
    (tmp_path / "c.key_secret").chmod(0o600)
    run("list", "--dir", str(tmp_path))
    a, b, c, d = capsys.readouterr().out.splitlines()
    assert a == f"a {load_public(tmp_path / 'a.key').decode()} (public key only)"
    assert "chmod 600" in b
    assert "belongs to another public key" in c
    assert d.endswith("(with its secret key)")


def test_a_directory_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(KeyFileError, match="nowhere: must be a readable directory"):
        run("list", "--dir", str(tmp_path / "nowhere"))


def test_slipctl_makes_keys_and_refuses_to_overwrite_them(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "slipd_client.slipctl", "keys", "new", "robot-1"]
    environment = {**os.environ, "XDG_CONFIG_HOME": str(tmp_path)}
    first = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert (first.returncode, first.stderr) == (0, "")
    again = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert again.returncode == 2
    assert "exists already" in again.stderr
    load_secret(tmp_path / "slipd" / "keys" / "robot-1.key_secret")
