"""After a daemon dies or reads another config, the grip stays and the lease is gone; a recording lacks only its end."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TypeVar

import pytest

from slipd import config
from slipd.recording.reader import open_recording
from slipd.recording.replay import replay
from slipd_client.errors import ClientError
from slipd_client.grip import GripClient
from slipd_client.messages import encode
from slipd_client.subscriber import Subscriber

T = TypeVar("T")

PATIENCE_S = 60.0
GRIP_N = 22.0
"""Enough for every load of the scene, however long the second start takes."""


@contextmanager
def part(folder: Path, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    with (folder / "errors.log").open("a") as errors:
        process = subprocess.Popen(
            [sys.executable, "-m", *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=errors,
            env=os.environ | {"SLIPD_RUNTIME_DIR": str(folder / "run")},
            text=True,
        )
    with process:
        try:
            yield process
        finally:
            process.terminate()


def line(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline().strip()


def endpoints(daemon: subprocess.Popen[str]) -> tuple[str, str]:
    publish, requests = line(daemon), line(daemon)
    return publish.removeprefix("publish: "), requests.removeprefix("requests: ")


def insist(request: Callable[[], T]) -> T:
    """Repeat a request until it is granted, and return the reply: on a loaded machine requests come too late."""
    until_s = time.monotonic() + PATIENCE_S
    while True:
        try:
            return request()
        except ClientError:
            if time.monotonic() > until_s:
                raise
        time.sleep(0.05)


def move(client: GripClient, op: str, **fields: object) -> None:
    """Send a request under a lease until it is granted: leases run out on a loaded machine."""
    insist(lambda: (client.request("lease.acquire", ttl_ms=200), client.request(op, **fields)))


def wait_for_grip(publish: str) -> float:
    """Wait until the gripper reports that it holds something at rest; return the width, m."""
    until_s = time.monotonic() + PATIENCE_S
    with Subscriber(publish, topics=("gripper",)) as messages:
        while True:
            message = messages.receive(PATIENCE_S)
            assert message is not None
            found = message.raw
            if found["object"] == "contact_closing" and found["active"] and not found["moving"]:
                return float(found["width_m"])
            assert time.monotonic() < until_s, str(found)


def wait_for_event_after(t_ns: int, path: Path) -> None:
    """Wait until a recording that is being written holds an event after a time."""
    until_s = time.monotonic() + PATIENCE_S
    while list(open_recording(path).events())[-1][0] < t_ns:
        assert time.monotonic() < until_s
        time.sleep(0.1)


@pytest.mark.process
def test_a_daemon_that_aborts_and_is_started_again_finds_the_grip_and_leaves_a_whole_recording() -> None:
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        rig, first = folder / "demo.toml", folder / "first.mcap"
        text = config.shipped("demo.toml").read_text(encoding="utf-8")
        rig.write_text(text.replace('"virtual/', f'"{folder}/'), encoding="utf-8")
        line(stack.enter_context(part(folder, "slipd.tools.sim.virtual_gripper", "--dir", str(folder))))

        with part(folder, "slipd", "run", "--config", str(rig), "--record", str(first)) as daemon:
            publish, requests = endpoints(daemon)
            with GripClient(requests) as client:
                move(client, "gripper.activate", drop=True)
                move(client, "gripper.close", force_n=GRIP_N)
            width_m = wait_for_grip(publish)
            gripped_ns = time.monotonic_ns()
            wait_for_event_after(gripped_ns, first)
            aborted_ns = time.monotonic_ns()
            daemon.send_signal(signal.SIGABRT)
            assert daemon.wait(PATIENCE_S) == -signal.SIGABRT

        with part(folder, "slipd", "run", "--config", str(rig)) as daemon:
            publish, requests = endpoints(daemon)
            serves_ns = time.monotonic_ns()
            assert wait_for_grip(publish) == pytest.approx(width_m, abs=0.002)
            with GripClient(requests) as client:
                assert not insist(client.status)["lease"]["held"]
                boot = insist(client.hello)["boot"]
                insist(lambda: client.request("lease.acquire", ttl_ms=200))

            rig.write_text(rig.read_text(encoding="utf-8") + "\n# changed\n", encoding="utf-8")
            daemon.send_signal(signal.SIGHUP)  # P4: a reload is a new run, and moves nothing either
            publish, requests = endpoints(daemon)
            assert wait_for_grip(publish) == pytest.approx(width_m, abs=0.002)
            with GripClient(requests) as client:
                after = insist(client.status)
                assert insist(client.hello)["boot"] != boot
            assert not after["lease"]["held"]
        recording = open_recording(first)
        events = list(recording.events())
        assert "ends without an end record" in (recording.fault or "")
        assert recording.lost == 0
        live = list(open_recording(first).messages())
        replayed = [(topic, encode(body)) for topic, body in replay(open_recording(first))]
        print(f"serves {(serves_ns - aborted_ns) * 1e-9:.2f} s after, lost {(aborted_ns - events[-1][0]) * 1e-9:.3f} s")
        assert events[-1][0] >= gripped_ns
        assert replayed[: len(live)] == live
