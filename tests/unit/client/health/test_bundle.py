"""The bundle for those who help: what is in it, and what is not."""

from __future__ import annotations

import json
import os
import re
import stat
import tarfile
from pathlib import Path

import pytest

from slipd.events import LinkDown
from slipd.recording.mcap_file import RecordingFile
from slipd.recording.reader import open_recording
from slipd_client import slipctl
from slipd_client.errors import CallError
from slipd_client.health.bundle import REMOVED, Bundle, without_secrets
from slipd_client.messages import decode, encode

SECRET_URL = "ws://robot:hunter2@host:5000"
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


def test_a_bundle_is_private_and_overwrites_nothing(tmp_path: Path) -> None:
    made, path = Bundle(), tmp_path / "out.tar.gz"
    made.add("config.toml", lambda: 'token = "x"\n')
    made.add("log.txt", lambda: (_ for _ in ()).throw(FileNotFoundError("no journal")))
    made.write(path)
    found = contents(path)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert found["config.toml"] == f'token = "{REMOVED}"\n'
    assert "log.txt: no journal" in found["problems.txt"]
    with pytest.raises(CallError, match="exists, and is not overwritten"):
        made.write(path)
    with pytest.raises(CallError, match="cannot be written"):
        made.write(tmp_path / "nowhere" / "out.tar.gz")


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """A recording with a password in its config, in a message and in an event."""
    file = RecordingFile(
        tmp_path / "run.mcap", config_text=f'port = "{SECRET_URL}"\n', boot="b", wall_minus_monotonic_ns=0
    )
    file.event(0, 1, LinkDown("pads", f"{SECRET_URL} does not answer"))
    file.published(1, 2, "status", encode({"streams": [{"address": SECRET_URL, "rate_hz": 0.1}]}))
    file.finish(2)
    return tmp_path / "run.mcap"


def test_the_secrets_inside_a_recording_are_removed_and_the_rest_stays(recording: Path, tmp_path: Path) -> None:
    made = Bundle()
    made.add_recording(recording)
    assert made.problems == []
    clean = tmp_path / "clean.mcap"
    clean.write_bytes(made.parts["run.mcap"])
    found = open_recording(clean)
    (_, event), (_, payload) = *found.events(), *found.messages()
    address = f"ws://{REMOVED}@host:5000"
    assert found.config_text == f'port = "{address}"\n'
    assert event == LinkDown("pads", f"{address} does not answer")
    assert decode(payload)["streams"] == [{"address": address, "rate_hz": 0.1}]


def test_only_recordings_of_this_user_are_added(recording: Path, tmp_path: Path) -> None:
    (key := tmp_path / "key.mcap").write_text("-----BEGIN OPENSSH PRIVATE KEY-----\n", encoding="utf-8")
    (link := tmp_path / "link.mcap").symlink_to(recording)
    (open_to_all := tmp_path / "open.mcap").write_bytes(recording.read_bytes())
    open_to_all.chmod(0o666)
    left_out = {
        key: "it is not a recording of slipd",
        link: "it must be a file of the user",
        open_to_all: "must not be writable by other users",
        tmp_path / "none.mcap": "No such file",
    }
    if os.geteuid() == 0:  # only root gives files away
        (other := tmp_path / "other.mcap").write_bytes(recording.read_bytes())
        os.chown(other, 54321, -1)
        left_out[other] = "it must be a file of the user"
    made = Bundle()
    for path in left_out:
        made.add_recording(path)
    assert made.parts == {}
    for (path, why), problem in zip(left_out.items(), made.problems, strict=True):
        assert problem.startswith(f"{path}: left out: ")
        assert why in problem


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
    assert slipctl.main([*arguments, "--seconds", "0.1"]) == 2, "it is never overwritten"
    out.unlink()
    assert slipctl.main([*arguments, "--seconds", "0", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["bytes"]["config.toml"] == len("mu = 0.5\n")
