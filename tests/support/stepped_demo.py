"""The story of the demo with its own robot program, whose waits let the simulated time pass."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import pytest
from demo_story import RENEW_TICKS, Story

from slipd.events import LinkUp
from slipd.tools.demo_summary import Tally
from slipd.tools.sim import carry_program, robot_program
from slipd.tools.sim.robot_program import RobotProgram
from slipd.tools.sim.virtual_gripper import LINES, TICK_NS
from slipd_client.messages import encode
from slipd_client.messages.codec import typed_message


class SteppedDemo(Story):
    """The story with a subscriber and a client whose waits let the simulated time pass."""

    def start(self) -> None:
        """Open the lines."""
        self.inbox: deque[Any] = deque()
        self.tally = Tally()
        self.leased = False
        for line in LINES:
            self.rig.opened(line, 0)
            self.feed(LinkUp(line.replace("-", "."), line))
        if self.rig.arm is not None:
            self.feed(LinkUp("arm", "arm"))

    def hear(self, topic: str, body: dict[str, Any]) -> None:
        """Record a message, and keep it for the program."""
        super().hear(topic, body)
        if self.file is not None:
            self.file.published(self.events, self.now_ns, topic, encode(body))
            self.events += 1
        message = typed_message(topic, body)
        self.tally.add(message)
        if topic.startswith(("slip", "warning")):
            self.inbox.append(message)

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
        if not op.startswith(("gripper_", "grip_", "hello", "status", "motion_")):
            raise AttributeError(op)
        places = {"gripper_close": ("force_n",), "grip_set": ("force_n",), "motion_check": ("points",)}.get(op, ())
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
        begin_ns = self.rig.began_ns
        assert begin_ns is not None
        return [{"t_s": 0.0, "t_ns": begin_ns, "event": "begin"}] + [
            {"t_s": each.t_s, "t_ns": begin_ns + round(each.t_s * 1e9), "event": each.event, **each.values}
            for each in self.rig.scene.truth
        ]

    def play(self, program: RobotProgram) -> None:
        """Run a robot program in the simulated time, to its end."""
        self.start()
        ended: list[bool] = []
        program._ending = SimpleNamespace(  # type: ignore[assignment]
            wait=self.pass_time, is_set=lambda: bool(ended), set=lambda: ended.append(True)
        )
        clock = SimpleNamespace(monotonic=lambda: self.now_ns * 1e-9, monotonic_ns=lambda: self.now_ns)
        with pytest.MonkeyPatch.context() as patch:
            for module in (robot_program, carry_program):
                patch.setattr(module, "time", clock)
            patch.setattr(robot_program, "Subscriber", self.endless)
            patch.setattr(robot_program, "GripClient", self.endless)
            program.run()
