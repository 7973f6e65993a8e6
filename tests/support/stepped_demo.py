"""The scenes of the demo with their own robot program, in simulated time: its waits let the time pass."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import pytest
from wire_check import faults_of

from slipd import config
from slipd.engine.engine import Engine
from slipd.events import Bytes, Event, LinkUp, Publish, Reply, Request, Tick, Write
from slipd.recording.mcap_file import EVENTS, RecordingFile, RunHead
from slipd.tools.demo_summary import Tally
from slipd.tools.sim import carry, robot_program
from slipd.tools.sim.robot_program import RobotProgram
from slipd.tools.sim.virtual_gripper import LINES, TICK_NS, VirtualRig
from slipd_client.messages import encode
from slipd_client.messages.codec import typed_message

BOOT, WALL_NS = "b", 1_790_000_000_000_000_000
RENEW_TICKS = 80
PAD_HZ = 25.0
SLOW = (
    ("rate_hz = 200.0", f"rate_hz = {PAD_HZ}"),
    ("rate_hz = 800.0", "rate_hz = 200.0\noptions = { sinc_length = 256 }"),
    ("virtual/", "/run/rig/"),
)
RATES = "\n[rates]\nslip_hz = 20.0\nwrench_hz = 5.0\ntactile_hz = 5.0\ngrasp_hz = 4.0\nstatus_hz = 1.0\n"


def slow_config(text: str, *changes: tuple[str, str]) -> str:
    """Return a config of the demo with slow devices, and with changes."""
    for old, new in (*SLOW, *changes):
        text = text.replace(old, new)
    return text + RATES


def recording_of(path: Any, text: str) -> RecordingFile:
    """Return a file for the events of a run."""
    return RecordingFile(path, RunHead(text, BOOT, WALL_NS))


@dataclass
class SteppedDemo:
    """The virtual gripper and the engine, and a subscriber and a client whose waits let the simulated time pass.

    Attributes:
        rig: The virtual gripper.
        text: Config of the engine.
        file: Where the events are recorded; None: nowhere.
        with_messages: Whether the messages are recorded too.
    """

    rig: VirtualRig
    text: str
    file: RecordingFile | None = None
    with_messages: bool = True
    tally: Tally = field(default_factory=Tally)
    inbox: deque[Any] = field(default_factory=deque)
    now_ns: int = 0
    heard_ns: dict[int, int] = field(default_factory=dict)
    events: int = 0
    asked: int = 0
    leased: bool = False
    opened: bool = False

    def __post_init__(self) -> None:
        self.engine = Engine(config.parse(self.text, "demo.toml"), boot=BOOT, wall_minus_monotonic_ns=WALL_NS)
        self.unread = dict.fromkeys(LINES, b"")

    def feed(self, event: Event) -> dict[str, Any] | None:
        """Give the engine an event, and the devices what it writes; return its reply."""
        reply = None
        if self.file is not None:
            self.file.add(self.events, self.now_ns, EVENTS, event)
            self.events += 1
        for output in self.engine.handle(event, self.now_ns):
            assert faults_of(output, event if isinstance(event, Request) else None) == []
            if isinstance(output, Write):
                line = output.link.replace(".", "-")
                self.unread[line] += b"".join(self.rig.devices[line].receive(output.data, self.now_ns))
            elif isinstance(output, Reply):
                reply = output.body
            elif isinstance(output, Publish):
                self.hear(output.topic, output.body)
        return reply

    def hear(self, topic: str, body: dict[str, Any]) -> None:
        """Record a message, and keep it for the program."""
        if self.file is not None and self.with_messages:
            self.file.add(self.events, self.now_ns, topic, encode(body))
            self.events += 1
        message = typed_message(topic, body)
        self.tally.add(message)
        if topic.startswith(("slip", "warning")):
            self.inbox.append(message)
        if topic.startswith("warning"):
            self.heard_ns[message.seq] = self.now_ns

    def ask(self, op: str, **fields: Any) -> dict[str, Any]:
        """Return the result of a request, which must be granted."""
        self.asked += 1
        envelope = {"v": 1, "id": self.asked, "op": op, "boot": BOOT, "deadline_ns": self.now_ns + 10**8}
        reply = self.feed(Request(b"operator", envelope | fields))
        assert reply is not None
        assert reply["ok"], reply
        return dict(reply["result"])

    def tick(self) -> None:
        """Let one period of the fastest sensor pass."""
        self.now_ns += TICK_NS
        said = self.rig.advance(self.now_ns)
        for line in LINES:
            data, self.unread[line] = self.unread[line] + said[line], b""
            if data:
                self.feed(Bytes(line.replace("-", "."), data))
        if reading := self.rig.arm_reading(self.now_ns):
            self.feed(Bytes("arm", reading))
        if self.now_ns % (4 * TICK_NS) == 0:
            self.feed(Tick())

    def pass_time(self, seconds: float) -> bool:
        """Let time pass; return that nothing ended it."""
        end_ns = self.now_ns + round(seconds * 1e9)
        while self.now_ns < end_ns:
            self.tick()
            if self.leased and self.now_ns % (RENEW_TICKS * TICK_NS) == 0:
                self.ask("lease.renew")
        return False

    def receive(self, timeout_s: float) -> Any:
        """Return the next message, as a subscriber does."""
        end_ns = self.now_ns + round(timeout_s * 1e9)
        while not self.inbox and self.now_ns < end_ns:
            self.pass_time(TICK_NS * 1e-9)
        return self.inbox.popleft() if self.inbox else None

    @contextmanager
    def lease(self, ttl_ms: int) -> Iterator[None]:
        """Hold the lease."""
        self.ask("lease.acquire", ttl_ms=ttl_ms)
        self.leased = True
        yield
        self.leased = False
        self.ask("lease.release")

    def tare(self, finger: str, seconds: float) -> dict[str, Any]:
        """Take a zero, and wait for it."""
        taken = self.ask("tare", finger=finger, seconds=seconds)
        self.pass_time(2.0 * seconds)
        return taken

    def __getattr__(self, op: str) -> Any:
        """Return the method of the client that sends an operation, such as ``gripper_close``."""
        if not op.startswith(("gripper_", "grip_", "hello", "status", "motion_", "object_")):
            raise AttributeError(op)
        places = {
            "gripper_close": ("force_n",),
            "grip_set": ("force_n",),
            "motion_check": ("points",),
            "object_set": ("name",),
        }.get(op, ())
        return lambda *values, **fields: self.ask(
            op.replace("_", "."), **dict(zip(places, values, strict=True)), **fields
        )

    @contextmanager
    def endless(self, *_: object) -> Iterator[SteppedDemo]:
        """Stand for the connection of a client or subscriber."""
        yield self

    @property
    def events_of_scene(self) -> list[dict[str, Any]]:
        """What the virtual gripper reports of the scene, as its process prints it."""
        begin_ns = self.rig.began_ns or 0
        return [{"t_s": 0.0, "t_ns": begin_ns, "event": "begin"}] + [
            {"t_s": each.t_s, "t_ns": begin_ns + round(each.t_s * 1e9), "event": each.event, **each.values}
            for each in self.rig.scene.truth
        ]

    def _open_lines(self) -> None:
        self.opened = True
        for line in LINES:
            self.rig.devices[line].opened(0)
            self.feed(LinkUp(line.replace("-", "."), line))
        if self.rig.arm is not None:
            self.feed(LinkUp("arm", "arm"))

    def play(self, program: RobotProgram) -> None:
        """Run a robot program to its end; the first one finds the lines just opened."""
        if not self.opened:
            self._open_lines()
        ended: list[bool] = []
        program._ending = SimpleNamespace(  # type: ignore[assignment]
            wait=self.pass_time, is_set=lambda: bool(ended), set=lambda: ended.append(True)
        )
        clock = SimpleNamespace(monotonic=lambda: self.now_ns * 1e-9, monotonic_ns=lambda: self.now_ns)
        with pytest.MonkeyPatch.context() as patch:
            for module in (robot_program, carry):
                patch.setattr(module, "time", clock)
            patch.setattr(robot_program, "Subscriber", self.endless)
            patch.setattr(robot_program, "GripClient", self.endless)
            program.run()

    def finish(self) -> None:
        """Finish the recording."""
        if self.file is not None:
            self.file.finish(self.events)
