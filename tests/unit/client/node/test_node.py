"""Another language takes part: programs of Node.js that know nothing but the protocol, and the daemon itself."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest
from gripper_table import gripper_table

from slipd_client.errors import NoAnswer
from slipd_client.grip import GripClient

HERE = Path(__file__).parent
PATIENCE_S = 60.0

RIG = """
[finger.left]
mu = 0.5

[finger.left.wrench]
device = "bota"
port = "{folder}/wrench"
rate_hz = 100.0
"""


def has_packages() -> bool:
    look = "import('./wire.mjs').catch(() => process.exit(1))"
    try:
        return subprocess.run(["node", "-e", look], cwd=HERE, capture_output=True, timeout=PATIENCE_S).returncode == 0
    except OSError:
        return False


if not has_packages():
    pytest.skip("Node.js with zeromq and @msgpack/msgpack is not installed", allow_module_level=True)


@contextmanager
def running(*command: str, folder: Path) -> Iterator[subprocess.Popen[str]]:
    environment = os.environ | {"SLIPD_RUNTIME_DIR": str(folder / "run")}
    with subprocess.Popen(
        [sys.executable, "-m", *command], env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            yield process
        finally:
            process.terminate()
            process.wait(PATIENCE_S)


@pytest.fixture(scope="module")
def endpoints(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, str]]:
    folder = tmp_path_factory.mktemp("node")
    gripper = gripper_table(f"{folder}/gripper", speed_table=[[0, 0.020], [255, 0.150]], min_force_n=3.0)
    (folder / "rig.toml").write_text(RIG.format(folder=folder) + gripper)
    with ExitStack() as stack:
        for device, place in (("bota", "wrench"), ("robotiq_2f", "gripper")):
            command = ("slipd.tools.sim.emulate", device, "--at", str(folder / place))
            line = stack.enter_context(running(*command, folder=folder)).stdout
            assert line is not None
            assert line.readline().strip() == str(folder / place)
        daemon = stack.enter_context(running("slipd", "run", "--config", str(folder / "rig.toml"), folder=folder))
        assert daemon.stdout is not None
        publish, requests = (daemon.stdout.readline().partition(": ")[2].strip() for _ in range(2))
        wait_for_gripper(requests)
        yield publish, requests


def wait_for_gripper(requests: str) -> None:
    until_s = time.monotonic() + PATIENCE_S
    with GripClient(requests) as client:
        while time.monotonic() < until_s:
            try:
                if client.status()["streams"]["gripper"]["health"] == 0:
                    return
            except NoAnswer:
                pass
            time.sleep(0.05)
    pytest.fail("the gripper does not answer")


def node(program: str, *arguments: str) -> list[dict[str, Any]]:
    done = subprocess.run(["node", str(HERE / program), *arguments], capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


def test_a_subscriber_in_javascript_hears_every_message_in_order(endpoints: tuple[str, str]) -> None:
    told = node("subscriber.mjs", endpoints[0], "slip.left", "50")
    seqs = [int(message["seq"]) for message in told]
    assert seqs == list(range(seqs[0], seqs[0] + 50))
    assert {(message["topic"], message["missed"], message["restarted"]) for message in told} == {
        ("slip.left", 0, False)
    }
    assert all(message["finger"] == "left" and message["level_code"] in range(6) for message in told)


def test_a_requester_in_javascript_takes_the_lease_and_moves_the_gripper(endpoints: tuple[str, str]) -> None:
    replies = node("requester.mjs", endpoints[1], "6")
    assert [(reply["op"], reply["ok"] or reply["error"]["code"]) for reply in replies] == [
        ("hello", True),
        ("grip.set", "no_lease"),
        ("lease.acquire", True),
        ("grip.set", "not_finite"),
        ("gripper.activate", True),
        ("gripper.close", True),
        ("lease.release", True),
    ]
    assert replies[-2]["result"]["applied_n"] == pytest.approx(6.0, abs=0.2)
