"""``slipd commission`` where it cannot begin: what is wrong is said before anything is asked of the person."""

from __future__ import annotations

from pathlib import Path
from typing import IO

import pytest

from slipd.cli import carry_out
from slipd.errors import ConfigError, SlipdError
from slipd.tools.cli_commands import parser
from slipd.tools.commission import commission_command, readings
from slipd.tools.commission.commission_command import PageHost
from slipd.tools.shipped_files import shipped_config


@pytest.fixture
def rig(tmp_path: Path, person: IO[str], monkeypatch: pytest.MonkeyPatch) -> Path:
    """A config without a daemon, and a standard input on which nobody types."""
    monkeypatch.setenv("SLIPD_RUNTIME_DIR", str(tmp_path / "run"))
    monkeypatch.setattr(commission_command, "SILENCE_S", 0.2)
    monkeypatch.setattr(readings, "PAUSE_S", 0.0)
    file = tmp_path / "rig.toml"
    file.write_text(shipped_config("demo.toml").read_text(encoding="utf-8"), encoding="utf-8")
    return file


def begin(rig: Path, *words: str) -> bool:
    return bool(carry_out(parser().parse_args(["commission", str(rig), "--patience", "1", *words])))


@pytest.mark.parametrize("page", [False, True])
def test_a_daemon_that_is_silent_is_named(
    rig: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], page: bool
) -> None:
    monkeypatch.setattr(PageHost, "wait_for_begin", lambda _: True)
    with pytest.raises(SlipdError, match=r"no message from the daemon for .* Is slipd running"):
        begin(rig, *["--page"] * page)
    shown = capsys.readouterr().out
    assert ("s and Enter leaves the present step or finger out" in shown) is not page
    assert "Step 1 of 4: mounting" in shown


def test_a_person_who_does_not_begin_on_the_page_changes_nothing(
    rig: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(PageHost, "wait_for_begin", lambda _: False)
    assert not begin(rig, "--page")
    assert "the zero of" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--finger", "middle"), "--finger must be one of left, right, got 'middle'"),
        (("--publish", "nonsense"), "nonsense"),
    ],
)
def test_a_wrong_argument_is_named(rig: Path, more: tuple[str, ...], words: str) -> None:
    with pytest.raises(SlipdError, match=words):
        begin(rig, *more)


def test_a_config_with_faults_is_not_begun_with(rig: Path) -> None:
    rig.write_text("[finger.left.wrench]\n", encoding="utf-8")
    with pytest.raises(ConfigError):
        begin(rig)


def test_a_guide_whose_steps_all_follow_says_so(rig: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert begin(rig, "--finger", "right", "--from", "grasp", "--dry-run")
    shown = capsys.readouterr().out.splitlines()
    assert shown[-2:] == ["", "Done."]
    assert "  left out: only slipd commission in a terminal moves the gripper, without --dry-run" in shown
