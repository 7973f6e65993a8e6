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
from dataclasses import dataclass
from pathlib import Path

import pytest
from rig_parts import PATIENCE_S, endpoints_of, part
from terminals import PseudoTerminal

from slipd.recording.reader import open_recording
from slipd.recording.replay import replay
from slipd_client.messages import encode

pytestmark = [pytest.mark.process, pytest.mark.timeout(400)]


@dataclass
class Demo:
    """A whole demo that was run as a process."""

    code: int
    summary: str
    errors: str
    recording: Path


def run_demo(folder: Path, *options: str) -> Demo:
    recording = folder / "demo.mcap"
    command = [sys.executable, "-m", "slipd", "demo", "--headless", "--record", str(recording), *options]
    runtime = os.environ | {"SLIPD_RUNTIME_DIR": str(folder / "run")}
    done = subprocess.run(command, env=runtime, capture_output=True, text=True, check=False, timeout=300)
    assert "Traceback" not in done.stderr
    return Demo(done.returncode, done.stdout, done.stderr, recording)


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Demo:
    return run_demo(tmp_path_factory.mktemp("demo"))


def test_the_exit_code_and_the_summary_are_honest_on_any_machine(demo: Demo) -> None:
    """`tests/unit/tools/test_demo_story.py` holds what the scene must show, in simulated time."""
    assert demo.code == ("ended early" in demo.errors), demo.errors
    warned = re.search(r"slipd    \w+: (warning|slipping) \([^)]*rotation", demo.summary)
    said = re.search(r"^NOT AS EXPECTED: (.*)$", demo.summary, re.MULTILINE)
    missing = {
        "ended early": "ended early" in demo.errors,
        "the rotation was not warned of": "truth    hold" in demo.summary and warned is None,
        "the slip was not reported": "truth    slide_begins" in demo.summary and "(slip_detected" not in demo.summary,
    }
    assert {what: what in (said[1] if said else "") for what in missing} == missing, demo.summary


def test_each_message_is_received_or_counted_as_missed_and_a_replay_gives_the_same(demo: Demo) -> None:
    """On a machine that cannot keep up some are missed; the few of the beginning and of the end are not asked for."""
    figures = dict(re.findall(r"^(\w+(?: latency)?): ([\d.]+)", demo.summary, re.MULTILINE))
    published = replayed(demo)
    assert int(figures["readings"]) > 10_000, demo.errors
    assert 0.9 * published < int(figures["messages"]) + int(figures["gaps"]) <= published
    assert float(figures["median latency"]) > 0.0


def replayed(demo: Demo) -> int:
    """Check that a replay gives the live messages, and return how many."""
    recording = open_recording(demo.recording)
    live = list(recording.messages())
    assert recording.complete
    assert [(topic, encode(body)) for topic, body in replay(open_recording(demo.recording))] == live
    return len(live)


@pytest.mark.long
def test_a_demo_that_a_signal_ends_leaves_neither_processes_nor_an_open_recording(tmp_path: Path) -> None:
    with part(tmp_path, "slipd", "demo", "--headless", "--record", str(tmp_path / "demo.mcap")) as process:
        endpoints_of(process)
        process.send_signal(signal.SIGHUP)
        assert process.wait(PATIENCE_S) == 0
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "run" / "lock").read_text()), 0)
    assert open_recording(tmp_path / "demo.mcap").closed


@pytest.mark.long
def test_on_a_terminal_the_demo_stays_open_until_a_key_plays_it_again_or_ends_it(tmp_path: Path) -> None:
    """A WARNING of a third of a second is over before a person has looked."""
    with PseudoTerminal(120, 60) as terminal:
        process = subprocess.Popen(
            [sys.executable, "-m", "slipd", "demo"],
            env=os.environ | {"SLIPD_RUNTIME_DIR": str(tmp_path / "run")},
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


@pytest.mark.long
@pytest.mark.parametrize("advised", [True, False])
def test_the_scene_carry_is_played_by_real_processes_and_replays(advised: bool, tmp_path: Path) -> None:
    """`tests/unit/tools/test_carry_story.py` holds what the scene must show, in simulated time."""
    carried = run_demo(tmp_path, "--scene", "carry", *(() if advised else ("--without-advice",)))
    assert carried.code == ("ended early" in carried.errors), carried.errors
    if not carried.code:
        assert ("glass: did not slip" in carried.summary) is advised, carried.summary
        assert len(re.findall("program  moves", carried.summary)) == 5
    assert replayed(carried)
