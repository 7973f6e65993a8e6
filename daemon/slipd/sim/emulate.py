"""Emulated devices on real lines, in real time: ``python -m slipd.sim.emulate DEVICE --at ADDRESS``.

A config that names the same address reads them as it would the device.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import gc
import os
import signal
import sys
import time
from collections.abc import AsyncIterator, Sequence
from contextlib import AsyncExitStack
from typing import Protocol, cast
from urllib.parse import urlsplit

from slipd.devices import DEVICES, Inquiry
from slipd.sim.device_line import Line, open_line
from slipd.sim.emulators import Emulator, make_emulator

TICK_NS = 1_000_000
"""How often lines are looked at and devices go on: a device answers within a millisecond."""

LONGEST_LAG_NS = 250_000_000
"""After a longer pause (a suspended machine) a device goes on where it stood instead of catching up."""

ANSWER_BYTES = 4096
"""Longest question of an inquiry."""

QUESTION_S = 1.0
"""How long it may take to arrive."""

HARDWARE_NICENESS = -10
"""Hardware is not late because the machine is busy: where this process may, it goes before others."""

STDIN = 0


class Inquired(Protocol):
    """An emulator that also answers inquiries."""

    def inquire(self, request: bytes) -> bytes:
        """Return the answer; empty for none."""
        ...


class Emulation:
    """Devices on their lines.

    Args:
        devices: Each device, and its end of its line.
    """

    def __init__(self, devices: Sequence[tuple[Emulator, Line]]) -> None:
        self._devices = devices

    async def run(self) -> None:
        """Go on for ever, in real time."""
        start_ns = now_ns = time.monotonic_ns()
        self._tell_begin(start_ns)
        while True:
            await asyncio.sleep(max(TICK_NS - (time.monotonic_ns() - now_ns), 0) * 1e-9)
            before_ns, now_ns = now_ns, time.monotonic_ns()
            if now_ns - before_ns > LONGEST_LAG_NS:
                start_ns += now_ns - before_ns
                self._tell_begin(start_ns)
            for device, line in self._devices:
                _go_on(device, line, now_ns - start_ns)

    def _tell_begin(self, start_ns: int) -> None:
        """Tell those whose readings carry this host's time."""
        for device, _ in self._devices:
            if hasattr(device, "began_ns"):
                device.began_ns = start_ns


def _go_on(device: Emulator, line: Line, t_ns: int) -> None:
    opened, heard = line.listen()
    if opened:
        device.opened(t_ns)
    said = [answer for data in heard for answer in device.receive(data, t_ns)]
    said += device.advance(t_ns)
    if said:
        line.send(said)


@contextlib.asynccontextmanager
async def emulated(devices: Sequence[tuple[str, Emulator, str]]) -> AsyncIterator[Emulation]:
    """Opens the lines of devices, and whatever else they serve.

    Args:
        devices: Name of each device in the list of devices, its emulator, and the address of its line.

    Raises:
        OSError: A line cannot be served at its address.
        ValueError: An address is none.
    """
    async with AsyncExitStack() as stack:
        lines = []
        for name, device, address in devices:
            lines.append((device, await stack.enter_async_context(open_line(address))))
            asked = _inquiry(name, device)
            if asked is not None:
                host = urlsplit(address).hostname
                await stack.enter_async_context(await _serve_inquiries(cast("Inquired", device), host, asked.port))
        yield Emulation(lines)


def _inquiry(name: str, device: Emulator) -> Inquiry | None:
    asks = DEVICES[name].inquiry
    return asks(**device.options) if asks is not None and hasattr(device, "inquire") else None


async def _serve_inquiries(device: Inquired, host: str | None, port: int) -> asyncio.Server:
    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(TimeoutError, ConnectionError):
            async with asyncio.timeout(QUESTION_S):
                writer.write(device.inquire(await reader.read(ANSWER_BYTES)))
                await writer.drain()
        writer.close()

    return await asyncio.start_server(answer, host, port)


def emulator_for(device: str, address: str, seed: int = 0) -> Emulator:
    """The emulator of a device on the kind of line that an address names.

    Raises:
        ValueError: The device is not known, or is not read at such an address.
    """
    if device not in DEVICES:
        raise ValueError(f"{device!r} is no device; known: {', '.join(sorted(DEVICES))}")
    kinds = {"udp": "udp", "tcp": "tcp", "ws": "websocket", "ipc": "external", "unix": "local"}
    transport = kinds.get(address.partition("://")[0], "serial") if "://" in address else "serial"
    if transport not in DEVICES[device].transports:
        raise ValueError(f"{device} is not read at {address}: it has {', '.join(DEVICES[device].transports)}")
    return make_emulator(device, seed, **({"wiring": transport} if DEVICES[device].needs_wiring else {}))


def main(argv: Sequence[str] | None = None) -> int:
    """Run one device until SIGTERM, SIGINT, or until standard input closes; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m slipd.sim.emulate", description="Run an emulated device.")
    parser.add_argument("device", metavar="DEVICE", help=", ".join(sorted(DEVICES)))
    parser.add_argument(
        "--at",
        required=True,
        metavar="ADDRESS",
        help="path of a pseudo-terminal to make, udp://HOST:PORT, tcp://HOST:PORT, ws://HOST:PORT, ipc:///PATH or unix:///PATH",
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of all noise (default 0)")
    options = parser.parse_args(argv)
    try:
        device = emulator_for(options.device, options.at, options.seed)
        prepare_process()
        asyncio.run(serve_until_told([(options.device, device, options.at)]))
    except (OSError, ValueError) as error:
        print(f"emulate: {error}", file=sys.stderr)
        return 2
    return 0


def prepare_process() -> None:
    """Make this process as prompt as hardware, once its devices are made."""
    with contextlib.suppress(PermissionError):
        os.setpriority(os.PRIO_PROCESS, 0, HARDWARE_NICENESS)
    gc.collect()
    gc.freeze()  # a collection is a pause that no device makes


async def serve_until_told(devices: Sequence[tuple[str, Emulator, str]]) -> None:
    """Serve devices, printing the address of each once all serve, until a signal or the end of standard input.

    Raises:
        OSError: A line cannot be served at its address.
        ValueError: An address is none.
    """
    loop, stop = asyncio.get_running_loop(), asyncio.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, stop.set)

    def hear() -> None:
        if not os.read(STDIN, ANSWER_BYTES):
            stop.set()

    with contextlib.suppress(PermissionError):  # a file, or nothing: it does not close
        loop.add_reader(STDIN, hear)
    async with emulated(devices) as emulation:
        for _, _, address in devices:
            print(address, flush=True)
        running = asyncio.create_task(emulation.run(), name="emulation")
        running.add_done_callback(lambda _: stop.set())
        await stop.wait()
        loop.remove_reader(STDIN)
        running.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await running


if __name__ == "__main__":
    sys.exit(main())
