"""Random walks of a gripper session against its emulated gripper, on a line that loses, delays, refuses and breaks.

Every millisecond something may happen: a permit, a drop, an acknowledgement, a fault, silence, a loss of power, a new
link. Whatever the session writes is read back from the bytes and judged against what it was permitted.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import Enum
from random import Random
from typing import Any

import msgpack

from slipd.devices.external_gripper import Session as ExternalSession
from slipd.devices.external_gripper.external_gripper_message import encode_registration, encode_report
from slipd.devices.robotiq_2f import Session as RobotiqSession
from slipd.devices.robotiq_2f import robotiq_registers as registers
from slipd.devices.shared import modbus
from slipd.devices.shared.decoder_health import DecoderHealth
from slipd.devices.shared.weiss_packets import SEED_WITH_PREAMBLE, PacketScanner
from slipd.devices.wsg import Session as WsgSession
from slipd.devices.wsg import wsg_messages as wire
from slipd.permit import Permit
from slipd.sim.emulated_external_gripper import DRIVER, Driver
from slipd.sim.emulated_robotiq_2f import FORCE_TABLE, Gripper2F
from slipd.sim.emulated_wsg import make as make_wsg

MS = 1_000_000
STEPS = 4_000
FORCE_STEP_N = 0.2
"""A force byte of the Robotiq is less than this."""


@dataclass(frozen=True)
class SentCommand:
    """One command on the wire: "activate", "move", "force", "stop" or "other", in metres and newtons on one pad."""

    kind: str
    width_m: float | None = None
    force_n: float | None = None


class Peer(ABC):
    """The far end of the line."""

    session: Any
    widths_m: tuple[float, ...]
    forces_n: tuple[float, float]

    def __init__(self, rng: Random) -> None:
        self.rng = rng

    @abstractmethod
    def opened(self, now_ns: int) -> None:
        """The link was opened."""

    @abstractmethod
    def commands(self, data: bytes) -> list[SentCommand]:
        """What the bytes tell the gripper."""

    @abstractmethod
    def hear(self, data: bytes, now_ns: int) -> list[bytes]:
        """Take what the session wrote; return the answers."""

    @abstractmethod
    def refuse(self, data: bytes) -> list[bytes]:
        """Refusals of what the session wrote."""

    @abstractmethod
    def advance(self, now_ns: int) -> list[bytes]:
        """What is sent unasked."""

    @abstractmethod
    def disturb(self) -> list[bytes]:
        """Something happens to the gripper; what is sent at that."""

    @abstractmethod
    def width_m(self) -> float:
        """Where the fingers are."""


class RobotiqPeer(Peer):
    widths_m = (0.0, 0.02, 0.06, 0.085)
    forces_n = (FORCE_TABLE[0][1], FORCE_TABLE[-1][1])

    def __init__(self, rng: Random) -> None:
        super().__init__(rng)
        self.session = RobotiqSession(force_table=FORCE_TABLE)
        self.gripper = Gripper2F()
        self.output = (0, 0, 0)

    def opened(self, now_ns: int) -> None:
        pass

    def requests(self, data: bytes) -> list[modbus.Request]:
        return modbus.parse_requests(data, registers.UNIT)[0]

    def commands(self, data: bytes) -> list[SentCommand]:
        found = []
        for request in (request for request in self.requests(data) if request.registers):
            (action, *_), force = request.registers, request.registers[-1] & 0xFF
            force_n = self.session._units.newtons(force)
            if request.write_address == registers.FORCE_ADDRESS:
                found.append(SentCommand("force", force_n=force_n))
            elif action >> 8 & registers.GO:
                found.append(SentCommand("move", self.session._units.width_m(request.registers[1]), force_n))
            else:
                found.append(SentCommand("stop" if len(request.registers) == 1 else "activate"))
        return found

    def hear(self, data: bytes, now_ns: int) -> list[bytes]:
        self.gripper.command(now_ns)
        return [self.gripper.receive(data, now_ns)]

    def refuse(self, data: bytes) -> list[bytes]:
        return [modbus.encode_exception(request, 1) for request in self.requests(data)]

    def advance(self, now_ns: int) -> list[bytes]:
        return []

    def disturb(self) -> list[bytes]:
        self.gripper._write_output(self.rng.choice(((0, 0, 0), (0x0100, 0, 0))), self.rng.randrange(2) << 40)
        return []

    def width_m(self) -> float:
        return 0.0


class WsgPeer(Peer):
    widths_m = (0.0, 0.02, 0.06, 0.11)
    forces_n = (2.5, 40.0)

    def __init__(self, rng: Random) -> None:
        super().__init__(rng)
        self.session = WsgSession()
        self.gripper = make_wsg(0)
        self.gripper.part_mm = rng.choice((0.0, 40.0))
        if rng.random() < 0.2:
            self.gripper.words.clear()

    def opened(self, now_ns: int) -> None:
        self.gripper.opened(now_ns)

    def packets(self, data: bytes) -> Any:
        return PacketScanner(SEED_WITH_PREAMBLE, lambda *_: True, 9, DecoderHealth()).packets(data)

    def commands(self, data: bytes) -> list[SentCommand]:
        found = []
        for packet in (packet for packet in self.packets(data) if packet.id < wire.STATE):
            if packet.id == wire.SET_FORCE:
                found.append(SentCommand("force", force_n=wire.parse_number(packet.payload) / wire.FINGERS))
            elif packet.id == wire.PREPOSITION:
                found.append(SentCommand("move", wire.parse_goal(packet.payload)[1] / 1000))
            else:
                found.append(SentCommand({wire.HOME: "activate", wire.STOP: "stop"}.get(packet.id, "other")))
        return found

    def hear(self, data: bytes, now_ns: int) -> list[bytes]:
        return self.gripper.receive(data, now_ns)

    def refuse(self, data: bytes) -> list[bytes]:
        return [
            wire.encode_reply(packet.id, self.rng.choice((wire.NOT_INITIALISED, wire.ABORTED, wire.RANGE_ERROR)))
            for packet in self.packets(data)
        ]

    def advance(self, now_ns: int) -> list[bytes]:
        return self.gripper.advance(now_ns)

    def disturb(self) -> list[bytes]:
        self.gripper.words ^= {self.rng.choice(("referenced", "fast_stop", "temperature_warning"))}
        return []

    def width_m(self) -> float:
        return self.gripper.width_mm / 1000


class ExternalPeer(Peer):
    widths_m = (0.0, 0.02, 0.06, 0.1)
    forces_n = DRIVER.force_range_n

    def __init__(self, rng: Random) -> None:
        super().__init__(rng)
        self.session = ExternalSession()
        self.driver = Driver()

    def opened(self, now_ns: int) -> None:
        self.driver.opened(now_ns)

    def messages(self, data: bytes) -> Any:
        unpacker = msgpack.Unpacker()
        unpacker.feed(data)
        return [body for body in unpacker if "op" in body]

    def commands(self, data: bytes) -> list[SentCommand]:
        kinds = {"acknowledge": "other"}
        return [
            SentCommand(kinds.get(body["op"], body["op"]), body.get("width_m"), body.get("force_n"))
            for body in self.messages(data)
        ]

    def hear(self, data: bytes, now_ns: int) -> list[bytes]:
        return self.driver.receive(data, now_ns)

    def refuse(self, data: bytes) -> list[bytes]:
        return [encode_report(replace(self.driver.report, id=body["id"], error="no")) for body in self.messages(data)]

    def advance(self, now_ns: int) -> list[bytes]:
        return self.driver.advance(now_ns)

    def disturb(self) -> list[bytes]:
        change = self.rng.choice(({"fault": "no_power"}, {"fault": ""}, {"active": False}, {"active": True}))
        self.driver.report = replace(self.driver.report, **change)
        name = self.rng.choice((DRIVER.name, DRIVER.name, "stranger", ""))
        return [encode_registration(replace(DRIVER, name=name))] if name and self.rng.random() < 0.4 else []

    def width_m(self) -> float:
        return self.driver.report.width_m or 0.0


PEERS = {"robotiq_2f": RobotiqPeer, "wsg": WsgPeer, "external_gripper": ExternalPeer}


class Walk:
    """One walk; it stops with an AssertionError at the first thing that must not be.

    Attributes:
        pairs: How often each (state, event) was handled, and whether the state took it.
    """

    def __init__(self, device: str, seed: int) -> None:
        self.rng = rng = Random(f"{device} {seed}")
        self.peer = PEERS[device](rng)
        self.session: Any = self.peer.session
        self.now_ns = 0
        self.pairs: Counter[tuple[Enum, Enum, bool]] = Counter()
        self.loss, self.refusal = rng.choice(((0.0, 0.0), (0.05, 0.0), (0.02, 0.1), (0.5, 0.1)))
        self.eager = rng.choice((0.02, 0.1, 0.4))
        self.anew = rng.choice((1, 1, 8))
        self.mute_until_ns = 0
        self.restless = rng.choice((0.003, 0.02))
        self.replies: list[tuple[int, bytes]] = []
        self.goal_m: float | None = None  # of the last move, unless it was halted, dropped or replaced
        self.may_activate = False
        self.sent: set[SentCommand] = set()

    def run(self) -> Counter[tuple[Enum, Enum, bool]]:
        self.open()
        for _ in range(STEPS):
            self.now_ns += MS
            self.receive()
            if self.rng.random() < self.eager:
                self.act()
            if self.rng.random() < self.restless:
                self.disturb()
            while (due := self.session.next_deadline()) is not None and due <= self.now_ns:
                self.write(self.session.on_time(self.now_ns))
        return self.pairs

    def open(self) -> None:
        self.replies.clear()
        self.sent.clear()
        self.goal_m, self.may_activate = None, False
        self.peer.opened(self.now_ns)
        self.write(self.session.start(self.now_ns))
        self.watch()

    def watch(self) -> None:
        """Count what the session's machine handles."""
        machine, pairs = self.session._machine, self.pairs
        handle = machine.handle

        def counted(event: Enum) -> bool:
            state = machine.state
            taken: bool = handle(event)
            pairs[state, event, taken] += 1
            return taken

        machine.handle = counted

    def receive(self) -> None:
        self.replies += [(self.now_ns, data) for data in self.peer.advance(self.now_ns)]
        due = [data for at_ns, data in self.replies if at_ns <= self.now_ns]
        self.replies = [reply for reply in self.replies if reply[0] > self.now_ns]
        for data in due:
            if self.now_ns >= self.mute_until_ns:
                self.session.receive(data, self.now_ns)

    def write(self, data: bytes) -> None:
        for command in self.peer.commands(data):
            self.judge(command)
        chance = self.rng.random()
        if chance < self.loss:
            return
        answers = self.peer.refuse(data) if chance < self.loss + self.refusal else self.peer.hear(data, self.now_ns)
        late_ns = self.rng.choice((0, 1, 6, 6, 30)) * MS
        self.replies += [(self.now_ns + late_ns, answer) for answer in answers if answer]

    def judge(self, command: SentCommand) -> None:
        """Whatever is on the wire was permitted, and is the newest that was."""
        if command.kind == "activate":
            assert self.may_activate, "activated without a permit"
        if command.kind == "move":
            assert self.goal_m is not None, "moved without a permit, or behind a halt"
            assert command.width_m is not None
            assert abs(command.width_m - self.goal_m) < 1e-3, "moved to another width than permitted"
        if command.force_n is not None and command not in self.sent:  # an older force may be repeated before the newest
            assert self.session.force_sent_n is not None
            assert abs(command.force_n - self.session.force_sent_n) < 1e-6, "sent another force than it says"
        self.sent.add(command)

    def act(self) -> None:
        kind = self.rng.choice((*("activate",) * self.anew, *("move", "set_force", "halt") * 4, "drop", "acknowledge"))
        if kind == "drop":
            dropped = self.session.drop()
            self.may_activate = self.may_activate and not dropped
        elif kind == "acknowledge":
            self.session.acknowledge()
        else:
            self.permit(self.make(kind))

    def make(self, kind: Any) -> Permit:
        if kind in ("activate", "halt"):
            return Permit(kind)
        force_n = self.rng.uniform(*self.peer.forces_n)
        if kind == "set_force":
            return Permit(kind, force_n=force_n)
        return Permit(kind, self.rng.choice(self.peer.widths_m), self.rng.choice((None, 0.1)), force_n)

    def permit(self, permit: Permit) -> None:
        session = self.session
        state, activating, told_n = session._machine.state, session.activating, session.force_sent_n
        taken = session.execute(permit, self.now_ns)
        if not taken:
            assert session.force_sent_n == told_n, "a refused permit changes nothing"
            assert session.activating == activating
            if permit.kind != "halt":
                assert session._machine.state is state
            return
        if permit.kind in ("move", "set_force"):
            assert not activating
            assert permit.force_n is not None
            assert 0.0 <= permit.force_n - session.force_sent_n < FORCE_STEP_N
        if permit.kind == "activate":
            assert session.activating
        self.may_activate = permit.kind == "activate" or (self.may_activate and permit.kind != "halt")
        if permit.kind != "set_force":
            self.goal_m = permit.width_m

    def disturb(self) -> None:
        chance = self.rng.random()
        if chance < 0.3:
            self.mute_until_ns = max(self.mute_until_ns, self.now_ns + self.rng.choice((50, 700, 1300, 1300)) * MS)
        elif chance < 0.33:
            self.session.stop()
            assert self.session.next_deadline() is None
            self.watch()
            for permit in map(self.make, ("activate", "move", "set_force", "halt")):
                assert not self.session.execute(permit, self.now_ns)
            assert self.session.on_time(self.now_ns) == b""
            self.open()
        else:
            self.replies += [(self.now_ns, data) for data in self.peer.disturb()]


def walks(device: str, seeds: range) -> Iterator[Counter[tuple[Enum, Enum, bool]]]:
    """Walk, once a seed."""
    for seed in seeds:
        try:
            yield Walk(device, seed).run()
        except AssertionError as error:
            error.add_note(f"{device}, seed {seed}")
            raise
