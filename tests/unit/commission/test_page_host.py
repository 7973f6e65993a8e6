"""What the guide tells the page, and that a change is written only once the person agrees."""

from __future__ import annotations

import io
import json
import os
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from slipd import config
from slipd.commission.daemon_link import DaemonLink
from slipd.commission.dialogue import Change, Prompt, Say, Written
from slipd.commission.page_host import PageHost

TEXT = config.shipped("demo.toml").read_text(encoding="utf-8")
CHANGE = Change({("finger", "left", "mu"): "0.42"})


@contextmanager
def hosted(folder: Path, answers: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[PageHost]:
    """A host of a config whose person has answered already."""
    (folder / "rig.toml").write_text(TEXT, encoding="utf-8")
    read, write = os.pipe()
    with io.open(read) as stdin, io.open(write, "w") as person:  # noqa: UP020 - sys.stdin is a file of io
        person.write(answers)
        person.flush()
        monkeypatch.setattr("sys.stdin", stdin)
        link = DaemonLink(f"ipc://{folder}/publish", f"ipc://{folder}/requests", None, None)
        with PageHost(folder / "rig.toml", TEXT, link, write=True) as host:
            yield host


def said(capsys: pytest.CaptureFixture[str]) -> list[dict[str, Any]]:
    return [json.loads(line) for line in capsys.readouterr().out.splitlines()]


def test_lines_and_prompts_are_objects(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with hosted(tmp_path, "", monkeypatch) as host:
        assert host.respond(Say("5.0 N. Let go.")) is None
        assert host.respond(Prompt("end", "Press the end.", "left")) is None
    prompt = {"step": "end", "text": "Press the end.", "finger": "left", "choices": ["skip"]}
    assert said(capsys) == [{"say": "5.0 N. Let go."}, {"prompt": prompt}]


@pytest.mark.parametrize(("answers", "mu"), [("skip\n", 0.55), ("perhaps\nwrite\n", 0.42)])
def test_a_change_is_written_only_once_the_person_agrees(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], answers: str, mu: float
) -> None:
    file = tmp_path / "rig.toml"
    with hosted(tmp_path, answers, monkeypatch) as host:
        written = host.respond(CHANGE)
    assert isinstance(written, Written)
    assert tomllib.loads(file.read_text(encoding="utf-8"))["finger"]["left"]["mu"] == mu
    assert (written.text is not None) == (tmp_path / "rig.toml.previous").exists() == (mu == 0.42)
    first, second, *_ = said(capsys)
    assert "mu = 0.42" in first["change"]
    assert second["prompt"]["choices"] == ["write", "skip"]
