"""An engine on a rig of two fingers and a gripper, whose devices send real bytes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from gripper_registers import GripperLine
from known_zeros import know_zeros
from nanoseconds import MS, T0
from wire_check import faults_of

from slipd import config
from slipd.devices import bota
from slipd.devices.pvdf import encode_scan
from slipd.engine.engine import Engine
from slipd.events import (
    Bytes,
    Event,
    LinkDown,
    LinkUp,
    Output,
    Publish,
    Record,
    RecordingChanged,
    Reply,
    Request,
    Tick,
    Write,
)
from slipd.tools.sim.emulated_pads import encode_message
from slipd_client import messages

WALL_NS = 1_700_000_000_000_000_000
BOOT = "b00t"

LEFT = """
[finger.left]
mu = 0.5
min_normal_n = 0.5

[finger.left.wrench]
device = "bota"
port = "/dev/left-wrench"
rate_hz = 1000.0
force_std_n = 0.0
torque_std_nm = 0.0
stuck_after = 0

[finger.left.pad]
device = "pvdf"
port = "/dev/left-pad"
rate_hz = 100.0
rows = 4
cols = 4
pitch_m = 0.004
electrode_m = 0.002
axis_scale = [0.01]
threshold = 0.05
"""
RIGHT = """
[finger.right]
mu = 0.5
min_normal_n = 0.5
load_rule = "grey"

[finger.right.pad]
device = "xela"
port = "ws://127.0.0.1:5000"
sensor = "2"
rate_hz = 100.0
rows = 2
cols = 2
pitch_m = 0.004
electrode_m = 0.004
axis_scale = [0.001, 0.001, -0.001]
tare = [1000, 1000, 1000, 1000, 1000, 1000, 1000, 1000, 1000, 1000, 1000, 1000]
"""
GRIPPER = """
[gripper]
device = "robotiq_2f"
port = "/dev/gripper"
rate_hz = 50.0
force_table = [[0, 3.0], [255, 28.5]]
width_table = [[0.0, 0.085], [1.0, 0.0]]
speed_table = [[0, 0.02], [255, 0.15]]
max_force_n = 25.0
"""
RIG = LEFT + RIGHT + GRIPPER
MOVES: dict[str, dict[str, Any]] = {
    "grip.set": {"force_n": 5.0},
    "grip.adjust": {"delta_n": 0.5},
    "grip.hold": {},
    "gripper.close": {"force_n": 5.0},
    "gripper.open": {"drop": True},
    "gripper.stop": {},
    "gripper.activate": {"drop": True},
}
"""A valid request of every op that moves the gripper, or changes its force."""

FULL_IMAGE = np.full((4, 4), 100)
NO_IMAGE = np.zeros((4, 4), dtype=int)


def wrench_of(
    normal_n: float,
    tangential_n: Sequence[float] = (0.0, 0.0),
    spin_nm: float = 0.0,
    centroid_m: Sequence[float] = (0.0, 0.0),
) -> tuple[np.ndarray, np.ndarray]:
    """Return the force on the finger and the torque about the pad's origin: M = C × F + (0, 0, m)."""
    force = np.array((*tangential_n, -normal_n))
    return force, np.cross((*centroid_m, 0.0), force) + np.array((0.0, 0.0, spin_nm))


def refusal_of(reply: dict[str, Any]) -> tuple[str, str] | None:
    """Return the code and field of a refusal, or None if the request was granted."""
    assert set(reply) == {"v", "id", "t_ns", "ok", "result" if reply["ok"] else "error"}
    assert reply["v"] == 1
    if reply["ok"]:
        return None
    assert set(reply["error"]) == {"code", "message", "field"}
    assert reply["error"]["message"]
    return reply["error"]["code"], reply["error"]["field"]


class EngineRun:
    """A daemon, its clock, and ann, who may hold the lease; a subclass hears the outputs and serves the devices.

    Args:
        settings: Config.
        zeros: Whether the zeros of the sensors are known.
    """

    def __init__(self, settings: config.Config, *, zeros: bool = True) -> None:
        self.t_ns, self._asked = T0, 0
        self.begin(settings, zeros=zeros)

    def begin(self, settings: config.Config, *, zeros: bool = True) -> None:
        """Start a daemon."""
        self.engine = Engine(settings, boot=BOOT, wall_minus_monotonic_ns=WALL_NS)
        if zeros:
            know_zeros(*self.engine._fingers.values())
        self._renewed_ns: int | None = None

    def hear(self, output: Output, event: Event) -> None:
        """Note an output."""
        raise NotImplementedError

    def feed(self, event: Event) -> list[Output]:
        """Handle an event now."""
        outputs = self.engine.handle(event, self.t_ns)
        for output in outputs:
            self.hear(output, event)
        return outputs

    def wait(self, ms: float) -> None:
        self.t_ns += round(ms * MS)

    def tick(self, suspended_ns: int = 0) -> list[Output]:
        return self.feed(Tick(suspended_ns))

    def ask(self, op: str, client: bytes = b"ann", **fields: Any) -> dict[str, Any]:
        """Send a request now and return the reply.

        ``fields`` replace parts of a valid envelope; a field that is ``...`` is left out.
        """
        self._asked += 1
        envelope = {"v": 1, "id": self._asked, "op": op, "boot": BOOT, "deadline_ns": self.t_ns + 100 * MS}
        given = {name: value for name, value in (envelope | fields).items() if value is not ...}
        replies = [output for output in self.request(client, given) if isinstance(output, Reply)]
        assert [reply.client for reply in replies] == [client]
        return replies[0].body

    def request(self, client: bytes, body: dict[str, Any]) -> list[Output]:
        """Send a request."""
        return self.feed(Request(client, body))

    def refusal(self, op: str, client: bytes = b"ann", **fields: Any) -> tuple[str, str] | None:
        """Send a request; return the code and field of its refusal, or None if it was granted."""
        return refusal_of(self.ask(op, client, **fields))

    def code(self, op: str, client: bytes = b"ann", **fields: Any) -> str | None:
        """Send a request; return the code of its refusal, or None if it was granted."""
        refused = self.refusal(op, client, **fields)
        return refused and refused[0]

    def lease(self) -> None:
        """Take the lease for ann, who renews it while the gripper is served."""
        assert self.refusal("lease.acquire", ttl_ms=200) is None
        self._renewed_ns = self.t_ns

    def let_lease_be(self) -> None:
        """Let ann stop renewing the lease."""
        self._renewed_ns = None

    def renew_lease(self) -> None:
        """Renew the lease of ann, where that is due."""
        if self._renewed_ns is not None and self.t_ns - self._renewed_ns >= 50 * MS:
            self._renewed_ns = self.t_ns
            self.ask("lease.renew")


class Run(EngineRun):
    """One engine on the rig, and all its outputs."""

    def __init__(self, text: str, *, zeros: bool = True) -> None:
        super().__init__(config.parse(text, "rig.toml"), zeros=zeros)
        self.out: list[tuple[int, Output]] = []
        self.gripper = GripperLine()
        self.exact = False  # the right pad sends the same image again for the same contact
        self._scan = self._message = 0
        self._noise = False
        self._unheard = b""
        self.disk: Callable[[str], RecordingChanged] = lambda name: RecordingChanged(name, f"/state/{name}", "running")

    def hear(self, output: Output, event: Event) -> None:
        """Check that an output can be encoded."""
        self.out.append((self.t_ns, output))
        if isinstance(output, (Publish, Reply)):
            wire = messages.encode(output.body)
            assert messages.decode(wire, messages.MESSAGE_LIMITS) == output.body, "plain values, all finite"
            assert faults_of(output, event if isinstance(event, Request) else None) == []
        elif isinstance(output, Write) and output.link == "gripper":
            self._unheard += output.data

    def up(self, *links: str) -> None:
        for name in links or self.engine.links:
            self.feed(LinkUp(name, f"opened {name}"))

    def down(self, link: str) -> list[Output]:
        if link == "gripper":
            self._unheard = b""
        return self.feed(LinkDown(link, "unplugged"))

    def wrench(self, *contact: Any, status: int = 0, ms: float = 1.0, **more: Any) -> list[Output]:
        """Send a reading of the left force sensor, ``ms`` after the previous event."""
        self.wait(ms)
        force, torque = wrench_of(*contact, **more)
        self._noise = not self._noise  # a reading that repeats bit for bit is suspect
        if self._noise and not torque[2]:
            torque[2] = 1e-20
        return self.feed(Bytes("left.wrench", bota.encode_frame(force, torque, self.t_ns // 1000, status=status)))

    def image(self, counts: np.ndarray = FULL_IMAGE) -> list[Output]:
        """Send a scan of the left pad now."""
        self._scan += 1
        return self.feed(Bytes("left.pad", encode_scan(counts, self._scan, self.t_ns / 1000, 5.0)))

    def skin(self, *contact: Any, ms: float = 10.0, **more: Any) -> list[Output]:
        """Send a message of the right pad: the contact's force in equal parts on its four taxels."""
        self.wait(ms)
        self._message += 1
        force, _ = wrench_of(*contact, **more)
        counts = np.tile(1000 + np.round(force * (1000, 1000, -1000) / 4), (4, 1)).astype(int)
        if self._message % 2 == 0 and not self.exact:
            counts[:, 2] += (1, -1, 1, -1)  # with the same sum: a repeated image is suspect
        return self.feed(Bytes("right.pad", encode_message(self._message, {"2": counts}, 1.7e9)))

    def request(self, client: bytes, body: dict[str, Any]) -> list[Output]:
        """Send a request; if it begins a recording, also the answer of the disk."""
        outputs = super().request(client, body)
        for record in [output for output in outputs if isinstance(output, Record) and output.name]:
            outputs += self.feed(self.disk(record.name))
        return outputs

    def bring_up(self, *, tare: bool = True) -> None:
        """Bring up free, tared fingers and an active gripper whose lease ann holds."""
        for _ in range(3):
            self.image(NO_IMAGE)
            self.wrench(0.0)
            self.skin(0.0)
        if tare:
            self.ask("tare", finger="left", seconds=0.01)
            for _ in range(20):
                self.wrench(0.0)
        self.lease()
        self.serve_gripper(50)
        assert self.refusal("gripper.activate", drop=True) is None
        self.serve_gripper(100)
        self.feel(0.0)
        self.writes()

    def feel(self, normal_n: float) -> None:
        """Send fresh readings of both fingers; the image varies, since a constant one counts as frozen."""
        self.image(np.full((4, 4), 100 + self.t_ns // MS % 7) if normal_n else NO_IMAGE)
        self.skin(normal_n, ms=1.0)
        self.wrench(normal_n)

    def grip(self, force_n: float = 5.0) -> None:
        """Close the gripper with a force on an object, which both fingers feel."""
        assert self.refusal("gripper.close", force_n=force_n) is None
        self.serve_gripper(50)
        self.gripper.found = 2
        self.serve_gripper(50)
        self.feel(force_n)
        self.writes()

    def writes(self) -> list[tuple[int, ...]]:
        """Return the registers that were written since the last call."""
        done, self.gripper.writes = self.gripper.writes, []
        return done

    def published(self, topic: str) -> list[dict[str, Any]]:
        """Return the bodies of all messages of a topic so far."""
        return [output.body for _, output in self.out if isinstance(output, Publish) and output.topic == topic]

    def level(self, finger: str = "left") -> tuple[str, list[str]]:
        """Return the level and reasons of the newest verdict."""
        body = self.published(f"slip.{finger}")[-1]
        return body["level"], body["reasons"]

    def serve_gripper(self, ms: float) -> None:
        """Let time pass in ticks of 5 ms while the gripper answers what is written to it."""
        for _ in range(round(ms / 5)):
            self.wait(5)
            self.tick()
            self.renew_lease()
            heard, self._unheard = self._unheard, b""
            answer = self.gripper.answer(heard)
            if answer:
                self.feed(Bytes("gripper", answer))
