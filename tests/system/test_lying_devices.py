"""Real processes: a daemon with lying sensors raises no grip, and reports which sensor lies."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
import pytest
import zmq
from gripper_table import external_gripper_table

from slipd_client.errors import ClientError, LeaseLost, NoAnswer, RequestRefused
from slipd_client.grip import GripClient
from slipd_client.messages.typed import Tactile
from slipd_client.subscriber import Subscriber

pytestmark = pytest.mark.process

PATIENCE_S = 60.0
BUSY = ("deadline_passed", "deadline_too_far", "no_lease", "lease_held", "gripper_fault")
"""Codes of refusals on a busy machine, where requests come late, leases end, and grippers fall silent."""

RIG = """
[finger.left]
mu = 0.5
min_normal_n = 0.4

[finger.left.wrench]
device = "external"
port = "ipc://{folder}/readings"
sensor = "left.wrench"
rate_hz = 200.0
range_n = 80.0

[finger.left.pad]
device = "external"
port = "ipc://{folder}/readings"
sensor = "left.pad"
rate_hz = 100.0
rows = 4
cols = 4
pitch_m = 0.004
electrode_m = 0.003
axis_scale = [1.0]
threshold = 0.02
"""


def truth(force: np.ndarray, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return force, image


class Pusher(threading.Thread):
    """The program that reads the sensors: it pushes true or false readings at 200 and 100 Hz.

    Args:
        endpoint: Socket of the daemon for readings.

    Attributes:
        normal_n: True normal force, N.
        lie: Maps the true force, shape (3,), and image, shape (16,), to the pushed ones.
    """

    def __init__(self, endpoint: str) -> None:
        super().__init__(daemon=True)
        self._endpoint = endpoint
        self._ended = threading.Event()
        self._rng = np.random.default_rng(1)
        self.normal_n = 0.0
        self.lie = truth

    def run(self) -> None:
        with zmq.Context() as context, context.socket(zmq.PUSH) as socket:
            socket.linger = 0
            socket.sndhwm = 10
            socket.connect(self._endpoint)
            count = 0
            while not self._ended.wait(0.005):
                count += 1
                noise = self._rng.normal(size=22)
                force = np.array((0.3, 0.0, -self.normal_n)) + 0.01 * noise[:3]
                image = np.maximum(self.normal_n / 16 + 0.001 * noise[6:], 0.0) * (self.normal_n > 0.0)
                force, image = self.lie(force, image)
                torque = np.zeros(3) if self.lie is frozen else 1e-4 * noise[3:6]
                with suppress(zmq.Again):
                    self._push(socket, "left.wrench", force_n=force.tolist(), torque_nm=torque.tolist())
                    if count % 2:
                        self._push(socket, "left.pad", values=image.tolist())

    def _push(self, socket: zmq.Socket[bytes], stream: str, **body: list[float]) -> None:
        socket.send(msgpack.packb({"stream": stream, "t_ns": time.monotonic_ns(), **body}), zmq.DONTWAIT)

    def end(self) -> None:
        self._ended.set()
        self.join()


def frozen(_: np.ndarray, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.array((0.3, 0.0, -5.0)), image


def blind(force: np.ndarray, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    image[5] = np.nan
    return force, image


def pulled(force: np.ndarray, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return force * (1.0, 1.0, -5.0), image


def absurd(force: np.ndarray, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.array((0.0, 0.0, 3e38)) + force, image


class Hand:
    """A daemon, the program that pushes its readings, and the client that holds the gripper."""

    def __init__(self, client: GripClient, pusher: Pusher) -> None:
        self.client, self.pusher = client, pusher

    def finger(self) -> tuple[str, list[str]]:
        told = self.client.status()["fingers"]["left"]
        return told["level"], told["reasons"]

    def message(self, stream: str) -> str:
        told: str = self.client.status()["streams"][stream]["message"]
        return told

    def samples(self) -> int:
        streams = self.client.status()["streams"]
        return min(streams["left.wrench"]["samples"], streams["left.pad"]["samples"])

    def begin(self, lie: Callable[..., Any]) -> None:
        """Return when the daemon has received several false readings."""
        self.pusher.lie = lie
        seen: list[int] = []
        until(lambda: seen.append(self.samples()) or seen[-1] > seen[0] + 5)

    def raises(self) -> str:
        """Return the code with which a raise by 0.1 N is refused; "" if it is granted, "busy" if it is not judged."""
        return self._asks(lambda: self.client.grip_adjust(0.1))

    def refused(self, request: Callable[[], object]) -> str:
        """Return the code with which a request is refused, once the machine has time for it; "" if it is granted."""
        codes: list[str] = []
        until(lambda: (codes.append(self._asks(request)), codes[-1] != "busy")[1])
        return codes[-1]

    def _asks(self, request: Callable[[], object]) -> str:
        """On a busy machine leases end and grippers fall silent: each request takes a lease and acknowledges faults."""
        try:
            with self.client.lease():
                if self.client.status()["gripper"]["latched_fault"]:
                    self.client.fault_ack()
                request()
        except RequestRefused as refusal:
            return "busy" if refusal.code in BUSY else refusal.code
        except (NoAnswer, LeaseLost):
            return "busy"
        return ""


def until(holds: Callable[[], bool]) -> None:
    """Wait for a condition, on a machine that may be busy."""
    end_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < end_s:
        with suppress(ClientError):
            if holds():
                return
        time.sleep(0.08)
    raise AssertionError("it never came")


def leased(client: GripClient, request: Callable[[], object]) -> bool:
    """Send a request with a lease; return True if it is granted, and raise otherwise."""
    with client.lease():
        request()
    return True


@contextmanager
def process(*arguments: str, folder: Path) -> Iterator[subprocess.Popen[str]]:
    environment = os.environ | {"SLIPD_RUNTIME_DIR": str(folder / "run")}
    command = [sys.executable, "-m", *arguments]
    with subprocess.Popen(command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as child:
        try:
            yield child
        finally:
            child.terminate()
            child.wait(PATIENCE_S)


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[GripClient, Pusher, str]]:
    """A daemon with tared sensors and an active gripper, and its publish endpoint."""
    folder = tmp_path_factory.mktemp("lying")
    file = folder / "rig.toml"
    gripper = external_gripper_table(folder, raise_n_per_s=1000.0, lower_n_per_s=1000.0)
    file.write_text(RIG.format(folder=folder) + gripper, encoding="utf-8")
    with ExitStack() as stack:
        daemon = stack.enter_context(process("slipd", "run", "--config", str(file), folder=folder))
        assert daemon.stdout is not None
        publish, requests = (daemon.stdout.readline().partition(": ")[2].strip() for _ in range(2))
        gripper = ("slipd.tools.sim.emulate", "external_gripper", "--at", f"unix://{folder}/gripper")
        stack.enter_context(process(*gripper, folder=folder))
        pusher = Pusher(f"ipc://{folder}/readings")
        pusher.start()
        stack.callback(pusher.end)
        client = stack.enter_context(GripClient(requests))
        until(lambda: client.status()["gripper"]["width_m"] is not None)
        until(lambda: client.tare("left", "all", 0.2)["verified"] is not None)
        until(lambda: leased(client, lambda: client.gripper_activate(drop=True)))
        until(lambda: bool(client.status()["gripper"]["active"]))
        until(lambda: leased(client, lambda: client.gripper_close(5.0)))
        yield client, pusher, publish


@pytest.fixture
def hand(rig: tuple[GripClient, Pusher, str]) -> Hand:
    """The gripper holds something; force sensor and pad are truthful."""
    client, pusher, _ = rig
    pusher.lie, pusher.normal_n = truth, 5.0
    hand = Hand(client, pusher)
    until(lambda: hand.finger()[0] == "stable")
    until(lambda: hand.raises() == "")
    return hand


@pytest.mark.parametrize(
    ("lie", "reasons", "stream", "word"),
    [
        (frozen, ["stuck"], "left.wrench", "repeat"),
        (blind, ["rotation_unobserved"], "left.pad", "not finite"),
        (pulled, ["pulled"], "left.wrench", "pad_from_sensor"),
        (absurd, ["garbage"], "left.wrench", "range_n"),
    ],
)
def test_F1_a_sensor_that_lies_raises_no_grip(
    hand: Hand, lie: Callable[..., Any], reasons: list[str], stream: str, word: str
) -> None:
    hand.begin(lie)
    refusals: list[str] = []
    until(lambda: (refusals.append(hand.raises()), len(refusals) >= 12 and "not_ready" in refusals)[1])
    assert "" not in refusals
    until(lambda: hand.finger() == ("unknown", reasons))
    until(lambda: word in hand.message(stream))
    hand.begin(truth)
    until(lambda: hand.finger()[0] == "stable")
    until(lambda: hand.raises() == "")


def test_a_pull_is_neither_tared_nor_opened(hand: Hand) -> None:
    hand.begin(lambda force, image: (force * (1.0, 1.0, -5.0), 0.0 * image))
    until(lambda: hand.finger() == ("unknown", ["pulled"]))
    assert hand.refused(lambda: hand.client.tare("left", 0.2)) in ("not_ready", "in_contact")
    assert hand.refused(hand.client.gripper_open) == "in_contact"


def test_an_image_says_why_it_cannot_be_used_and_when_it_can_again(
    hand: Hand, rig: tuple[GripClient, Pusher, str]
) -> None:
    with Subscriber(rig[2], topics=("tactile",), silence_s=PATIENCE_S) as messages:

        def hears(ok: bool, reason: str) -> bool:
            images = (message for message in messages if isinstance(message, Tactile))
            return any(image.image_ok is ok and (not reason or reason in image.image_reasons) for image in images)

        assert hears(True, "")
        hand.begin(blind)
        assert hears(False, "not_finite")
        hand.begin(truth)
        assert hears(True, "")
