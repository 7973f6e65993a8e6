"""The demo as a user runs it, with real processes, ports and sockets: its reports against the truth of the scene."""

from __future__ import annotations

import fcntl
import os
import re
import signal
import subprocess
import sys
import termios
import time
import urllib.request
from dataclasses import dataclass
from pathlib import Path

import pytest
from terminals import PseudoTerminal

from slipd.events import Bytes
from slipd.recording.reader import open_recording
from slipd.recording.replay import replay
from slipd_client.messages import encode

pytestmark = pytest.mark.timeout(400)


@dataclass
class Demo:
    """A whole demo that was run as a process."""

    code: int
    summary: str
    errors: str
    recording: Path


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Demo:
    directory = tmp_path_factory.mktemp("demo")
    command = [sys.executable, "-m", "slipd", "demo", "--headless", "--record", str(directory / "demo.mcap")]
    runtime = os.environ | {"SLIPD_RUNTIME_DIR": str(directory / "run")}
    done = subprocess.run(command, env=runtime, capture_output=True, text=True, check=False, timeout=300)
    return Demo(done.returncode, done.stdout, done.stderr, directory / "demo.mcap")


def figure(demo: Demo, pattern: str) -> int:
    found = re.search(pattern, demo.summary, re.MULTILINE)
    assert found is not None, demo.summary
    return int(found[1])


@pytest.mark.process
def test_the_exit_code_and_the_summary_are_honest_on_any_machine(demo: Demo) -> None:
    """`tests/unit/tools/test_demo_story.py` holds what the scene must show, in simulated time."""
    assert demo.code == ("ended early" in demo.errors), demo.errors
    assert "Traceback" not in demo.errors
    warned = re.search(r"slipd    \w+: (warning|slipping) \([^)]*rotation", demo.summary)
    missing = {
        "ended early": "ended early" in demo.errors,
        "the rotation was not warned of": "truth    hold" in demo.summary and warned is None,
        "the slip was not reported": "truth    slide_begins" in demo.summary and "(slip_detected" not in demo.summary,
    }
    said = re.search(r"^NOT AS EXPECTED: (.*)$", demo.summary, re.MULTILINE)
    assert {what: what in (said[1] if said else "") for what in missing} == missing, demo.summary


@pytest.mark.process
def test_readings_flow_and_each_message_is_received_or_counted_as_missed(demo: Demo) -> None:
    """On a machine that cannot keep up some are missed; the few of the beginning and of the end are not asked for."""
    assert figure(demo, r"^readings: (\d+)") > 10_000
    assert re.search(r"^median latency: \d+\.\d\d ms", demo.summary, re.MULTILINE)
    published = sum(1 for _ in open_recording(demo.recording).messages())
    assert 0.9 * published < figure(demo, r"^messages: (\d+)") + figure(demo, r"^gaps: (\d+)") <= published


@pytest.mark.process
def test_a_replay_of_the_demo_gives_the_live_messages_byte_for_byte(demo: Demo) -> None:
    recording = open_recording(demo.recording)
    links = {event.link for _, event in recording.events() if isinstance(event, Bytes)}
    assert links == {"left.wrench", "left.pad", "right.wrench", "right.pad", "gripper"}
    live = list(open_recording(demo.recording).messages())
    again = [(topic, encode(body)) for topic, body in replay(open_recording(demo.recording))]
    assert recording.complete
    assert len(live) > 5000
    assert again == live


@pytest.mark.process
@pytest.mark.long
@pytest.mark.parametrize("end", [signal.SIGHUP, "--seconds=0.5"])
def test_a_demo_that_is_ended_early_leaves_neither_processes_nor_an_open_recording(
    end: signal.Signals | str, tmp_path: Path
) -> None:
    command = [sys.executable, "-m", "slipd", "demo", "--headless", "--record", str(tmp_path / "demo.mcap")]
    if isinstance(end, str):
        command.append(end)
    runtime = {"SLIPD_RUNTIME_DIR": str(tmp_path / "run")}
    with subprocess.Popen(command, env=os.environ | runtime, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert [process.stdout.readline().partition(": ")[0] for _ in range(2)] == ["publish", "requests"]
        if isinstance(end, signal.Signals):
            process.send_signal(end)
        process.communicate(timeout=60)
        assert process.returncode == 0
    assert_nothing_is_left(tmp_path)


def assert_nothing_is_left(folder: Path) -> None:
    """Check that the daemon of a demo is gone, and that its recording was closed."""
    daemon = int((folder / "run" / "lock").read_text())
    with pytest.raises(ProcessLookupError):
        os.kill(daemon, 0)
    assert open_recording(folder / "demo.mcap").closed


@pytest.mark.process
@pytest.mark.long
def test_on_a_terminal_the_demo_stays_open_until_a_key_plays_it_again_or_ends_it(tmp_path: Path) -> None:
    """A WARNING of a third of a second is over before a person has looked."""
    runtime = os.environ | {"SLIPD_RUNTIME_DIR": str(tmp_path / "run")}
    with PseudoTerminal(120, 60) as terminal:
        process = subprocess.Popen(
            [sys.executable, "-m", "slipd", "demo"],
            env=runtime,
            stdin=terminal.slave,
            stdout=terminal.slave,
            stderr=terminal.slave,
            start_new_session=True,
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
        )
        os.close(terminal.slave)
        for plays, key in ((1, " "), (2, "q")):
            terminal.wait_for(lambda _, plays=plays: terminal.sent.count(b"Any key plays the scene again") == plays)
            urls = re.findall(rb"the daemon runs on: (http://[^#\s]+)", terminal.sent)
            assert len(set(urls)) == 1, "the page of the first scene stays"
            with urllib.request.urlopen(urls[0].decode()) as page:
                assert page.status == 200
            terminal.type(key)
        while process.poll() is None:
            terminal.read(0.05)
        assert process.returncode == 0


@pytest.mark.process
def test_the_page_is_opened_where_there_is_a_display_and_all_ends_with_the_demo(demo: Demo, tmp_path: Path) -> None:
    opened, copy = tmp_path / "opened", tmp_path / "copy"
    browser = tmp_path / "browser"
    browser.write_text(f'#!/bin/sh\ncp -p "${{1#file://}}" {copy}\necho "$1" >> {opened}\n', encoding="utf-8")
    browser.chmod(0o700)
    environment = os.environ | {
        "SLIPD_RUNTIME_DIR": str(tmp_path / "run"),
        "DISPLAY": ":99",
        "BROWSER": f"{browser} %s",
    }
    command = [sys.executable, "-m", "slipd", "demo", "--record", str(tmp_path / "demo.mcap")]
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as process:
        until_s = time.monotonic() + 110.0
        while not opened.exists() or not opened.read_text().endswith("\n"):
            assert process.poll() is None
            assert time.monotonic() < until_s
            time.sleep(0.02)
        process.send_signal(signal.SIGTERM)
        printed, _ = process.communicate(timeout=110)
        assert process.returncode == 0
    (url,) = re.findall(r"^view: (http://127\.0\.0\.1:\d+/#\S{20,})$", printed, re.MULTILINE)
    (argument,) = opened.read_text().split()
    assert argument.startswith("file://")
    assert url.partition("#")[2] not in argument, "every user can read the arguments of a process"
    assert f'content="0; url={url}"' in copy.read_text()
    assert copy.stat().st_mode & 0o077 == 0
    assert not Path(argument.removeprefix("file://")).exists(), "it is removed with the demo"
    assert "view: " not in demo.summary
    assert_nothing_is_left(tmp_path)


@pytest.mark.process
@pytest.mark.long
@pytest.mark.parametrize("advised", [True, False])
def test_the_scene_carry_is_played_by_real_processes_and_replays(advised: bool, tmp_path: Path) -> None:
    """`tests/unit/tools/test_carry_story.py` holds what the scene must show, in simulated time."""
    recording = tmp_path / "carry.mcap"
    command = [sys.executable, "-m", "slipd", "demo", "--scene", "carry", "--headless", "--record", str(recording)]
    runtime = os.environ | {"SLIPD_RUNTIME_DIR": str(tmp_path / "run")}
    options = () if advised else ("--without-advice",)
    done = subprocess.run([*command, *options], env=runtime, capture_output=True, text=True, check=False, timeout=200)
    assert "Traceback" not in done.stderr
    assert done.returncode == ("ended early" in done.stderr), done.stderr
    if not done.returncode:
        assert ("glass: did not slip" in done.stdout) is advised, done.stdout
        assert len(re.findall("program  moves", done.stdout)) == 5
    live = list(open_recording(recording).messages())
    assert [(topic, encode(body)) for topic, body in replay(open_recording(recording))] == live
