"""A session with a sensor and its emulated device, on a line that a test may damage."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import pytest

from slipd.devices import DEVICES, Inquiry
from slipd.tools.sim.emulators import make_emulator

STEP_NS = 10_000_000


@dataclass
class Bench:
    """Run session and device in steps of 10 ms.

    Attributes:
        session: The session.
        device: Its emulated device.
        inquiry: The request that goes before, over TCP.
        heard: Returns what the device hears of a request; empty: nothing.
        told: Returns what the session receives of what the device sends; empty: nothing.
        off: Whether the device has no power.
        piece: Longest piece in which the session receives it, bytes.
        written: The requests.
        states: The states of the session, each until it changes.
        samples: The readings.
    """

    session: Any
    device: Any
    inquiry: Inquiry | None = None
    heard: Callable[[bytes], bytes] = bytes
    told: Callable[[bytes], bytes] = bytes
    off: bool = False
    piece: int = 1 << 20
    now_ns: int = 0
    device_ns: int = 0
    written: list[bytes] = field(default_factory=list)
    states: list[str] = field(default_factory=list)
    samples: list[Any] = field(default_factory=list)

    def start(self, seconds: float = 0.0) -> Bench:
        """Open the line, and run."""
        self.device.opened(self.device_ns)
        self.write(self.session.start(self.now_ns))
        return self.run(seconds)

    def write(self, data: bytes) -> None:
        self._note()
        if data:
            self.written.append(data)
            heard = b"" if self.off else self.heard(data)
            for answer in self.device.receive(heard, self.device_ns) if heard else []:
                self.deliver(self.told(answer))

    def deliver(self, data: bytes) -> None:
        for at in range(0, len(data), self.piece):
            self.samples += self.session.receive(data[at : at + self.piece], self.now_ns)
        self._note()

    def sent(self) -> list[bytes]:
        """Return what the device sends in the next step, after its answer to the inquiry."""
        self.device_ns += STEP_NS
        asks = self.inquiry is not None and self.session.state.endswith("calibration")
        answers = [self.device.inquire(self.inquiry.request)] if self.inquiry is not None and asks else []
        return answers + list(self.device.advance(self.device_ns))

    def run(self, seconds: float) -> Bench:
        for _ in range(round(seconds * 1e9 / STEP_NS)):
            self.now_ns += STEP_NS
            for data in [] if self.off else self.sent():
                self.deliver(self.told(data))
            for _ in range(9):
                due_ns = self.session.next_deadline()
                if due_ns is None or due_ns > self.now_ns:
                    break
                self.write(self.session.on_time(self.now_ns))
            else:
                pytest.fail("it never stops asking")
        return self

    def run_until_it_runs(self) -> Bench:
        for _ in range(400):
            if self.session.state == "running":
                return self
            self.run(0.05)
        pytest.fail(f"it does not run: {self.states}")

    def _note(self) -> None:
        if self.session.state not in self.states[-1:]:
            self.states.append(self.session.state)


def bench_of(name: str, **options: Any) -> Bench:
    """Return a bench of a device of slipd and its emulator.

    Args:
        name: Of the device.
        options: Of its session; of its emulator too, if that has them.
    """
    known = DEVICES[name]
    emulator: Any = make_emulator(name, 3, **({"wiring": options["wiring"]} if "wiring" in options else {}))
    assert known.session is not None
    session = known.session(**emulator.options | options)
    return Bench(session, emulator, known.inquiry() if known.inquiry is not None else None)


def nothing(_: bytes) -> bytes:
    """Lose everything."""
    return b""
