"""The guide in a terminal: how questions are asked, what is typed, and how the config is written."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import pytest

from slipd import config
from slipd.errors import SlipdError
from slipd.tools.commission import hosts
from slipd.tools.commission.daemon_link import DaemonLink
from slipd.tools.commission.dialogue import Change, Choice, Prompt, Refusal, Written, ask
from slipd.tools.commission.hosts import TerminalHost

TEXT = config.shipped("demo.toml").read_text(encoding="utf-8")
CHANGE = Change({("finger", "left", "mu"): "0.42"})
QUESTION = Prompt("tips_down", "Turn it.", "left", ("ready", "skip"), "gravity (x y z)")


@contextmanager
def hosted(
    folder: Path, monkeypatch: pytest.MonkeyPatch, *, write: bool = True, text: str = TEXT
) -> Iterator[tuple[TerminalHost, IO[str]]]:
    """A host of a config, without a daemon, and what the person types into."""
    file = folder / "rig.toml"
    file.write_text(text, encoding="utf-8", newline="")
    monkeypatch.setattr(hosts, "SILENCE_S", 0.3)
    read, end = os.pipe()
    with io.open(read) as stdin, io.open(end, "w") as person:  # noqa: UP020 - sys.stdin is a file of io
        monkeypatch.setattr("sys.stdin", stdin)
        link = DaemonLink(f"ipc://{folder}/publish", f"ipc://{folder}/requests", None, None)
        with TerminalHost(file, text, link, write=write) as host:
            yield host, person


def type_line(person: IO[str], line: str) -> None:
    person.write(f"{line}\n")
    person.flush()


@pytest.mark.parametrize(
    ("line", "word"), [("", "ready"), ("r", "ready"), ("S", "skip"), ("skip", "skip"), ("0 0 1", "0 0 1")]
)
def test_enter_is_the_first_word_and_a_letter_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], line: str, word: str
) -> None:
    with hosted(tmp_path, monkeypatch) as (host, person):
        type_line(person, "typed too early")
        host.respond(QUESTION)
        type_line(person, line)
        assert host.respond(None) == Choice(word)
    assert capsys.readouterr().out == "Turn it. [Enter: ready, s: skip, or type gravity (x y z)]\n"


def test_a_question_without_anybody_to_answer_ends_the_guide(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with hosted(tmp_path, monkeypatch) as (host, person):
        host.respond(QUESTION)
        person.close()
        with pytest.raises(SlipdError, match="an answer is needed, and the standard input has ended"):
            host.respond(None)


def test_a_request_without_a_daemon_is_a_refusal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with hosted(tmp_path, monkeypatch) as (host, _):
        for lease in (False, True):
            refusal = host.respond(ask("gripper_stop", lease=lease))
            assert isinstance(refusal, Refusal)
            assert "nobody accepts requests at" in refusal.reason


def test_a_config_is_written_once_and_its_first_state_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "rig.toml"
    with hosted(tmp_path, monkeypatch) as (host, _):
        for value in ("0.42", "0.43"):
            written = host.respond(Change({("finger", "left", "mu"): value}))
            assert isinstance(written, Written)
            assert written.text == file.read_text(encoding="utf-8")
        assert (tmp_path / "rig.toml.previous").read_text(encoding="utf-8") == TEXT
        file.write_text("# another program\n", encoding="utf-8")
        with pytest.raises(SlipdError, match="changed meanwhile and is left as it is"):
            host.respond(CHANGE)
        file.unlink()
        with pytest.raises(SlipdError, match=r"is left as it was: .*; put the lines above into it"):
            host.respond(CHANGE)


def test_a_dry_run_writes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with hosted(tmp_path, monkeypatch, write=False) as (host, _):
        assert host.respond(CHANGE) == Written(None)
    assert (tmp_path / "rig.toml").read_text(encoding="utf-8") == TEXT


def test_a_program_that_types_without_end_does_not_hold_the_guide_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hosts, "MOST_EARLY", 3)
    with hosted(tmp_path, monkeypatch) as (host, person):
        for _ in range(5):
            type_line(person, "ready")
        host.respond(QUESTION)
        assert host.respond(None) is None
