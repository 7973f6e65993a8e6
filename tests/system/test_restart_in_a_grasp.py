"""A daemon is killed while each kind of gripper holds an object, and started again as systemd would do it."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

import pytest
from gripper_table import external_gripper_table, gripper_table
from own_address import free_port, own_host
from pushed_sensors import HELD, PADS, Sensors
from viewed_rig import FINGER

from slipd.tools.sim.emulate import emulated, emulator_for
from slipd_client.errors import ClientError
from slipd_client.grip import GripClient
from slipd_client.health.repairs import repairs
from slipd_client.messages.typed import Slip
from slipd_client.subscriber import Subscriber

pytestmark = pytest.mark.process

T = TypeVar("T")
PATIENCE_S = 60.0
GRIP_N = 10.0
KINDS = ("robotiq_2f", "wsg", "external_gripper")


class Hardware(threading.Thread):
    """An emulated gripper on its line, in this process, and the least force and the largest width since `watch`."""

    def __init__(self, device: str, address: str) -> None:
        super().__init__(daemon=True)
        self._name, self._address = device, address
        self.gripper: Any = emulator_for(device, address)
        self.gripper.set_part(0.04)
        self._ended = threading.Event()
        self.served = threading.Event()
        self.held_n = self.least_n = self.most_n = 0.0

    def watch(self) -> None:
        self.held_n = self.least_n = self.most_n = self.gripper.grip_n

    def run(self) -> None:
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        async with emulated([(self._name, self.gripper, self._address)], self._look) as emulation:
            running = asyncio.create_task(emulation.run())
            self.served.set()
            await asyncio.to_thread(self._ended.wait)
            running.cancel()

    def _look(self, _: int) -> None:
        grip_n = self.gripper.grip_n
        self.least_n, self.most_n = min(self.least_n, grip_n), max(self.most_n, grip_n)

    def end(self) -> None:
        self._ended.set()
        self.join(PATIENCE_S)


class Place:
    """A rig of one gripper and two fingers in a folder, and the daemons that are started on it."""

    def __init__(self, kind: str, folder: Path) -> None:
        self.folder = folder
        address = {
            "robotiq_2f": f"{folder}/gripper",
            "wsg": f"tcp://{own_host()}:{free_port()}",
            "external_gripper": f"unix://{folder}/gripper",
        }[kind]
        table = {
            "robotiq_2f": gripper_table(address),
            "wsg": f'[gripper]\ndevice = "wsg"\nport = "{address}"\nrate_hz = 50.0\nmax_force_n = 30.0\n',
            "external_gripper": external_gripper_table(folder),
        }[kind]
        self.file = folder / "rig.toml"
        self.file.write_text("".join(map(self._finger, PADS)) + table, encoding="utf-8")
        self.hardware = Hardware(kind, address)
        self.sensors = Sensors(f"ipc://{folder}/readings")

    def _finger(self, name: str) -> str:
        pad, words = PADS[name], {False: "false", True: "true"}
        return FINGER.format(
            name=name, folder=self.folder, mu="mu = 0.6", rows=pad.rows, cols=pad.cols,
            swap_xy=words[pad.swap_xy], flip_x=words[pad.flip_x],
        )  # fmt: skip

    @contextmanager
    def daemon(self, state: str) -> Iterator[tuple[subprocess.Popen[str], str, str]]:
        """Run a daemon; yield its process and endpoints."""
        environment = os.environ | {
            "SLIPD_RUNTIME_DIR": str(self.folder / "run"),
            "SLIPD_STATE_DIR": str(self.folder / state),
        }
        command = [sys.executable, "-m", "slipd", "run", "--config", str(self.file)]
        with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as child:
            try:
                assert child.stdout is not None
                publish, requests = (child.stdout.readline().partition(": ")[2].strip() for _ in range(2))
                yield child, publish, requests
            finally:
                child.kill()

    def is_kept(self) -> bool:
        """The run kept a grip of which the gripper reports the contact."""
        texts = (path.read_text() for path in (self.folder / "state").rglob("*") if path.is_file())
        return any('"grip":{' in text and '"object":"contact_closing"' in text for text in texts)


def until(holds: Callable[[], T]) -> T:
    """Wait for something that is true, on a machine that may be busy, and return it."""
    end_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < end_s:
        with suppress(ClientError):
            if found := holds():
                return found
        time.sleep(0.1)
    raise AssertionError("it never came")


def leased(client: GripClient, request: Callable[[], object]) -> bool:
    """Send a request with a lease; a WSG whose host died is in a fast stop, which is acknowledged first."""
    with client.lease():
        if client.status()["gripper"]["latched_fault"]:
            client.fault_ack()
        request()
    return True


@pytest.fixture(params=KINDS)
def place(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Place]:
    """A gripper that held an object when its daemon was killed."""
    place = Place(request.param, tmp_path)
    (tmp_path / "state").mkdir(mode=0o700)
    (tmp_path / "empty").mkdir(mode=0o700)
    with ExitStack() as stack:
        place.hardware.start()
        stack.callback(place.hardware.end)
        assert place.hardware.served.wait(PATIENCE_S)
        place.sensors.start()
        stack.callback(place.sensors.stop)
        child, _, requests = stack.enter_context(place.daemon("state"))
        with GripClient(requests) as client:
            until(lambda: client.status()["gripper"]["width_m"] is not None)
            for finger in PADS:
                until(lambda finger=finger: client.tare(finger, 0.2))
            until(lambda: leased(client, lambda: client.gripper_activate(drop=True)))
            until(lambda: client.status()["gripper"]["active"])
            until(lambda: leased(client, lambda: client.gripper_close(GRIP_N)))
            until(lambda: place.hardware.gripper.grip_n)
            place.sensors.contacts.update(HELD)
            until(lambda: client.status()["fingers"]["left"]["level"] == "stable")
            until(lambda: client.status()["gripper"]["object"] == "contact_closing")
            until(place.is_kept)
        place.hardware.watch()
        child.send_signal(signal.SIGKILL)
        child.wait(PATIENCE_S)
        yield place


def test_A10_P2_what_is_held_is_known_again_and_can_be_raised(place: Place) -> None:
    with place.daemon("state") as (_, publish, requests):
        served_s = time.monotonic()
        levels: dict[str, tuple[str, float]] = {}
        with Subscriber(publish, topics=("slip",), silence_s=PATIENCE_S) as messages:
            for message in messages:
                if isinstance(message, Slip) and message.level != "unknown":
                    levels.setdefault(message.finger, (message.level, time.monotonic() - served_s))
                if len(levels) == len(PADS):
                    break
        with GripClient(requests) as client:
            until(lambda: leased(client, lambda: client.grip_adjust(0.5)))
            raised_s = time.monotonic() - served_s
            until(lambda: place.hardware.gripper.grip_n > place.hardware.held_n + 0.3)
            first = [repair.id for repair in repairs(client.status())]
    print(f"levels {levels}, raised {raised_s:.2f} s after the daemon served")
    assert {level for level, _ in levels.values()} <= {"stable", "caution"}, "the load is what it was"
    assert "gripper-force-unknown" not in first
    assert place.hardware.least_n == place.hardware.held_n, "nothing opened or lowered it"
    assert place.hardware.most_n <= place.hardware.held_n + 0.6


@pytest.mark.parametrize("place", ["robotiq_2f"], indirect=True)
def test_A10_where_nothing_is_known_nothing_moves_and_status_says_so_first(place: Place) -> None:
    """Without the kept state no zero is known, so that the fingers measure nothing, and a Robotiq reports no force."""
    with place.daemon("empty") as (_, _, requests), GripClient(requests) as client:
        until(lambda: client.status()["gripper"]["object"] == "contact_closing")
        requests_for_force = (
            lambda: client.grip_adjust(0.5),
            lambda: client.gripper_close(3.0),
            lambda: client.gripper_close(GRIP_N),
        )
        codes = [until(lambda request=request: _code(client, request)) for request in requests_for_force]
        first = repairs(client.status())[0]
    assert codes == ["not_ready"] * len(codes)
    assert (first.id, first.command) == ("gripper-force-unknown", "slipctl grip open --drop")
    assert place.hardware.least_n == place.hardware.most_n == place.hardware.held_n


def _code(client: GripClient, request: Callable[[], object]) -> str:
    """Code of a refusal, once the request was judged in time."""
    try:
        leased(client, request)
    except ClientError as error:
        code = getattr(error, "code", "")
        return "" if code in ("deadline_passed", "no_lease", "lease_held", "busy") else code
    return "granted"
