from __future__ import annotations

import json
import re
import signal
import subprocess
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

from slipd_client import watch as module
from slipd_client.errors import Silence
from slipd_client.watch import watch

if TYPE_CHECKING:
    from conftest import Publisher

PATIENCE_S = 60.0

Start = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture
def sending(publisher: Publisher) -> Callable[..., threading.Thread]:
    """Sends from a thread of its own once somebody listens to a topic; only that thread then uses the publisher."""

    def start(send: Callable[[], None], topic: bytes = b"slip") -> threading.Thread:
        def run() -> None:
            publisher.wait_for(topic)
            send()

        thread = threading.Thread(target=run, daemon=True)
        thread.start()
        return thread

    return start


def test_a_daemon_that_cannot_be_read_is_told_with_the_reason(
    publisher: Publisher,
    sending: Callable[..., threading.Thread],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "FIRST_S", 0.5)
    thread = sending(lambda: publisher.send("status", 1, v=2), b"status")
    with pytest.raises(Silence, match="1 could not be read, the last: unsupported_version"):
        watch(publisher.endpoint, as_json=False, once=True)
    thread.join()


def test_once_shows_the_last_message_of_every_topic(
    publisher: Publisher, sending: Callable[..., threading.Thread], capsys: pytest.CaptureFixture[str]
) -> None:
    def send() -> None:
        publisher.send("slip.left", 1, level="stable")
        publisher.send("slip.left", 2, level="caution")
        publisher.send("slip.right", 1, level="unknown")

    thread = sending(send)
    watch(publisher.endpoint, as_json=False, once=True)
    thread.join()
    shown = capsys.readouterr().out
    assert re.search(r"left +CAUTION", shown)
    assert re.search(r"right +UNKNOWN", shown)
    assert "\x1b" not in shown


def test_once_as_json_is_one_line_a_topic(
    publisher: Publisher, sending: Callable[..., threading.Thread], capsys: pytest.CaptureFixture[str]
) -> None:
    def send() -> None:
        publisher.send("wrench.left", 1, force_n=[0.0, 0.0, 1.5])
        publisher.send("slip.left", 1, mu=None)

    thread = sending(send, b"")
    watch(publisher.endpoint, as_json=True, once=True)
    thread.join()
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [line["topic"] for line in lines] == ["slip.left", "wrench.left"]
    assert lines[0]["mu"] is None
    assert lines[1]["force_n"] == [0.0, 0.0, 1.5]


def test_into_a_pipe_goes_each_change_and_ctrl_c_ends_it_cleanly(publisher: Publisher, slipctl: Start) -> None:
    process = slipctl("--publish", publisher.endpoint, "watch")
    for _ in module.TOPICS:
        publisher.wait_for_subscriber()
    publisher.send("slip.left", 1, level="stable", utilisation=0.25)
    publisher.send_frames(b"warning", b"\xc1 no message")
    publisher.send("warning", 1, finger="left", previous="stable", level="warning", reasons=["tipping"])
    publisher.send("warning", 4, finger="left", previous="warning", level="slipping", reasons=[])
    assert process.stdout is not None
    lines = [process.stdout.readline() for _ in range(3)]
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=PATIENCE_S)
    assert "left stable λ 0.25" in lines[0]
    assert lines[1].endswith("left stable → warning  (tipping)\n")
    assert lines[2].endswith("left warning → slipping\n")
    assert errors == "slipctl: 2 messages of warning were missed\n"
    assert process.returncode == 130


@pytest.mark.parametrize(
    ("options", "subscribed", "expected"),
    [
        (["--json"], b"", [("tactile.left", 1), ("status", 9), ("wrench.left", 2)]),
        (["--topic", "wrench.left", "--topic", "tactile"], b"tactile", [("tactile.left", 1), ("wrench.left", 2)]),
    ],
)
def test_json_is_every_message_of_every_topic_or_of_those_that_are_named(
    publisher: Publisher, slipctl: Start, options: list[str], subscribed: bytes, expected: list[tuple[str, int]]
) -> None:
    process = slipctl("watch", "--publish", publisher.endpoint, *options)
    publisher.wait_for(subscribed)
    for topic, seq in (("tactile.left", 1), ("status", 9), ("wrench.left", 2)):
        publisher.send(topic, seq)
    assert process.stdout is not None
    lines = [json.loads(process.stdout.readline()) for _ in expected]
    assert [(line["topic"], line["seq"]) for line in lines] == expected


def test_a_closed_output_pipe_is_not_an_error(publisher: Publisher, slipctl: Start) -> None:
    process = slipctl("--publish", publisher.endpoint, "watch", "--json")
    publisher.wait_for_subscriber()
    assert process.stdout is not None
    process.stdout.close()
    process.stdout = None
    seq = 0
    until = time.monotonic() + PATIENCE_S
    while process.poll() is None and time.monotonic() < until:
        seq += 1
        publisher.send("status", seq)
        time.sleep(0.01)
    assert process.stderr is not None
    assert (process.returncode, process.stderr.read()) == (0, "")
