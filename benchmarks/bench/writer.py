"""The devices' side of the ports, in a process of its own: writes every frame when it is due, and stamps it.

A stamp is CLOCK_MONOTONIC just before the one ``write`` that carries the whole frame, and so its last byte; it goes to
a file that is mapped into memory. Where the daemon configures its sensors it is answered, as a sensor would.

    python -m bench.writer PLAN    (JSON, see `encode_plan`)

Prints ``measuring`` when the warm-up is over, and a JSON map of `Outcome`s by stream when all is written.
"""

from __future__ import annotations

import array
import contextlib
import fcntl
import gc
import json
import os
import sys
import termios
import time
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from slipd.tools.sim import emulated_wrenches as sim

START_S = 0.05
"""From loading the plan to the first frame."""

ANSWER_EVERY_NS = 20_000_000
"""How often the ports are asked for commands: a sensor may take some milliseconds to answer."""


@dataclass(frozen=True)
class Plan:
    """One stream.

    Attributes:
        name: For people.
        fd: Our end of the pseudo-terminal.
        other_fd: The other end, to see what is unread; -1: nobody looks.
        frames: File of the frames, one row each (.npy, uint8).
        stamps: File of the stamps to be made, one each (.npy, int64); 0: not written.
        period_ns: Time between two frames.
        phase_ns: When the first is due.
    """

    name: str
    fd: int
    other_fd: int
    frames: str
    stamps: str
    period_ns: int
    phase_ns: int


@dataclass
class Outcome:
    """How one stream went.

    Attributes:
        written: Frames that the port took.
        refused: Frames that it did not, or not whole, because too much was unread.
        late_ns: How late each write was against its due time.
        unread: Bytes of this stream that were unread at each write.
    """

    written: int = 0
    refused: int = 0
    late_ns: list[int] = field(default_factory=list)
    unread: list[int] = field(default_factory=list)

    def summary(self) -> dict[str, float]:
        """In the numbers that are printed."""
        unread = self.unread or [0]
        return {
            "written": self.written,
            "refused": self.refused,
            "late_p99_us": float(np.percentile(self.late_ns, 99)) / 1000,
            "unread_p99": float(np.percentile(unread, 99)),
            "unread_most": max(unread),
        }


class _Port:
    """One stream while it is written."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.frames = [row.tobytes() for row in np.load(plan.frames)]
        self.stamps = np.lib.format.open_memmap(plan.stamps, mode="r+")
        self.stamps[:] = 0  # touches every page before it counts
        self.outcome = Outcome()
        self._heard = b""
        self._unread = array.array("i", [0])

    def write(self, index: int, due_ns: int) -> None:
        """Write one frame."""
        outcome, frame = self.outcome, self.frames[index]
        if self.plan.other_fd >= 0:
            fcntl.ioctl(self.plan.other_fd, termios.FIONREAD, self._unread)
            outcome.unread.append(self._unread[0])
        now_ns = time.monotonic_ns()
        try:
            taken = os.write(self.plan.fd, frame)
        except BlockingIOError:
            taken = 0
        if taken == len(frame):
            self.stamps[index] = now_ns
            outcome.written += 1
        else:
            outcome.refused += 1
        outcome.late_ns.append(now_ns - due_ns)

    def answer(self) -> None:
        with contextlib.suppress(BlockingIOError):
            commands, self._heard = sim.parse_commands(self._heard + os.read(self.plan.fd, 4096))
            for command in commands:
                os.write(self.plan.fd, sim.encode_ack(command[0]))


def _schedule(ports: list[_Port]) -> list[tuple[int, int, int]]:
    """(due, ns since the start; port; frame) of every frame, in order."""
    return sorted(
        (port.plan.phase_ns + index * port.plan.period_ns, number, index)
        for number, port in enumerate(ports)
        for index in range(len(port.frames))
    )


def _run(ports: list[_Port], warm_up_ns: int) -> None:
    """Write all; what is late at once, one frame after another, as devices do that wait for nobody."""
    schedule = _schedule(ports)
    begin_ns = time.monotonic_ns() + round(START_S * 1e9)
    answer_ns, warm = begin_ns, False
    for due_ns, number, index in schedule:
        if not warm and due_ns >= warm_up_ns:
            warm = True
            print("measuring", flush=True)
        wait_ns = begin_ns + due_ns - time.monotonic_ns()
        if wait_ns > 0:
            time.sleep(wait_ns * 1e-9)
        ports[number].write(index, begin_ns + due_ns)
        if begin_ns + due_ns >= answer_ns:
            answer_ns += ANSWER_EVERY_NS
            for port in ports:
                port.answer()


def main() -> None:
    """Write it all."""
    plan: dict[str, Any] = json.loads(sys.argv[1])
    ports = [_Port(Plan(**stream)) for stream in plan["streams"]]
    gc.disable()
    _run(ports, plan["warm_up_ns"])
    print(json.dumps({port.plan.name: port.outcome.summary() for port in ports}), flush=True)


def encode_plan(streams: list[Plan], warm_up_ns: int) -> str:
    """The argument that says what to write.

    Args:
        streams: All streams.
        warm_up_ns: How much of the beginning does not count.
    """
    plans = [asdict(stream) for stream in streams]
    return json.dumps({"streams": plans, "warm_up_ns": warm_up_ns})


if __name__ == "__main__":
    main()
