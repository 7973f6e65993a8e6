"""A daemon, an emulated gripper and the server of the live view as processes; the readings are those of the test.

The sensors push their readings, at rates that a busy machine keeps up with.
"""

from __future__ import annotations

import contextlib
import subprocess
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from emulation_thread import emulation
from grasp_table import grasp_table
from gripper_table import external_gripper_table
from known_zeros import keep_zeros
from pushed_sensors import PADS, Contact, Sensors
from rig_parts import endpoints_of, first_line, part, wait_for

from slipd import config as configs
from slipd.tools.sim.emulators import make_emulator
from slipd_client.grip import GripClient
from slipd_client.keys import Keys, create, load
from slipd_client.subscriber import Subscriber

FINGER = """
[finger.{name}]
mu = 0.5
min_normal_n = 0.4

[finger.{name}.wrench]
device = "external"
port = "ipc://{folder}/readings"
sensor = "{name}.wrench"
rate_hz = 50.0
stale_s = 0.5
force_std_n = 0.02
torque_std_nm = 0.0005

[finger.{name}.pad]
device = "external"
port = "ipc://{folder}/readings"
sensor = "{name}.pad"
rate_hz = 50.0
stale_s = 0.5
rows = {rows}
cols = {cols}
swap_xy = {swap_xy}
flip_x = {flip_x}
pitch_m = 0.004
electrode_m = 0.003
axis_scale = [1.0]
threshold = 0.02
gain_error = 0.10
"""

BUS = """
[bus]
publish = "tcp://127.0.0.1:*"
requests = "tcp://127.0.0.1:*"
secret_key = "{keys}/daemon.key_secret"
readers = "{keys}/readers"
requesters = "{keys}/requesters"
"""


class ViewedRig:
    """The parts; ``with`` starts and ends them.

    Args:
        folder: For the files and sockets of the parts.
        without_mu: The finger whose coefficient of friction is not known; "" for none of them.
        keyed: The daemon serves TCP ports, for clients with keys: "requester", and "reader" that may only subscribe.

    Attributes:
        url: Address of the page.
        sensors: What the sensors send.
        daemon: The process of the first daemon.
        endpoints: Of the newest daemon.
        messages: Every message so far, by topic and number.
    """

    def __init__(self, folder: Path, *, without_mu: str = "", keyed: bool = False) -> None:
        self.messages: dict[tuple[str, int], dict[str, Any]] = {}
        self.url = ""
        self._folder = folder
        self._without_mu = without_mu
        self._bus = make_keys(folder) if keyed else ""
        self._ended = threading.Event()
        self.sensors = Sensors(f"ipc://{folder}/readings")

    def __enter__(self) -> ViewedRig:
        with contextlib.ExitStack() as stack:
            gripper = make_emulator("external_gripper")
            stack.enter_context(emulation([("external_gripper", gripper, f"unix://{self._folder}/gripper")]))
            self.daemon = stack.enter_context(self.start_daemon())
            self.url = stack.enter_context(self.view("requester"))
            listener = threading.Thread(target=self._listen, name="listener")
            listener.start()
            stack.callback(listener.join)
            stack.callback(self._ended.set)
            self.sensors.start()
            stack.callback(self.sensors.stop)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    @contextlib.contextmanager
    def start_daemon(self) -> Iterator[subprocess.Popen[str]]:
        """Start a daemon, which serves once this returns."""
        config = self._folder / "rig.toml"
        gripper = external_gripper_table(self._folder, step_n=5.0) + grasp_table(0.1)
        text = finger_tables(self._folder, without_mu=self._without_mu) + gripper + self._bus
        config.write_text(text, encoding="utf-8")
        keep_zeros(configs.load(config))
        with part(self._folder, "slipd", "run", "--config", str(config)) as process:
            self.endpoints = endpoints_of(process)
            yield process

    @contextlib.contextmanager
    def view(self, key: str) -> Iterator[str]:
        """Serve the live view to the holder of a key, and return its address."""
        endpoints = ("--publish", self.endpoints.publish, "--requests", self.endpoints.requests)
        keys = self._folder / "keys"
        secret = ("--key", f"{keys}/{key}.key_secret", "--server-key", f"{keys}/daemon.key") if self._bus else ()
        view = ("slipd_client.slipctl", *endpoints, *secret, "view", "--listen", "127.0.0.1:0")
        with part(self._folder, *view) as process:
            yield first_line(process).partition(": ")[2]

    def client(self) -> GripClient:
        """Return a client for requests."""
        return GripClient(self.endpoints.requests, keys=self._keys(), timeout_s=5.0)

    def _keys(self) -> Keys | None:
        keys = self._folder / "keys"
        return load(keys / "requester.key_secret", keys / "daemon.key") if self._bus else None

    def grip(self, force_n: float, contacts: dict[str, Contact | None]) -> None:
        """Close the gripper onto an object, which then presses on the fingers."""
        with self.client() as client:
            wait_for(lambda: leased(client, lambda: client.gripper_close(force_n)))
            wait_for(lambda: (client.status()["gripper"]["object"] or "").startswith("contact"))
        self.sensors.contacts = contacts

    def heard(self, topic: str) -> list[dict[str, Any]]:
        """Return every message of a topic so far."""
        return [body for (name, _), body in self.messages.copy().items() if name == topic]

    def _listen(self) -> None:
        with Subscriber(self.endpoints.publish, ("",), keys=self._keys()) as subscriber:
            while not self._ended.is_set():
                message = subscriber.receive(0.1)
                if message is not None:
                    self.messages[message.topic, message.seq] = message.raw


def make_keys(folder: Path) -> str:
    """Make the keys of the daemon and of two clients; return the part of the config that names them."""
    keys = folder / "keys"
    for name, lists in (("daemon", ()), ("requester", ("readers", "requesters")), ("reader", ("readers",))):
        public, _ = create(name, keys)
        for each in lists:
            (keys / each).mkdir(exist_ok=True)
            (keys / each / public.name).write_bytes(public.read_bytes())
    return BUS.format(keys=keys)


def finger_tables(folder: Path, *, without_mu: str = "") -> str:
    """The tables of both fingers, whose sensors push their readings to a socket in a folder."""
    tables = ""
    for name, pad in PADS.items():
        flags = {"swap_xy": str(pad.swap_xy).lower(), "flip_x": str(pad.flip_x).lower()}
        table = FINGER.format(name=name, folder=folder, rows=pad.rows, cols=pad.cols, **flags)
        tables += table.replace("mu = 0.5\n", "") if name == without_mu else table
    return tables


def leased(client: GripClient, request: Callable[[], object]) -> bool:
    """Send a request with a lease; a WSG whose host died is in a fast stop, which is acknowledged first."""
    with client.lease():
        if client.status()["gripper"]["latched_fault"]:
            client.fault_ack()
        request()
    return True
