"""What the guide tells the page, and that a change is written only once the person agrees."""

from __future__ import annotations

import io
import json
import os
import sys
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import pytest

from slipd import config
from slipd.tools.commission.daemon_link import DaemonLink
from slipd.tools.commission.dialogue import Change, Prompt, Say, Written
from slipd.tools.commission.hosts import PageHost

TEXT = config.shipped("demo.toml").read_text(encoding="utf-8")
CHANGE = Change({("finger", "left", "mu"): "0.42"})


class Page(io.StringIO):
    """Keeps what it is told, and answers at a question."""

    def __init__(self, person: IO[str], answers: str) -> None:
        super().__init__()
        self._person, self._answers = person, answers

    def write(self, text: str) -> int:
        if text.startswith('{"prompt"'):
            self._person.write(self._answers)
            self._person.flush()
        return super().write(text)


@contextmanager
def hosted(folder: Path, monkeypatch: pytest.MonkeyPatch, answers: str = "", before: str = "") -> Iterator[PageHost]:
    """A host of a config whose person answers the first question, and may have typed something before it."""
    (folder / "rig.toml").write_text(TEXT, encoding="utf-8")
    read, write = os.pipe()
    with io.open(read) as stdin, io.open(write, "w") as person:  # noqa: UP020 - sys.stdin is a file of io
        person.write(before)
        person.flush()
        monkeypatch.setattr("sys.stdin", stdin)
        monkeypatch.setattr("sys.stdout", Page(person, answers))
        link = DaemonLink(f"ipc://{folder}/publish", f"ipc://{folder}/requests", None, None)
        with PageHost(folder / "rig.toml", TEXT, link, write=True) as host:
            yield host


def said() -> list[dict[str, Any]]:
    assert isinstance(sys.stdout, Page)
    return [json.loads(line) for line in sys.stdout.getvalue().splitlines()]


def test_lines_and_prompts_are_objects(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with hosted(tmp_path, monkeypatch) as host:
        assert host.respond(Say("5.0 N. Let go.")) is None
        assert host.respond(Prompt("end", "Press the end.", "left")) is None
    prompt = {"step": "end", "text": "Press the end.", "finger": "left", "choices": ["skip"], "free": ""}
    assert said() == [{"say": "5.0 N. Let go."}, {"prompt": prompt}]


@pytest.mark.parametrize(("answers", "mu"), [("skip\n", 0.55), ("perhaps\nwrite\n", 0.42)])
def test_a_change_is_written_only_once_the_person_agrees(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answers: str, mu: float
) -> None:
    file = tmp_path / "rig.toml"
    with hosted(tmp_path, monkeypatch, answers) as host:
        written = host.respond(CHANGE)
    assert isinstance(written, Written)
    assert tomllib.loads(file.read_text(encoding="utf-8"))["finger"]["left"]["mu"] == mu
    assert (written.text is not None) == (tmp_path / "rig.toml.previous").exists() == (mu == 0.42)
    first, second, *_ = said()
    assert "mu = 0.42" in first["change"]
    assert second["prompt"]["choices"] == ["write", "skip"]


@pytest.mark.parametrize(("answers", "begins"), [("perhaps\nbegin\n", True), ("skip\n", False)])
def test_nothing_is_asked_of_the_daemon_before_the_person_begins(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answers: str, begins: bool
) -> None:
    with hosted(tmp_path, monkeypatch, answers) as host:
        monkeypatch.setattr(host, "_ask", None)
        assert host.wait_for_begin() is begins
    (prompt,) = said()
    assert prompt["prompt"]["choices"] == ["begin", "skip"]
