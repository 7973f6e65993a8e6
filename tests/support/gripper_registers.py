"""The gripper's side of a serial line, for tests that set its registers."""

from __future__ import annotations

from dataclasses import replace

from slipd.devices.robotiq_2f import robotiq_registers
from slipd.devices.shared import modbus
from slipd.tools.sim import emulated_robotiq_2f as sim


def read_requests(data: bytes, *, size: int = 0) -> list[modbus.Request]:
    """Read the requests to a device from bytes that end with one, in pieces of a size."""
    scanner = sim.request_scanner(robotiq_registers.UNIT)
    pieces = [data[at : at + size] for at in range(0, len(data), size)] if size else [data]
    found = [(buffer, at) for buffer, places in map(scanner.receive, pieces) for at, _ in places]
    assert scanner.in_sync
    return [request for buffer, at in found for request in sim.parse_requests(buffer, at)]


class GripperLine:
    """The gripper's side of the line: registers that are written and read; nothing moves by itself."""

    def __init__(self) -> None:
        self.outputs: tuple[int, ...] = (0, 0, 0)
        self.stage, self.found, self.fault, self.position = 0, 0, 0, 0
        self.silent = False
        self.activates = False  # an activation takes its time
        self.echo: int | None = None  # position that its echo reports in place of the one that was commanded
        self.writes: list[tuple[int, ...]] = []

    @property
    def command(self) -> sim.Output:
        return sim.parse_output(self.outputs)

    def answer(self, data: bytes) -> bytes:
        return b"" if self.silent else b"".join(map(self._answer, read_requests(data)))

    def _answer(self, request: modbus.Request) -> bytes:
        if not request.registers:
            return sim.encode_reply(request, self._status())
        written = sim.write_output(self.outputs, request)
        assert written is not None
        self.outputs = written
        self.writes.append(request.registers)
        if not self.command.activate:
            self.stage = 0
        elif self.stage == 0:
            self.stage = 1 if self.activates else 3
        return sim.encode_reply(request)

    def _status(self) -> tuple[int, int, int]:
        command = self.command if self.echo is None else replace(self.command, position=self.echo)
        return sim.status_registers(
            command,
            stage=self.stage,
            found=self.found,
            fault=self.fault,
            position=self.position,
            current_a=0.1,
        )
