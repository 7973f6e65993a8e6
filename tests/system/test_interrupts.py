"""Ctrl-C: what is stopped before its work is done does not end as if it were."""

from __future__ import annotations

import pytest

from slipd import cli


@pytest.mark.parametrize(
    ("command", "code", "error"),
    [
        (["plot", "run.mcap"], 130, "slipd: interrupted\n"),
        (["export", "run.mcap", "out", "--to", "csv"], 130, "slipd: interrupted\n"),
        (["check", "rig.toml"], 130, "slipd: interrupted\n"),
        (["replay", "run.mcap"], 0, ""),
        (["run", "rig.toml"], 0, ""),
    ],
)
def test_an_interrupt_is_an_end_only_of_what_is_ended_by_hand(
    command: list[str], code: int, error: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(_: object) -> int:
        raise KeyboardInterrupt  # for example while its libraries are loaded

    monkeypatch.setitem(cli.COMMANDS, command[0], interrupted)
    assert cli.main(command) == code
    assert capsys.readouterr().err == error
