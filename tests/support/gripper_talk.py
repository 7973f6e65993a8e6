"""A gripper session with its gripper on a perfect line, and how to bring it to each of its states."""

from __future__ import annotations

from random import Random
from typing import Any

from gripper_peers import PEERS, SentCommand
from gripper_walks import MS

from slipd.devices.external_gripper.external_gripper_message import Report
from slipd.types.permit import Permit


class Talk:
    """A session and its gripper on a perfect line; time advances only in `run`."""

    def __init__(self, device: str) -> None:
        self.peer: Any = PEERS[device](Random(device))
        self.session = self.peer.session
        self.now_ns = 0
        self.commands: list[SentCommand] = []
        self.written = b""
        self.deaf = False

    def start(self) -> Talk:
        self.peer.opened(self.now_ns)
        self.exchange(self.session.start(self.now_ns))
        return self

    def exchange(self, data: bytes) -> None:
        self.written += data
        self.commands += self.peer.commands(data)
        for answer in self.peer.hear(data, self.now_ns):
            if not self.deaf:
                self.session.receive(answer, self.now_ns)

    def write(self) -> None:
        """Exchange what is due now."""
        while (due := self.session.next_deadline()) is not None and due <= self.now_ns:
            self.exchange(self.session.on_time(self.now_ns))

    def run(self, ms: int) -> Talk:
        for _ in range(ms):
            self.now_ns += MS
            for data in self.peer.advance(self.now_ns):
                if not self.deaf:
                    self.session.receive(data, self.now_ns)
            self.write()
        return self

    def ask(self, kind: Any) -> bool:
        """Execute a permit of a kind, or "drop"."""
        if kind == "drop":
            return bool(self.session.drop())
        force_n = None if kind in ("activate", "halt") else 8.0
        permit = Permit(kind, 0.02 if kind == "move" else None, force_n=force_n)
        return bool(self.session.execute(permit, self.now_ns))


def reach_robotiq(state: str) -> Talk:
    talk = Talk("robotiq_2f")
    if state in ("closed", "waiting"):
        talk.deaf = True
        return talk if state == "closed" else talk.start()
    talk.peer.gripper._write_output((0x0100 if state == "active" else 0, 0, 0), -(10**10))
    talk.start().run(30)
    if state in ("activation queued", "cleared", "activating"):
        assert talk.ask("activate")
    writes = {"cleared": 1, "activating": 2}.get(state, 0)
    while talk.commands.count(SentCommand("activate")) < writes:
        talk.now_ns += MS
        due = talk.session.next_deadline()
        if due <= talk.now_ns:
            talk.exchange(talk.session.on_time(talk.now_ns))
    return talk


def reach_wsg(state: str) -> Talk:
    talk = Talk("wsg")
    words = {"inactive": set(), "faulty": {"referenced", "fast_stop"}}
    talk.peer.gripper.words = words.get(state, {"referenced"})
    talk.peer.gripper.part_mm = 0.0
    if state == "closed":
        return talk
    if state == "waiting":
        talk.deaf = True
        return talk.start()
    talk.start().run(300)
    if state == "silent":
        talk.deaf = True
        talk.run(1200)
    if "activati" in state or state == "settling":
        assert talk.ask("activate")
    if state in ("activating", "reactivation queued", "settling"):
        talk.write()
    if state == "reactivation queued":
        assert talk.ask("activate")
    if state == "settling":
        assert talk.ask("halt")
        talk.write()
    return talk


def reach_external(state: str) -> Talk:
    talk = Talk("external_gripper")
    if state == "closed":
        return talk
    if state == "unregistered":
        talk.session.start(0)
        return talk
    reports = {"inactive": Report(0.05, active=False), "faulty": Report(0.05, fault="no_power")}
    talk.peer.driver.report = reports.get(state, Report(0.05))
    if state == "waiting":
        talk.peer.driver._next_ns = 10**18
    talk.start().run(30)
    if state == "silent":
        talk.deaf = True
        talk.run(600)
    if state in ("activation queued", "activating"):
        assert talk.ask("activate")
    if state == "activating":
        talk.peer.driver.mute = True
        talk.write()
    return talk


REACH = {"robotiq_2f": reach_robotiq, "wsg": reach_wsg, "external_gripper": reach_external}
