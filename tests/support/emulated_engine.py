"""An engine on emulated devices whose pads a hand touches, in simulated time."""

from __future__ import annotations

import sys
from collections import deque
from pathlib import Path
from typing import Any

from slipd import config
from slipd.engine.engine import Engine
from slipd.events import Bytes, LinkUp, Output, Publish, Reply, Request, Tick, Write
from slipd.tools.sim.emulators import Emulator
from slipd.tools.sim.hand_commands import parse_command
from slipd.tools.sim.touched_devices import TouchedDevices
from slipd_client.errors import RequestRefused
from slipd_client.messages import replies
from slipd_client.messages.codec import typed_message
from slipd_client.messages.ops import OPS
from slipd_client.messages.topics import Message

STEP_NS = 10_000_000
BOOT = "b00t"
T0 = 1_000_000_000_000


class EmulatedEngine:
    """The daemon without its sockets, on devices that are mounted as one config states and read by another.

    Args:
        true: How the sensors are mounted.
        read: What the daemon believes; ports as in ``true``.
        folder: For addresses, which nobody opens.
        unkind: Whether the sensors are as unkind as real ones.

    Attributes:
        now_ns: Time since the start.
    """

    def __init__(self, true: config.Config, read: config.Config, folder: Path, *, unkind: bool = False) -> None:
        self.devices = TouchedDevices(true, folder, unkind=unkind)
        ports = list(dict.fromkeys(stream.port for stream in true.streams().values()))
        self._by_port = {port: device[1] for port, device in zip(ports, self.devices.devices, strict=True)}
        self.now_ns = self._asked = 0
        self._messages: deque[Message] = deque()
        self._replies: list[dict[str, Any]] = []
        self.restart(read)

    def restart(self, read: config.Config) -> None:
        """Begin a new run of the daemon, with another config."""
        self._engine = Engine(read, boot=BOOT, wall_minus_monotonic_ns=0)
        streams = read.streams()
        self._by_link: dict[str, Emulator] = {name: self._by_port[streams[name].port] for name in self._engine.links}
        for name, emulator in self._by_link.items():
            emulator.opened(self.now_ns)
            self._handle(self._engine.handle(LinkUp(name, name), T0 + self.now_ns))

    def ask(self, op: str, **fields: Any) -> replies.Reply:
        """Send a request; return the reply.

        Raises:
            RequestRefused: The engine refused it.
        """
        self._asked += 1
        t_ns = T0 + self.now_ns
        envelope = {"v": 1, "id": self._asked, "op": op, "boot": BOOT, "deadline_ns": t_ns + 100_000_000}
        self._handle(self._engine.handle(Request(b"ann", envelope | fields), t_ns))
        reply = self._replies.pop()
        if fault := reply.get("error"):
            raise RequestRefused(fault["code"], fault["message"], fault.get("field", ""))
        return replies.typed_reply(OPS[op].reply, reply["result"])

    def drop_messages(self) -> None:
        """Forget the messages that nobody received."""
        self._messages.clear()

    def touch(self, line: str) -> None:
        """Carry out commands of the emulation, separated by semicolons."""
        for part in line.split(";"):
            command = parse_command(part, self.devices.fingers)
            assert command is not None
            self.devices.hand.carry_out(command, self.now_ns * 1e-9)

    def receive(self) -> Message:
        """Return the next message that the daemon publishes.

        Coverage, which would take most of the time, does not trace the daemon here: its rooms have tests of their own.
        """
        trace = sys.gettrace()
        sys.settrace(None)
        try:
            while not self._messages:
                self._step()
        finally:
            sys.settrace(trace)
        return self._messages.popleft()

    def _step(self) -> None:
        self.now_ns += STEP_NS
        self.devices.advance(self.now_ns)
        t_ns = T0 + self.now_ns
        for name, emulator in self._by_link.items():
            for data in emulator.advance(self.now_ns):
                self._handle(self._engine.handle(Bytes(name, data), t_ns))
        self._handle(self._engine.handle(Tick(0), t_ns))

    def _handle(self, outputs: list[Output]) -> None:
        for output in outputs:
            if isinstance(output, Publish):
                self._messages.append(typed_message(output.topic, output.body))
            elif isinstance(output, Reply):
                self._replies.append(output.body)
            elif isinstance(output, Write):
                for answer in self._by_link[output.link].receive(output.data, self.now_ns):
                    self._handle(self._engine.handle(Bytes(output.link, answer), T0 + self.now_ns))
