"""The demo as a user runs it, with real processes, ports and sockets: its reports against the truth of the scene."""

from __future__ import annotations

import fcntl
import os
import re
import signal
import subprocess
import sys
import termios
import urllib.request
from pathlib import Path

import pytest
from terminals import PseudoTerminal

from slipd.events import Bytes, Request
from slipd.recording.reader import open_recording
from slipd.recording.replay import replay
from slipd_client.messages import encode

pytestmark = pytest.mark.timeout(400)

RUNS = 3


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    """Output of the whole demo, and its recording; of the last run where the machine kept up with none."""
    for _ in range(RUNS):
        directory = tmp_path_factory.mktemp("demo")
        recording = directory / "demo.mcap"
        command = [sys.executable, "-m", "slipd", "demo", "--headless", "--record", str(recording)]
        runtime = os.environ | {"SLIPD_RUNTIME_DIR": str(directory / "run")}
        done = subprocess.run(command, env=runtime, capture_output=True, text=True, check=False, timeout=110)
        if not dropped_bytes(done.stdout):
            break
    if done.returncode != 0 and dropped_bytes(done.stdout):
        pytest.skip(f"this machine is too busy for the demo in each of {RUNS} runs")
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout, recording


def dropped_bytes(summary: str) -> int:
    """Return how many bytes of the sensors were lost because this machine did not read them for too long."""
    found = "".join(re.findall(r"truth    end \(dropped_bytes \{(.*?)\}", summary))
    return sum(map(int, re.findall(r": (\d+)", found)))


@pytest.fixture
def kept_up(demo: tuple[str, Path]) -> None:
    """Without its bytes a finger is unknown, and no grip is raised: then nothing that follows in the scene can hold."""
    if dropped_bytes(demo[0]):
        pytest.skip(f"this machine lost bytes of the sensors in each of {RUNS} runs")


def times(summary: str, line: str) -> list[float]:
    """Return the times of a line of the summary, s of the scene."""
    return [float(found) for found in re.findall(rf"^ *([\d.]+) s  {line}", summary, re.MULTILINE)]


@pytest.mark.process
@pytest.mark.usefixtures("kept_up")
def test_the_warning_for_rotation_comes_before_the_rotation(demo: tuple[str, Path]) -> None:
    lead = re.search(r"rotation: warned ([\d.]+) s before it would have begun", demo[0])
    assert lead is not None, demo[0]
    assert float(lead[1]) > 0.2
    assert not times(demo[0], "truth    slide_begins.*load_spin_nm 0.[0-9]*[1-9]"), "the raised grip must hold"


@pytest.mark.process
@pytest.mark.usefixtures("kept_up")
def test_the_grip_request_is_granted_and_visible_in_the_measured_force(demo: tuple[str, Path]) -> None:
    granted = re.search(r"granted ([\d.]+) N; measured ([\d.]+) N → ([\d.]+) N", demo[0])
    assert granted is not None, demo[0]
    applied, before, after = map(float, granted.groups())
    assert after > before + 1.0
    assert after >= 0.95 * applied


@pytest.mark.process
@pytest.mark.usefixtures("kept_up")
def test_the_slip_is_reported_when_it_happens(demo: tuple[str, Path]) -> None:
    began = times(demo[0], "truth    slide_begins")
    reported = times(demo[0], r"slipd    \w+: slipping \(slip_detected")
    assert began, demo[0]
    assert any(0.0 <= t - began[0] < 0.5 for t in reported), demo[0]


@pytest.mark.process
@pytest.mark.usefixtures("kept_up")
def test_the_summary_counts(demo: tuple[str, Path]) -> None:
    for pattern in (
        r"^readings: \d{5}",
        r"^messages: \d{4,} \(\d+ grasp, \d+ gripper, \d+ slip",
        r"^warnings: [1-9]\d* ",
        r"^median latency: \d+\.\d\d ms",
    ):
        assert re.search(pattern, demo[0], re.MULTILINE), (pattern, demo[0])


@pytest.mark.process
def test_each_message_is_received_or_counted_as_missed(demo: tuple[str, Path]) -> None:
    """On a machine that cannot keep up some are missed; the few of the beginning and of the end are not asked for."""
    received, missed = (int(found) for found in re.findall(r"^(?:messages|gaps): (\d+)", demo[0], re.MULTILINE))
    published = sum(1 for _ in open_recording(demo[1]).messages())
    assert 0.9 * published < received + missed <= published


@pytest.mark.process
def test_a_replay_of_the_demo_gives_the_live_messages_byte_for_byte(demo: tuple[str, Path]) -> None:
    recording = open_recording(demo[1])
    entered = [event for _, event in recording.events()]
    links = {event.link for event in entered if isinstance(event, Bytes)}
    assert links == {"left.wrench", "left.pad", "right.wrench", "right.pad", "gripper"}
    asked = {event.body["op"] for event in entered if isinstance(event, Request)}
    assert asked >= {"tare", "gripper.close", "lease.renew"}
    assert "grip.set" in asked or dropped_bytes(demo[0])
    live = list(open_recording(demo[1]).messages())
    again = [(topic, encode(body)) for topic, body in replay(open_recording(demo[1]))]
    assert recording.complete
    assert len(live) > 5000
    assert again == live


@pytest.mark.process
@pytest.mark.parametrize(
    "end", [signal.SIGTERM, *(pytest.param(end, marks=pytest.mark.long) for end in (signal.SIGHUP, "--seconds=0.5"))]
)
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
    daemon = int((tmp_path / "run" / "lock").read_text())
    with pytest.raises(ProcessLookupError):
        os.kill(daemon, 0)
    assert open_recording(tmp_path / "demo.mcap").closed


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
def test_the_page_is_opened_where_there_is_a_display_and_never_without_a_live_view(
    demo: tuple[str, Path], tmp_path: Path
) -> None:
    opened, copy = tmp_path / "opened", tmp_path / "copy"
    browser = tmp_path / "browser"
    browser.write_text(f'#!/bin/sh\necho "$1" >> {opened}\ncp -p "${{1#file://}}" {copy}\n', encoding="utf-8")
    browser.chmod(0o700)
    environment = os.environ | {
        "SLIPD_RUNTIME_DIR": str(tmp_path / "run"),
        "DISPLAY": ":99",
        "BROWSER": f"{browser} %s",
    }
    command = [sys.executable, "-m", "slipd", "demo", "--seconds", "0.5"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=110)
    assert done.returncode == 0, done.stderr
    (url,) = re.findall(r"^view: (http://127\.0\.0\.1:\d+/#\S{20,})$", done.stdout, re.MULTILINE)
    (argument,) = opened.read_text().split()
    assert argument.startswith("file://")
    assert url.partition("#")[2] not in argument, "every user can read the arguments of a process"
    assert f'content="0; url={url}"' in copy.read_text()
    assert copy.stat().st_mode & 0o077 == 0
    assert not Path(argument.removeprefix("file://")).exists(), "it is removed with the demo"
    assert "view: " not in demo[0]
