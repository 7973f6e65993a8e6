"""The scene of the demo in simulated time: bytes of the virtual gripper through the engine, and back."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from wire_check import faults_of

from slipd.engine.engine import Engine
from slipd.events import Bytes, Event, LinkUp, Publish, Reply, Request, Tick, Write
from slipd.recording.mcap_file import RecordingFile
from slipd.tools.sim.robot_program import ALARMING, LEAST_RAISE_N, Plan
from slipd.tools.sim.virtual_gripper import LINES, TICK_NS, VirtualRig

RENEW_TICKS = 80


@dataclass
class Story:
    """One run: the reports and the truth, times in s of the scene.

    Attributes:
        rig: The virtual gripper.
        engine: The daemon's engine.
        begin_s: When the scene begins, s after the start of the devices.
        plan: The plan of the robot program.
        file: Where the events are recorded; None: nowhere.
        changes: Times and bodies of the messages of topic "warning".
        verdicts: Times and bodies of those of topic "slip", and the true utilisation.
        raises: Times of the raises of the robot program, and the force after them, N.
    """

    rig: VirtualRig
    engine: Engine
    begin_s: float
    plan: Plan = field(default_factory=Plan)
    file: RecordingFile | None = None
    changes: list[tuple[float, dict[str, Any]]] = field(default_factory=list)
    verdicts: list[tuple[float, dict[str, Any], float]] = field(default_factory=list)
    raises: list[tuple[float, float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.now_ns = self.events = self.asked = 0
        self.alarm = False
        self.force_n = self.wanted_n = self.raised_s = 0.0
        self.unread = dict.fromkeys(LINES, b"")
        self.newest: dict[str, dict[str, Any]] = {}

    @property
    def t_s(self) -> float:
        """Time of the scene, s."""
        return self.now_ns * 1e-9 - self.begin_s

    def feed(self, event: Event) -> dict[str, Any] | None:
        """Give the engine an event, and the devices what it writes; return its reply."""
        reply = None
        if self.file is not None:
            self.file.event(self.events, self.now_ns, event)
            self.events += 1
        for output in self.engine.handle(event, self.now_ns):
            assert faults_of(output, event if isinstance(event, Request) else None) == []
            if isinstance(output, Write):
                line = output.link.replace(".", "-")
                self.unread[line] += self.rig.receive(line, output.data, self.now_ns)
            elif isinstance(output, Reply):
                reply = output.body
            elif isinstance(output, Publish):
                self.hear(output.topic, output.body)
        return reply

    def hear(self, topic: str, body: dict[str, Any]) -> None:
        """Take a message."""
        if topic == "warning":
            self.changes.append((self.t_s, body))
            self.alarm |= body["rising"] and body["level"] in ALARMING and "rotation" in body["reasons"]
        elif topic.startswith("slip"):
            self.newest[topic] = body
            self.verdicts.append((self.t_s, body, self.rig.scene.utilisation))

    def ask(self, op: str, **fields: Any) -> dict[str, Any]:
        """Return the result of a request, which must be granted."""
        self.asked += 1
        envelope = {"v": 1, "id": self.asked, "op": op, "boot": "b", "deadline_ns": self.now_ns + 10**8}
        reply = self.feed(Request(b"operator", envelope | fields))
        assert reply is not None
        assert reply["ok"], reply
        result: dict[str, Any] = reply["result"]
        return result

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

    def until(self, t_s: float, *, heed: bool = False) -> None:
        """Go on until a time of the scene; ``heed``: raise the grip after an alarm of rotation, as the demo does."""
        while self.t_s < t_s:
            self.tick()
            if self.now_ns % (RENEW_TICKS * TICK_NS) == 0 and self.t_s > 0:
                self.ask("lease.renew")
            if heed and self.alarm:
                self.wanted_n = max(body["grip_needed_n"] or 0.0 for body in self.newest.values())
            self.alarm = False
            if self.wanted_n > self.force_n + LEAST_RAISE_N and self.t_s > self.raised_s + self.plan.step_s:
                asked_n = min(self.wanted_n, self.force_n + self.plan.step_n)
                self.force_n, self.raised_s = self.ask("grip.set", force_n=asked_n)["applied_n"], self.t_s
                self.raises.append((self.t_s, self.force_n))

    def grip(self, ready_s: float) -> None:
        """Start the devices, tare both fingers ``ready_s`` later, begin the scene, and close the gripper."""
        for line in LINES:
            self.rig.opened(line, 0)
            self.feed(LinkUp(line.replace("-", "."), line))
        self.until(ready_s - self.begin_s)
        for finger in ("left", "right"):
            self.ask("tare", finger=finger, seconds=self.plan.tare_s)
        self.until(0.0)
        self.ask("lease.acquire", ttl_ms=self.plan.lease_ms)
        self.ask("gripper.activate")
        self.until(self.plan.close_s)
        closed = self.ask("gripper.close", force_n=self.plan.force_n, speed_mps=self.plan.speed_mps)
        self.force_n = closed["applied_n"]

    def release(self, until_s: float) -> None:
        """Open the gripper, and go on for a while."""
        self.wanted_n = 0.0
        self.ask("gripper.open", drop=True)
        self.until(until_s)

    def reported(self, level: str, reason: str) -> float | None:
        """Return when a level was first reported for a reason."""
        return next((t for t, body in self.changes if body["level"] == level and reason in body["reasons"]), None)

    def truth(self, event: str) -> float | None:
        """Return when an event of the scene happened first."""
        return next((truth.t_s for truth in self.rig.scene.truth if truth.event == event), None)
