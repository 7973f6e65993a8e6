from __future__ import annotations

import json
import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import pytest

from slipd_client import watch as module
from slipd_client.messages.codec import typed_message
from slipd_client.messages.schema.topics import Message
from slipd_client.watch import watch

if TYPE_CHECKING:
    from conftest import Publisher

PATIENCE_S = 60.0

Start = Callable[..., "subprocess.Popen[str]"]


class Heard:
    """A subscriber that has heard these messages, and hears no more."""

    def __init__(self, *messages: tuple[str, dict[str, Any]]) -> None:
        head = {"v": 1, "boot": "b", "t_ns": 1, "finger": "left"}
        self._left = iter([typed_message(topic, head | {"seq": n} | body) for n, (topic, body) in enumerate(messages)])

    def __enter__(self) -> Heard:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def __iter__(self) -> Iterator[Message]:
        return self._left

    def receive(self, timeout_s: float) -> Message | None:
        return next(self._left, None)


def test_once_shows_the_last_message_of_every_topic(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    messages = [
        ("slip.left", {"level": "stable"}),
        ("wrench.left", {"force_n": [0.0, 0.0, 1.5]}),
        ("slip.left", {"level": "caution", "mu": None}),
        ("slip.right", {"finger": "right", "level": "unknown"}),
    ]
    monkeypatch.setattr(module, "Subscriber", lambda *_, **__: Heard(*messages))
    watch("", as_json=False, once=True)
    shown = capsys.readouterr().out
    assert re.search(r"left +CAUTION", shown)
    assert re.search(r"right +UNKNOWN", shown)
    assert "\x1b" not in shown
    watch("", as_json=True, once=True)
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [line["topic"] for line in lines] == ["slip.left", "slip.right", "wrench.left"]
    assert (lines[0]["mu"], lines[2]["force_n"]) == (None, [0.0, 0.0, 1.5])


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
