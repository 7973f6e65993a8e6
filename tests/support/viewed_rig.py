"""The virtual gripper, a daemon and the server of the live view as processes, and a robot program that grips."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from slipd import config
from slipd_client.errors import ClientError
from slipd_client.grip import GripClient
from slipd_client.subscriber import Subscriber

PATIENCE_S = 60.0
SEEN_POLLS = 100


class ViewedRig:
    """The parts, each a process; ``with`` starts and ends them.

    Attributes:
        url: Address of the page.
        gripper: The process of the virtual gripper.
        daemon: The process of the first daemon.
        messages: Every message since the start, by topic and number, of the newest run of the daemon.
    """

    def __init__(self, folder: Path, edit: Callable[[str], str] = lambda text: text) -> None:
        self.messages: dict[tuple[str, int], dict[str, Any]] = {}
        self.url = ""
        self._folder = folder
        self._environment = os.environ | {"SLIPD_RUNTIME_DIR": str(folder / "run")}
        self._publish, self._requests = f"ipc://{folder}/run/publish", f"ipc://{folder}/run/requests"
        self._config = folder / "rig.toml"
        text = config.shipped("demo.toml").read_text(encoding="utf-8")
        self._config.write_text(edit(text.replace('"virtual/', f'"{folder}/')), encoding="utf-8")
        self._ended = threading.Event()

    def __enter__(self) -> ViewedRig:
        with contextlib.ExitStack() as stack:
            gripper, _ = self._part("slipd.sim.virtual_gripper", "--dir", str(self._folder))
            self.gripper = stack.enter_context(gripper)
            self.daemon = stack.enter_context(self.start_daemon())
            endpoints = ("--publish", self._publish, "--requests", self._requests)
            arguments = (*endpoints, "view", "--listen", "127.0.0.1:0")
            view, line = self._part("slipd_client.slipctl", *arguments)
            stack.enter_context(view)
            self.url = line.partition(": ")[2]
            listener = threading.Thread(target=self._listen, name="listener")
            listener.start()
            stack.callback(listener.join)
            stack.callback(self._ended.set)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    @contextlib.contextmanager
    def start_daemon(self) -> Iterator[subprocess.Popen[str]]:
        """Start a daemon, which serves once this returns."""
        part, _ = self._part("slipd", "run", "--config", str(self._config))
        with part as process:
            yield process

    def client(self) -> GripClient:
        """Return a client for requests."""
        return GripClient(self._requests, timeout_s=5.0)

    def grip(self, force_n: float) -> None:
        """Tare both fingers, activate the gripper, and close it onto the object."""
        with self.client() as client:
            for finger in ("left", "right"):
                self.wait(lambda finger=finger: client.tare(finger, 0.2))
            self.wait(lambda: _with_lease(client, client.gripper_activate))
            self.wait(lambda: client.status()["gripper"]["active"])
            self.wait(lambda: _with_lease(client, client.gripper_close, force_n, speed_mps=0.1))
            self.wait(lambda: (client.status()["gripper"]["object"] or "").startswith("contact"))

    def seen(self, finger: str) -> bool:
        """Return whether the contact is known with its image: one that lost bytes cannot be used until the next grasp."""
        for _ in range(SEEN_POLLS):
            if self.newest(f"slip.{finger}").get("pole_m"):
                return True
            time.sleep(0.1)
        return False

    def newest(self, topic: str) -> dict[str, Any]:
        """Return the newest message of a topic, or an empty map."""
        return max((body for (name, _), body in list(self.messages.items()) if name == topic), key=_seq, default={})

    def wait(self, condition: Callable[[], Any]) -> Any:
        """Wait until a condition holds, and return its value; a request that fails is tried again."""
        until_s = time.monotonic() + PATIENCE_S
        while True:
            error: Exception | None = None
            try:
                if found := condition():
                    return found
            except ClientError as failed:
                error = failed
            assert time.monotonic() < until_s, f"the condition never held: {error}"
            time.sleep(0.02)

    def _listen(self) -> None:
        with Subscriber(self._publish, ("",)) as subscriber:
            while not self._ended.is_set():
                message = subscriber.receive(0.1)
                if message is not None:
                    self.messages[message.topic, message.seq] = message.raw

    def _part(self, name: str, *arguments: str) -> tuple[contextlib.AbstractContextManager[Any], str]:
        """Start a part; return it, to be ended, and the first line that it prints."""
        process = subprocess.Popen(
            [sys.executable, "-m", name, *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=self._environment,
        )
        assert process.stdout is not None
        line = process.stdout.readline().strip()
        assert line, f"{name} ended at its start"
        return _ending(process), line


@contextlib.contextmanager
def _ending(process: subprocess.Popen[str]) -> Iterator[subprocess.Popen[str]]:
    with process:
        try:
            yield process
        finally:
            process.terminate()
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()


def _seq(body: dict[str, Any]) -> int:
    return int(body["seq"])


def _with_lease(client: GripClient, request: Callable[..., Any], *arguments: Any, **more: Any) -> bool:
    with client.lease():
        request(*arguments, **more)
    return True
