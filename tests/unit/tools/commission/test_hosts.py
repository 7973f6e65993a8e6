"""The guide in a terminal and beside its page: how questions are asked and answered, and when the config is written."""

from __future__ import annotations

import io
import json
import sys
import tomllib
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Any

import pytest

from slipd.errors import SlipdError
from slipd.tools.commission import commission_command
from slipd.tools.commission.commission_command import PageHost, TerminalHost
from slipd.tools.commission.daemon_link import DaemonLink
from slipd.tools.commission.dialogue import Ask, Change, Choice, Prompt, Refusal, Reply, Say
from slipd.tools.shipped_files import shipped_config

TEXT = shipped_config("demo.toml").read_text(encoding="utf-8")
CHANGE = Change({("finger", "left", "mu"): "0.42"})
QUESTION = Prompt("tips_down", "Turn it.", "left", ("ready", "skip"), "gravity (x y z)")
Hosted = Callable[..., Any]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "rig.toml").write_text(TEXT, encoding="utf-8", newline="")
    return tmp_path / "rig.toml"


@pytest.fixture
def hosted(file: Path, person: IO[str], monkeypatch: pytest.MonkeyPatch) -> Iterator[Hosted]:
    """Hosts of a config, without a daemon."""
    monkeypatch.setattr(commission_command, "SILENCE_S", 0.3)
    link = DaemonLink(f"ipc://{file.parent}/publish", f"ipc://{file.parent}/requests", None, None)
    with ExitStack() as stack:
        yield lambda kind=TerminalHost, *, write=True: stack.enter_context(kind(file, TEXT, link, write=write))


@pytest.mark.parametrize(
    ("line", "word"), [("", "ready"), ("r", "ready"), ("S", "skip"), ("skip", "skip"), ("0 0 1", "0 0 1")]
)
def test_enter_is_the_first_word_and_a_letter_another(
    hosted: Hosted, person: IO[str], capsys: pytest.CaptureFixture[str], line: str, word: str
) -> None:
    host = hosted()
    person.write("typed too early\n")
    host.respond(QUESTION)
    person.write(f"{line}\n")
    assert host.respond(None) == Choice(word)
    assert capsys.readouterr().out == "Turn it. [Enter: ready, s: skip, or type gravity (x y z)]\n"


def test_a_question_without_anybody_to_answer_ends_the_guide(hosted: Hosted, person: IO[str]) -> None:
    host = hosted()
    host.respond(QUESTION)
    person.close()
    with pytest.raises(SlipdError, match="an answer is needed, and the standard input has ended"):
        host.respond(None)


@pytest.mark.parametrize("lease", [False, True])
def test_a_request_without_a_daemon_is_a_refusal(hosted: Hosted, lease: bool) -> None:
    refusal = hosted().respond(Ask("gripper_stop", lease=lease))
    assert isinstance(refusal, Refusal)
    assert "nobody accepts requests at" in refusal.reason


def test_a_config_is_written_once_and_its_first_state_is_kept(hosted: Hosted, file: Path) -> None:
    host = hosted()
    for value in ("0.42", "0.43"):
        assert host.respond(Change({("finger", "left", "mu"): value})) == Reply(file.read_text(encoding="utf-8"))
    assert file.with_name("rig.toml.previous").read_text(encoding="utf-8") == TEXT
    file.write_text("# another program\n", encoding="utf-8")
    with pytest.raises(SlipdError, match="changed meanwhile and is left as it is"):
        host.respond(CHANGE)
    file.unlink()
    with pytest.raises(SlipdError, match=r"is left as it was: .*; put the lines above into it"):
        host.respond(CHANGE)


def test_a_dry_run_writes_nothing(hosted: Hosted, file: Path) -> None:
    assert hosted(write=False).respond(CHANGE) == Reply(None)
    assert file.read_text(encoding="utf-8") == TEXT


def test_a_program_that_types_without_end_does_not_hold_the_guide_up(
    hosted: Hosted, person: IO[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(commission_command, "MOST_EARLY", 3)
    host = hosted()
    person.write("ready\n" * 5)
    host.respond(QUESTION)
    assert host.respond(None) is None


class Page(io.StringIO):
    """Keeps what it is told, and answers at a question."""

    def __init__(self, person: IO[str], answers: str = "") -> None:
        super().__init__()
        self._person, self._answers = person, answers

    def write(self, text: str) -> int:
        if text.startswith('{"prompt"'):
            self._person.write(self._answers)
        return super().write(text)


def said() -> list[dict[str, Any]]:
    return [json.loads(line) for line in sys.stdout.getvalue().splitlines()]  # type: ignore[attr-defined]


def test_lines_and_prompts_are_objects(hosted: Hosted, person: IO[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdout", Page(person))
    host = hosted(PageHost)
    assert host.respond(Say("5.0 N. Let go.")) is None
    assert host.respond(Prompt("end", "Press the end.", "left")) is None
    prompt = {"step": "end", "text": "Press the end.", "finger": "left", "choices": ["skip"], "free": ""}
    assert said() == [{"say": "5.0 N. Let go."}, {"prompt": prompt}]


@pytest.mark.parametrize(("answers", "mu"), [("skip\n", 0.55), ("perhaps\nwrite\n", 0.42)])
def test_a_change_is_written_only_once_the_person_agrees(
    hosted: Hosted, file: Path, person: IO[str], monkeypatch: pytest.MonkeyPatch, answers: str, mu: float
) -> None:
    monkeypatch.setattr("sys.stdout", Page(person, answers))
    written = hosted(PageHost).respond(CHANGE)
    assert tomllib.loads(file.read_text(encoding="utf-8"))["finger"]["left"]["mu"] == mu
    assert (written.result is not None) == file.with_name("rig.toml.previous").exists() == (mu == 0.42)
    first, second, *_ = said()
    assert "mu = 0.42" in first["change"]
    assert second["prompt"]["choices"] == ["write", "skip"]


@pytest.mark.parametrize(("answers", "begins"), [("perhaps\nbegin\n", True), ("skip\n", False)])
def test_nothing_is_asked_of_the_daemon_before_the_person_begins(
    hosted: Hosted, person: IO[str], monkeypatch: pytest.MonkeyPatch, answers: str, begins: bool
) -> None:
    monkeypatch.setattr("sys.stdout", Page(person, answers))
    host = hosted(PageHost)
    monkeypatch.setattr(host, "_ask", None)
    assert host.wait_for_begin() is begins
    (prompt,) = said()
    assert prompt["prompt"]["choices"] == ["begin", "skip"]
