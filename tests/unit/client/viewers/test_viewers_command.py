from __future__ import annotations

import signal
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from foxglove_client import FoxgloveClient
from project import ROOT

from slipd_client.errors import CallError, Silence
from slipd_client.serving import follow, pads_of
from slipd_client.slipctl import main
from slipd_client.subscriber import Message, Subscriber
from slipd_client.viewers.viewers_command import levels_of

if TYPE_CHECKING:
    from conftest import Publisher

PATIENCE_S = 60.0

HEADER = {"timestamp": 1_700_000_000.5, "frame": "", "config_id": "c"}


def test_a_silence_of_the_daemon_is_reported_to_the_person_and_to_the_viewers_until_it_ends(
    publisher: Publisher, slipctl: Callable[..., subprocess.Popen[str]]
) -> None:
    process = slipctl("--publish", publisher.endpoint, "serve", "foxglove", "--listen", "127.0.0.1:0")
    assert process.stdout is not None
    assert process.stderr is not None
    url = process.stdout.readline().removeprefix("foxglove: ").strip()
    publisher.wait_for_subscriber()
    publisher.send("status", 1, **HEADER)
    with FoxgloveClient(url) as client:
        client.subscribe("/diagnostics")
        assert client.receive().message.status[0].name == "slipd: daemon"
        why = f"no message from {publisher.endpoint} for 3 s. Is slipd running?"
        assert process.stderr.readline() == f"slipctl: {why}\n"
        assert client.receive().message.status[0].message == why
        assert client.heard("status")["message"] == why
        publisher.boot = "boot-2"
        publisher.send("status", 1, **HEADER)
        assert client.receive().message.status[0].message == "OK"
        client.heard("removeStatus")
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, errors) == (130, "")


def test_while_nobody_watches_the_newest_of_every_topic_is_kept_and_a_silence_said_once(
    publisher: Publisher, capsys: pytest.CaptureFixture[str]
) -> None:
    with Subscriber(publisher.endpoint, ("",), silence_s=0.5) as subscriber:
        publisher.wait_for_subscriber()
        arriving = follow(subscriber, idle=lambda: True)
        for _ in range(2):
            assert isinstance(next(arriving), Silence)
        assert capsys.readouterr().err.count("no message from") == 1
        for topic in ("slip.left", "slip.right", "grasp"):
            publisher.send(topic, 1, level="stable")
        arrived = [each.topic for each in (next(arriving) for _ in range(3)) if isinstance(each, Message)]
        assert sorted(arrived) == ["grasp", "slip.left", "slip.right"]
        assert isinstance(next(arriving), Silence)
        assert capsys.readouterr().err.count("no message from") == 1, "of a further silence"


def test_the_levels_of_the_layouts_are_those_of_a_config(tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    for text, levels in (
        ("", (0.7, 0.85, "rig.toml")),
        ("[levels]\ncaution = 0.5", (0.5, 0.85, "rig.toml")),
        ("[levels]\ncaution = 0.5\nwarning = 0.6", (0.5, 0.6, "rig.toml")),
    ):
        rig.write_text(text)
        assert levels_of(rig) == levels
    rig.write_text("[levels]\ncaution = true")
    with pytest.raises(CallError, match="must be numbers"):
        levels_of(rig)
    assert levels_of(None) == (0.7, 0.85, "slipd's defaults")


def test_an_edited_layout_is_not_replaced(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "layouts"
    for _ in range(2):
        assert main(["serve", "foxglove", "--write-layouts", str(folder)]) == 0
    (folder / "foxglove.json").unlink()
    (folder / "plotjuggler.xml").write_text("edited")
    capsys.readouterr()
    assert main(["serve", "foxglove", "--write-layouts", str(folder)]) == 2
    assert "plotjuggler.xml: exists already with other contents, and is not replaced" in capsys.readouterr().err
    assert (folder / "plotjuggler.xml").read_text() == "edited"
    assert not (folder / "foxglove.json").exists(), "nothing is written in part"


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--listen", "8765"], "argument --listen: must be HOST:PORT, e.g. 127.0.0.1:"),
        (["--listen", "localhost:99999"], "must be HOST:PORT"),
        (["--config", "/nowhere/rig.toml"], "/nowhere/rig.toml: cannot be read: No such file or directory"),
        (["--fingers", "Left"], "argument --fingers: must be the name of a finger, a-z and 0-9, got 'Left'"),
        (["--write-layouts", "/dev/null/layouts"], "/dev/null/layouts: cannot be written: Not a directory"),
    ],
)
def test_wrong_arguments_exit_with_2(
    arguments: list[str], complaint: str, call: Callable[..., tuple[int, str, str]]
) -> None:
    code, _, errors = call("serve", "foxglove", *arguments)
    assert code == 2
    assert complaint in errors


def test_the_places_of_the_pads_are_those_of_a_config(tmp_path: Path) -> None:
    pads = pads_of(ROOT / "config" / "demo.toml")
    found = pads.transforms({"stamp": {"sec": 1, "nanosec": 0}, "frame_id": ""}, 0.06)
    assert [(each["child_frame_id"], each["transform"]["translation"]["y"]) for each in found] == [
        ("left_pad", pytest.approx(0.03)),
        ("right_pad", pytest.approx(-0.03)),
    ]
    for text, complaint in (
        ("[grasp", "not a TOML file"),
        ("[finger.left]", "must have [grasp.pads]"),
        ("[grasp.pads.left]\npositions = 3", "must have [grasp.pads]"),
    ):
        (tmp_path / "rig.toml").write_text(text)
        with pytest.raises(CallError) as refused:
            pads_of(tmp_path / "rig.toml")
        assert complaint in str(refused.value)
