"""The virtual gripper as a process, with lines that fail: seeded faults, one after another.

    python -m soak.faulty_gripper FOLDER SEED

Prints ``ready``; on SIGTERM it ends and prints how many faults of each kind there were.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from collections import Counter
from pathlib import Path
from random import Random

from slipd.tools.sim.device_line import PtyLine
from slipd.tools.sim.emulate import HARDWARE_NICENESS, LONGEST_LAG_NS
from slipd.tools.sim.scene import Scene
from slipd.tools.sim.virtual_gripper import LINES, TICK_NS, VirtualRig

KINDS = ("unplugged", "silent", "damaged", "noisy", "in bursts", "all stalled")
WEIGHTS = (6, 6, 6, 6, 1)
"""Of the lines: a gripper that fails ends the story."""

SHORTEST_S, LONGEST_S = 0.02, 0.8
PAUSES_S = (0.5, 2.5)
"""From the end of a fault to the next."""

QUIET_NS = 15_000_000_000
"""After this time the faults begin even if nobody activated the gripper, ns."""

HELD_BYTES = 65_536
"""A line that is held up keeps no more."""


class FaultyLines:
    """The lines between the devices and the daemon.

    Args:
        folder: Folder of the pseudo-terminals.
        rng: Chooses the faults.

    Attributes:
        faults: Number of faults by kind.
    """

    def __init__(self, folder: Path, rng: Random) -> None:
        self.faults: Counter[str] = Counter()
        self._folder, self._rng = folder, rng
        self._ports = {line: PtyLine(folder / line) for line in LINES}
        self._held = dict.fromkeys(LINES, b"")
        self._kind, self._struck = "", ""
        self._next_s = 0.0

    def step(self, now_s: float) -> None:
        """End a fault, or begin one, when it is time."""
        if now_s < self._next_s:
            return
        if self._kind:
            if self._kind == "unplugged":
                self._ports[self._struck] = PtyLine(self._folder / self._struck)
            self._kind = ""
            self._next_s = now_s + self._rng.uniform(*PAUSES_S)
            return
        self._kind, (self._struck,) = self._rng.choice(KINDS), self._rng.choices([*LINES], WEIGHTS)
        self.faults[self._kind] += 1
        self._next_s = now_s + self._rng.uniform(SHORTEST_S, LONGEST_S)
        if self._kind == "unplugged":
            self._ports.pop(self._struck).close()

    def read(self) -> tuple[list[str], dict[str, bytes]]:
        """Return the lines that have just been opened, and what the daemon wrote to each."""
        heard = {line: port.listen() for line, port in self._ports.items()}
        opened = [line for line, (has_opened, _) in heard.items() if has_opened]
        return opened, {line: b"".join(received) for line, (_, received) in heard.items() if received}

    def write(self, output: dict[str, bytes]) -> None:
        """Pass on what the devices send, as far as the fault lets it through."""
        for line, data in output.items():
            if line in self._ports:
                self._ports[line].send([self._passed(line, data)])

    def close(self) -> None:
        """Remove all lines, so that the daemon does not open another program's pseudo-terminals by their names."""
        for port in self._ports.values():
            port.close()

    def _passed(self, line: str, data: bytes) -> bytes:
        struck = line == self._struck
        if self._kind == "all stalled" or (struck and self._kind == "in bursts"):
            self._held[line] = (self._held[line] + data)[-HELD_BYTES:]
            return b""
        held, self._held[line] = self._held[line], b""
        data = held + data
        if not (data and struck and self._kind):
            return data
        if self._kind == "silent":
            return b""
        if self._kind == "noisy":
            return data + self._rng.randbytes(64)
        place = self._rng.randrange(len(data))
        return data[:place] + self._rng.randbytes(1) + data[place + 1 :]


def main() -> None:
    """Run until SIGTERM."""
    folder, seed = Path(sys.argv[1]), int(sys.argv[2])
    ended: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, _: ended.append(number))
    if os.geteuid() == 0:
        os.setpriority(os.PRIO_PROCESS, 0, HARDWARE_NICENESS)
    rig, lines = VirtualRig(Scene(), seed), FaultyLines(folder, Random(seed))
    print("ready", flush=True)
    begin_ns, t_ns = time.monotonic_ns(), 0
    while not ended:
        time.sleep(max(begin_ns + t_ns + TICK_NS - time.monotonic_ns(), 0) * 1e-9)
        opened, received = lines.read()
        for line in opened:
            rig.devices[line].opened(t_ns)
        output = {line: b"".join(rig.devices[line].receive(data, t_ns)) for line, data in received.items()}
        now_ns = time.monotonic_ns()
        begin_ns = max(begin_ns, now_ns - t_ns - LONGEST_LAG_NS)  # a busy machine: the scene goes on where it was
        while t_ns + TICK_NS <= now_ns - begin_ns:
            t_ns += TICK_NS
            for line, data in rig.advance(t_ns).items():
                output[line] = output.get(line, b"") + data
        if rig.began_ns is not None or t_ns > QUIET_NS:
            lines.step(t_ns * 1e-9)
        lines.write(output)
    lines.close()
    print(f"faults {json.dumps(lines.faults)}", flush=True)


if __name__ == "__main__":
    main()
