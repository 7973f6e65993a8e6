"""A daemon is killed while each kind of gripper holds an object, and started again as systemd would do it."""

from __future__ import annotations

import signal
import subprocess
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest
from emulation_thread import emulation
from gripper_table import external_gripper_table, gripper_table
from own_address import free_port, own_host
from pushed_sensors import HELD, PADS, Sensors
from rig_parts import PATIENCE_S, endpoints_of, part, wait_for
from viewed_rig import finger_tables, leased

from slipd.service_run import Endpoints
from slipd.tools.sim.emulators import make_emulator
from slipd_client.errors import ClientError
from slipd_client.grip import GripClient
from slipd_client.messages.typed import Slip
from slipd_client.repairs import repairs
from slipd_client.subscriber import Subscriber

pytestmark = pytest.mark.process

GRIP_N = 10.0
KINDS = ("robotiq_2f", "wsg", pytest.param("external_gripper", marks=pytest.mark.long))
WSG = '[gripper]\ndevice = "wsg"\nport = "{}"\nrate_hz = 50.0\nmax_force_n = 30.0\n'


class Place:
    """A rig of one gripper and two fingers in a folder, and the daemons that are started on it.

    Attributes:
        gripper: The emulated gripper.
        address: Of its line.
        forces_n: Every force of its grip so far.
    """

    def __init__(self, kind: str, folder: Path) -> None:
        self._folder = folder
        wsg = f"tcp://{own_host()}:{free_port()}"
        self.address, table = {
            "robotiq_2f": (f"{folder}/gripper", gripper_table(f"{folder}/gripper")),
            "wsg": (wsg, WSG.format(wsg)),
            "external_gripper": (f"unix://{folder}/gripper", external_gripper_table(folder)),
        }[kind]
        self.file = folder / "rig.toml"
        self.file.write_text(finger_tables(folder) + table, encoding="utf-8")
        self.gripper: Any = make_emulator(kind)
        self.gripper.part_m = 0.04
        self.forces_n: list[float] = []
        self.sensors = Sensors(f"ipc://{folder}/readings")

    @contextmanager
    def daemon(self, state: str) -> Iterator[tuple[subprocess.Popen[str], Endpoints]]:
        """Run a daemon with a state folder, and kill it."""
        (self._folder / state).mkdir(mode=0o700, exist_ok=True)
        folder = str(self._folder / state)
        with part(self._folder, "slipd", "run", "--config", str(self.file), SLIPD_STATE_DIR=folder) as process:
            yield process, endpoints_of(process)
            process.send_signal(signal.SIGKILL)
            process.wait(PATIENCE_S)

    def is_kept(self) -> bool:
        """The run kept a grip of which the gripper reports the contact."""
        texts = (path.read_text() for path in (self._folder / "state").rglob("*") if path.is_file())
        return any('"grip":{' in text and '"object":"contact_closing"' in text for text in texts)


@pytest.fixture(scope="module", params=KINDS)
def place(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    """A gripper that held an object when its daemon was killed."""
    place = Place(request.param, tmp_path_factory.mktemp(request.param))
    devices = [(request.param, place.gripper, place.address)]
    with ExitStack() as stack:
        stack.enter_context(emulation(devices, lambda _: place.forces_n.append(place.gripper.grip_n)))
        place.sensors.start()
        stack.callback(place.sensors.stop)
        with place.daemon("state") as (_, endpoints), GripClient(endpoints.requests) as client:
            for finger in PADS:
                wait_for(lambda finger=finger: client.tare(finger, 0.1))
            wait_for(lambda: leased(client, lambda: client.gripper_activate(drop=True)))
            wait_for(lambda: client.status()["gripper"]["active"])
            wait_for(lambda: leased(client, lambda: client.gripper_close(GRIP_N)))
            wait_for(lambda: place.gripper.grip_n)
            place.sensors.contacts.update(HELD)
            wait_for(lambda: client.status()["fingers"]["left"]["level"] == "stable")
            wait_for(place.is_kept)
            place.forces_n = [place.gripper.grip_n]
        yield place


def first_verdicts(publish: str) -> set[tuple[str, tuple[str, ...], str | None]]:
    """Return level, reasons and origin of the zero of the first verdict on each finger whose readings are fresh."""
    found: dict[str, Slip] = {}
    with Subscriber(publish, topics=("slip",), silence_s=PATIENCE_S) as messages:
        for message in messages:
            if isinstance(message, Slip) and "stale" not in message.reasons:
                found.setdefault(message.finger, message)
            if len(found) == len(PADS):
                break
    return {(str(each.level), each.reasons, each.tare_origin) for each in found.values()}


@pytest.mark.parametrize("place", ["robotiq_2f"], indirect=True)
def test_A10_F6_where_nothing_is_known_nothing_moves_and_status_says_so_first(place: Place) -> None:
    """Without the kept state no zero is known, so that the fingers measure nothing, and a Robotiq reports no force."""
    with place.daemon("empty") as (_, endpoints), GripClient(endpoints.requests) as client:
        wait_for(lambda: client.status()["gripper"]["object"] == "contact_closing")
        assert wait_for(lambda: code(client, lambda: client.grip_adjust(0.5))) == "not_ready"
        assert wait_for(lambda: code(client, lambda: client.gripper_close(GRIP_N))) == "not_ready"
        status = wait_for(client.status)
        assert first_verdicts(endpoints.publish) == {("unknown", ("not_tared",), None)}
    first = repairs(status)[0]
    assert (first.id, first.command) == ("gripper-force-unknown", "slipctl grip open --drop")
    assert set(place.forces_n) == {place.forces_n[0]}


def test_A10_F6_P2_P4_what_is_held_is_known_again_and_can_be_raised_and_a_reload_moves_nothing(place: Place) -> None:
    held_n = place.forces_n[0]
    with place.daemon("state") as (daemon, endpoints):
        verdicts = first_verdicts(endpoints.publish)
        with GripClient(endpoints.requests) as client:
            assert not wait_for(client.status)["lease"]["held"]
            wait_for(lambda: leased(client, lambda: client.grip_adjust(0.5)))
            wait_for(lambda: place.gripper.grip_n > held_n + 0.3)
            advised = [repair.id for repair in repairs(client.status())]
            boot = wait_for(client.hello)["boot"]
            place.file.write_text(place.file.read_text(encoding="utf-8") + "\n# changed\n", encoding="utf-8")
            set_n: list[float | None] = []
            wait_for(lambda: leased(client, lambda: set_n.append(client.grip_adjust(0.25).applied_n)))
        daemon.send_signal(signal.SIGHUP)  # at once: the newest force is kept all the same
        with GripClient(endpoints_of(daemon).requests) as client:
            assert wait_for(client.hello)["boot"] != boot
            assert not wait_for(client.status)["lease"]["held"]
            wait_for(lambda: client.status()["gripper"]["object"] == "contact_closing")
            wait_for(lambda: leased(client, lambda: set_n.append(client.grip_hold().force_n)))
    assert {(level, origin) for level, _, origin in verdicts} <= {("stable", "stored"), ("caution", "stored")}
    assert "gripper-force-unknown" not in advised
    assert min(place.forces_n) == held_n, "nothing opened or lowered it"
    assert max(place.forces_n) <= held_n + 0.85
    assert set_n[0] == pytest.approx(set_n[1], abs=0.01)


def code(client: GripClient, request: Callable[[], object]) -> str:
    """Code of a refusal, once the request was judged in time."""
    try:
        leased(client, request)
    except ClientError as error:
        refusal = getattr(error, "code", "")
        return "" if refusal in ("deadline_passed", "no_lease", "lease_held", "busy") else refusal
    return "granted"
