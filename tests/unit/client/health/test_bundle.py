"""The bundle for those who help: what is in it, and what is not."""

from __future__ import annotations

import json
import re
import stat
import tarfile
from pathlib import Path

import pytest

from slipd_client import slipctl
from slipd_client.errors import CallError
from slipd_client.health import bundle
from slipd_client.health.bundle import REMOVED, Bundle, without_secrets
from slipd_client.keys import create

KEY = "rq:rM>}U?@Lns47E1%kR.o@n%FcmmsL/@{H8]yf7"


def contents(path: Path) -> dict[str, str]:
    with tarfile.open(path) as archive:
        return {
            member.name.rpartition("/")[2]: archive.extractfile(member).read().decode()  # type: ignore[union-attr]
            for member in archive
        }


@pytest.mark.parametrize(
    ("text", "clean"),
    [
        ('password = "hunter 2" # mine', f'password = "{REMOVED}" # mine'),
        ("http://127.0.0.1:8000/?token=abc123&x=1", f"http://127.0.0.1:8000/?token={REMOVED}&x=1"),
        ('"api_key": "abc", "b": 1', f'"api_key": "{REMOVED}", "b": 1'),
        ('{"token": 123, "b": 1}', f'{{"token": {REMOVED}, "b": 1}}'),
        ("Authorization: Bearer eyJhbGciOi.J9.x", f"Authorization: {REMOVED}"),
        ("ws://user:word@host:5000/x", f"ws://{REMOVED}@host:5000/x"),
        (f'public = "{KEY}"', f'public = "{REMOVED}"'),
        (f"--server={KEY}, ({KEY}); {KEY}", f"--server={REMOVED}, ({REMOVED}); {REMOVED}"),
        ('"path": "/home/anna.b/run.mcap"', '"path": "~/run.mcap"'),
        ("/dev/serial/by-id/usb-FTDI_FT232R_A10KZP-0", "/dev/serial/by-id/usb-FTDI_FT232R_A10KZP-0"),
        ("mu = 0.5\nrows = 4\n", "mu = 0.5\nrows = 4\n"),
    ],
)
def test_secrets_are_removed_and_the_rest_stays(text: str, clean: str) -> None:
    assert without_secrets(text) == clean


def test_no_key_of_a_real_pair_stays(tmp_path: Path) -> None:
    create("daemon", tmp_path)
    for file in tmp_path.iterdir():
        keys = [word for word in file.read_text(encoding="utf-8").split('"') if len(word) == 40]
        assert keys
        assert not any(key in without_secrets(file.read_text(encoding="utf-8")) for key in keys)


def test_a_bundle_is_private_and_overwrites_nothing(tmp_path: Path) -> None:
    made, path = Bundle(), tmp_path / "out.tar.gz"
    made.add("config.toml", lambda: 'token = "x"\n')
    made.add("log.txt", lambda: (_ for _ in ()).throw(FileNotFoundError("no journal")))
    made.add_recording(tmp_path / "none.mcap")
    made.write(path)
    found = contents(path)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert found["config.toml"] == f'token = "{REMOVED}"\n'
    assert "log.txt: no journal" in found["problems.txt"]
    assert "none.mcap" in found["problems.txt"]
    with pytest.raises(CallError, match="exists, and is not overwritten"):
        made.write(path)
    with pytest.raises(CallError, match="cannot be written"):
        made.write(tmp_path / "nowhere" / "out.tar.gz")


def test_a_long_recording_is_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bundle, "MOST_RECORDING_BYTES", 3)
    (tmp_path / "run.mcap").write_bytes(b"1234")
    made = Bundle()
    made.add_recording(tmp_path / "run.mcap")
    assert (made.parts, made.problems) == ({}, [f"{tmp_path}/run.mcap: left out, it has 4 bytes"])


def test_without_a_daemon_the_bundle_has_what_there_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config, out = tmp_path / "rig.toml", tmp_path / "out.tar.gz"
    config.write_text("mu = 0.5\n", encoding="utf-8")
    nowhere = f"ipc://{tmp_path}/nobody"
    arguments = ["--publish", nowhere, "--requests", nowhere, "diagnose", str(out), "--config", str(config)]
    assert slipctl.main([*arguments, "--seconds", "0.1"]) == 0
    found = contents(out)
    assert found["config.toml"] == "mu = 0.5\n"
    versions = json.loads(found["versions.json"])
    assert re.match(r"\d+\.\d+", versions["slipd"])
    assert versions["slipd-client"] == f"{versions['slipd']} (in slipd)"
    assert "status.json: " in found["problems.txt"]
    assert "not in it: status.json" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        slipctl.main([*arguments, "--seconds", "0.1"])


def test_without_a_journal_the_log_is_that_which_the_daemon_keeps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLIPD_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setenv("PATH", "")
    made = Bundle()
    made.add("log.txt", bundle._log)
    assert "no journalctl" in made.problems[0]
    (tmp_path / "log.1").write_text("ERROR before\n")
    (tmp_path / "log").write_text("ERROR left.wrench: gone, token=abc\n")
    made.add("log.txt", bundle._log)
    assert re.search(
        f"ERROR before\n== .*/log\nERROR left.wrench: gone, token={re.escape(REMOVED)}\n",
        made.parts["log.txt"].decode(),
    )
