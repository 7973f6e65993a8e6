"""``slipd init`` on emulated devices: what it finds, writes and refuses; nothing is replaced."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
from emulation_thread import plugged

from slipd import config
from slipd.errors import SlipdError, UsageError
from slipd.tools.discovery import config_draft, port_probe
from slipd.tools.discovery.config_draft import init_command
from slipd.tools.discovery.port_probe import SAME_SOCKET, list_ports


def made(folder: Path) -> Path:
    folder.mkdir()
    return folder


def test_a_config_is_written_for_what_answers(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    by_id, file = made(tmp_path / "by-id"), tmp_path / "rig.toml"
    with plugged(by_id, "bota"):
        (by_id / "no-port").symlink_to("/dev/null")
        init_command(tmp_path / "list.toml", by_id, only_list=True)
        assert not (tmp_path / "list.toml").exists()
        init_command(file, by_id, only_list=False)
        with pytest.raises(UsageError, match=r"cannot be created: there is no folder .*; create it: mkdir -p"):
            init_command(tmp_path / "missing" / "rig.toml", by_id, only_list=False)
    shown = capsys.readouterr().out
    assert f"{by_id}/bota: bota" in shown
    assert f"{by_id}/no-port: cannot be opened: " in shown
    assert "\n".join(f"  slipd {command} {file}" for command in ("check", "run", "commission")) in shown
    [stream] = config.load(file).streams().values()
    assert (stream.device, stream.port) == ("bota", f"{by_id}/bota")
    commented = [
        line for line in file.read_text(encoding="utf-8").splitlines() if re.search("[0-9] +# (MEASURE|s)", line)
    ]
    assert {line.index("#") for line in commented} == {24}
    with pytest.raises(UsageError, match="exists, and is not replaced"):
        init_command(file, by_id, only_list=False)


def test_without_a_sensor_nothing_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(UsageError, match=r"--ports must be a folder of serial ports, .* there is no folder .*/none"):
        init_command(tmp_path / "rig.toml", tmp_path / "none", only_list=False)
    with pytest.raises(SlipdError, match="there is no serial port in"):
        init_command(tmp_path / "rig.toml", made(tmp_path / "empty"), only_list=False)
    monkeypatch.setattr(port_probe, "LISTEN_S", 0.05)
    with (
        plugged(made(tmp_path / "by-id"), "robotiq_2f"),
        pytest.raises(SlipdError, match=r"no force sensor answered .*; nothing is written"),
    ):
        init_command(tmp_path / "rig.toml", tmp_path / "by-id", only_list=False)
    assert not (tmp_path / "rig.toml").exists()


def test_a_port_that_is_silent_and_a_name_that_may_change_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("LISTEN_S", "ASK_S"):
        monkeypatch.setattr(port_probe, name, 0.02)
    by_path = tmp_path / "by-path"
    by_path.mkdir()
    monkeypatch.setattr(config_draft, "list_ports", lambda: list_ports(tmp_path / "none", by_path, tmp_path / "none"))
    master, slave = os.openpty()
    try:
        (by_path / "usb-1").symlink_to(os.ttyname(slave))
        init_command(tmp_path / "rig.toml", None, only_list=True)
    finally:
        os.close(master)
        os.close(slave)
    assert capsys.readouterr().out.splitlines() == [
        f"{by_path}/usb-1: no device that slipd knows answered",
        f"  {SAME_SOCKET}",
    ]
