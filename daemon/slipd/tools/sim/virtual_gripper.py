"""The virtual gripper as a process: five pseudo-terminals with the bytes of real devices, and the true state.

One loop without threads advances the scene 800 times per second and writes the bytes of the devices. A late wake-up
catches up at once, so that the rates never drift.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import select
import signal
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

from slipd.tools.sim.pseudo_terminal import PseudoTerminal
from slipd.tools.sim.scene import Scene
from slipd.tools.sim.virtual_rig import LINES, VirtualRig

TICK_NS = 1_250_000
"""Period of the force sensors with their shortest filter, ns."""

LONGEST_LAG_NS = 500_000_000
"""After a longer pause, ns, such as a suspended machine, the scene continues where it was instead of catching up."""

STDIN = 0

HARDWARE_NICENESS = -10
"""Niceness of this process if permitted, because hardware is not late on a busy machine."""


class VirtualGripper:
    """Run a virtual rig on its lines.

    Args:
        rig: The scene and its devices.
        ports: Pseudo-terminal of each line.
        report: Called with each event: a map with ``t_s`` (scene), ``t_ns`` (CLOCK_MONOTONIC) and ``event``.
    """

    def __init__(
        self, rig: VirtualRig, ports: dict[str, PseudoTerminal], report: Callable[[dict[str, Any]], None]
    ) -> None:
        self._rig, self._ports, self._report = rig, ports, report
        self._poll = select.poll()
        self._poll.register(STDIN, select.POLLIN)
        self._by_fd = {port.fd: (line, port) for line, port in ports.items()}
        for fd in self._by_fd:
            self._poll.register(fd, select.POLLIN)
        self._stopped = False
        self._begun = False

    def stop(self) -> None:
        """Stop at the next tick; safe in a signal handler."""
        self._stopped = True

    def run(self, seconds: float | None = None) -> None:
        """Run until stopped, until standard input closes, or for ``seconds``."""
        start_ns, ticks = time.monotonic_ns(), 0
        while not self._stopped and (seconds is None or ticks * TICK_NS < seconds * 1e9):
            next_ns = start_ns + (ticks + 1) * TICK_NS
            time.sleep(max(next_ns - time.monotonic_ns(), 0) * 1e-9)
            lag_ns = time.monotonic_ns() - next_ns
            if lag_ns > LONGEST_LAG_NS:
                start_ns, lag_ns = start_ns + lag_ns, 0
            output = self._listen(ticks * TICK_NS)
            for _ in range(1 + lag_ns // TICK_NS):
                ticks += 1
                for line, data in self._rig.advance(ticks * TICK_NS).items():
                    output[line] += data
                self._report_news(start_ns)
            for line, data in output.items():
                self._ports[line].write(data)

    def _listen(self, t_ns: int) -> dict[str, bytes]:
        """Read every line; return the answers."""
        output = dict.fromkeys(LINES, b"")
        received = dict(self._poll.poll(0))
        if STDIN in received and not os.read(STDIN, 4096):
            self._stopped = True
        for fd, (line, port) in self._by_fd.items():
            events = received.get(fd, 0)
            if port.update(events):
                self._rig.opened(line, t_ns)
            if events & select.POLLIN and (data := port.read()):
                output[line] = self._rig.receive(line, data, t_ns)
        return output

    def _report_news(self, start_ns: int) -> None:
        began_ns = self._rig.began_ns
        if began_ns is None:
            return
        if not self._begun:
            self._begun = True
            self._report({"t_s": 0.0, "t_ns": start_ns + began_ns, "event": "begin"})
        for truth in self._rig.news():
            t_ns = start_ns + began_ns + round(truth.t_s * 1e9)
            self._report({"t_s": round(truth.t_s, 4), "t_ns": t_ns, "event": truth.event, **truth.values})


def main(argv: Sequence[str] | None = None) -> int:
    """Run the virtual gripper until SIGTERM, SIGINT, or the end of standard input."""
    parser = argparse.ArgumentParser(prog="python -m slipd.tools.sim.virtual_gripper", description=main.__doc__)
    parser.add_argument(
        "--dir", type=Path, required=True, help="directory of the pseudo-terminals: " + ", ".join(LINES)
    )
    parser.add_argument("--seed", type=int, default=0, help="seed of the noise (default 0)")
    parser.add_argument("--seconds", type=float, help="end after this time, s (default: never)")
    options = parser.parse_args(argv)
    options.dir.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:
        ports: dict[str, PseudoTerminal] = {}
        for line in LINES:
            ports[line] = PseudoTerminal(options.dir / line)
            stack.callback(ports[line].close)
        rig = VirtualRig(Scene(), options.seed)
        gripper = VirtualGripper(rig, ports, _print)
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda *_: gripper.stop())
        with suppress(PermissionError):
            os.setpriority(os.PRIO_PROCESS, 0, HARDWARE_NICENESS)
        gc.collect()
        gc.freeze()
        paths = {line: str(port.path) for line, port in ports.items()}
        try:
            _print({"t_s": None, "t_ns": time.monotonic_ns(), "event": "ready", "ports": paths})
            gripper.run(options.seconds)
            dropped = {line: port.dropped for line, port in ports.items()}
            _print({"t_s": rig.scene.t_s, "t_ns": time.monotonic_ns(), "event": "end", "dropped_bytes": dropped})
        except BrokenPipeError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # the reader is gone: end without an error
    return 0


def _print(event: dict[str, Any]) -> None:
    print(json.dumps(event), flush=True)


if __name__ == "__main__":
    sys.exit(main())
