"""A Robotiq session and a simple gripper on a simulated line."""

from __future__ import annotations

from dataclasses import dataclass, field

from permits import move, set_force

from slipd.devices import robotiq_2f
from slipd.devices.shared import modbus
from slipd.tools.sim import emulated_robotiq_2f as robotiq_2f_sim
from slipd.tools.sim import modbus_device as modbus_device_sim
from slipd.types.samples import GripperSample

ILLEGAL_FUNCTION = 1  # of Modbus exceptions
MS = 1_000_000
POLL = bytes.fromhex("09 04 07 D0 00 03 B1 CE")
OLD_POLL = bytes.fromhex("09 03 07 D0 00 03 04 0E")
CLEAR = bytes.fromhex("09 10 03 E8 00 03 06 00 00 00 00 00 00 73 30")
ACTIVATE = bytes.fromhex("09 10 03 E8 00 03 06 01 00 00 00 00 00 72 E1")
OPEN = bytes.fromhex("09 10 03 E8 00 03 06 09 00 00 00 FF FF 72 19")
GO = bytes.fromhex("09 10 03 E8 00 03 06 09 00 00 C8 80 3C 93 86")
FORCE = bytes.fromhex("09 10 03 EA 00 01 02 80 5A 05 A1")


@dataclass
class Gripper:
    """A gripper that activates within two polls and reaches its goal at once."""

    output: tuple[int, ...] = (0, 0, 0)
    stage: int = 0
    fault: int = 0
    position: int = 3
    echo: int | None = None
    mute: bool = False
    refuses: tuple[int, ...] = ()
    received: bytes = b""

    def respond(self, data: bytes) -> bytes:
        requests, self.received = modbus_device_sim.parse_requests(self.received + data, 9)
        return b"" if self.mute else b"".join(self.answer(request) for request in requests)

    def answer(self, request: modbus.Request) -> bytes:
        if request.function in self.refuses:
            return modbus_device_sim.encode_exception(request, ILLEGAL_FUNCTION)
        if request.function == modbus.WRITE:
            written = robotiq_2f_sim.write_output(self.output, request)
            if written is None:
                return modbus_device_sim.encode_exception(request, modbus.ILLEGAL_ADDRESS)
            self.obey(written)
            return modbus_device_sim.encode_reply(request)
        output = robotiq_2f_sim.parse_output(self.output)
        if self.echo is not None:
            output = robotiq_2f_sim.parse_output((self.output[0], self.echo, self.output[2]))
        registers = robotiq_2f_sim.status_registers(
            output, stage=self.stage, found=3, fault=self.fault, position=self.position, current_a=0.1
        )
        self.stage = 3 if self.stage == 1 else self.stage
        return modbus_device_sim.encode_reply(request, registers)

    def obey(self, written: tuple[int, ...]) -> None:
        was, output = (robotiq_2f_sim.parse_output(registers) for registers in (self.output, written))
        self.output = written
        if output.activate and not was.activate:
            self.stage = 1
        elif not output.activate:
            self.stage = 0
        elif output.go and self.stage == 3:
            self.position = output.position


def session() -> robotiq_2f.Session:
    """Return a session with force byte = N - 1, position byte = mm closed, and speed byte = mm/s."""
    return robotiq_2f.Session(
        force_table=[(0, 1.0), (255, 256.0)],
        width_table=[(0.0, 0.255), (1.0, 0.0)],
        speed_table=[(0, 0.0), (255, 0.255)],
    )


@dataclass
class Bench:
    """Run the session with a simulated clock; a reply takes 6 ms."""

    session: robotiq_2f.Session = field(default_factory=session)
    gripper: Gripper = field(default_factory=Gripper)
    now_ns: int = 0
    sent: list[tuple[int, bytes]] = field(default_factory=list)
    samples: list[GripperSample] = field(default_factory=list)

    def start(self) -> Bench:
        self.transact(self.session.start(self.now_ns))
        return self

    def transact(self, data: bytes) -> None:
        if not data:
            return
        self.sent.append((self.now_ns, data))
        reply = self.gripper.respond(data)
        if reply:
            self.now_ns += 6 * MS
            self.samples += self.session.receive(reply, self.now_ns)

    def steps(self, count: int) -> None:
        for _ in range(count):
            due = self.session.next_deadline()
            assert due is not None
            self.now_ns = max(self.now_ns, due)
            self.transact(self.session.on_time(self.now_ns))

    def move(self, position: int, speed: int, force: int) -> float | None:
        return move(self.session, (255 - position) / 1000, speed / 1000, force + 1.0)

    def set_force(self, force: int) -> float | None:
        return set_force(self.session, force + 1.0)

    def commands(self) -> list[bytes]:
        return [data for _, data in self.sent if data not in (POLL, OLD_POLL)]
