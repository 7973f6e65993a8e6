"""A session of a Weiss tactile sensor against its emulated controller."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest

from slipd.devices import dsacon32, wts
from slipd.devices.shared.weiss_tactile import TactileSession
from slipd.tools.sim.emulated_dsacon32 import Dsacon32
from slipd.tools.sim.emulated_wts import WeissController, WtsModule
from slipd.types.samples import TactileSample

MS = 1_000_000


S = 1_000_000_000


@dataclass
class Bench:
    """Run session and controller in steps of 10 ms.

    The session receives ``mend(answer)`` instead of an answer.
    """

    session: TactileSession
    device: WeissController
    now_ns: int = 0
    written: list[bytes] = field(default_factory=list)
    states: list[str] = field(default_factory=list)
    samples: list[TactileSample] = field(default_factory=list)
    mend: Callable[[bytes], bytes] = bytes

    def start(self) -> None:
        self.write(self.session.start(self.now_ns))

    def write(self, data: bytes) -> None:
        self.note()
        if data:
            self.written.append(data)
            for answer in self.device.receive(data, self.now_ns):
                self.deliver(self.mend(answer))

    def deliver(self, data: bytes) -> None:
        if data:
            self.samples += self.session.receive(data, self.now_ns)
        self.note()

    def note(self) -> None:
        if not self.states or self.states[-1] != self.session.state:
            self.states.append(self.session.state)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds * 100)):
            self.now_ns += 10 * MS
            for data in self.device.advance(self.now_ns):
                self.deliver(data)
            for _ in range(20):
                due = self.session.next_deadline()
                if due is None or due > self.now_ns:
                    break
                self.write(self.session.on_time(self.now_ns))
            else:
                pytest.fail("it never stops asking")


def dsacon_bench() -> Bench:
    made = Dsacon32([(4, 2), (2, 2)], np.random.default_rng(0), noise_counts=0.0)
    made.press(np.arange(12))
    return Bench(dsacon32.Session(), made)


def wts_bench() -> Bench:
    return Bench(wts.Session(), WtsModule(wts.Matrix(), np.random.default_rng(0), noise_counts=0.0))


def of(packet_id: int, wrong: bytes) -> Callable[[bytes], bytes]:
    """Return a function that replaces every answer with the id by ``wrong``."""
    return lambda answer: wrong if answer[3] == packet_id else answer


both = pytest.mark.parametrize("make", [dsacon_bench, wts_bench])
