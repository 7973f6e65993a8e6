"""Run emulated devices on real lines, in real time; a daemon whose config has their addresses reads them as devices."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import os
import signal
import stat
import sys
import time
from collections.abc import AsyncIterator, Callable, Coroutine, Sequence
from contextlib import AsyncExitStack
from typing import Any
from urllib.parse import urlsplit

from slipd.devices import DEVICES
from slipd.tools.sim.device_line import Line, open_line
from slipd.tools.sim.emulators import Emulator

TICK_NS = 1_000_000
"""Period at which lines are read and devices advance, ns: a device answers within a millisecond."""

LONGEST_LAG_NS = 250_000_000
"""After a longer pause, ns, what devices sent meanwhile is lost, as on a line that overflows. Their clocks went on."""

SUSPENDED_NS = 10_000_000_000
"""After a longer pause, ns, such as a suspended machine, the devices continue where they were."""

ANSWER_BYTES = 4096
"""Longest request of an inquiry."""

QUESTION_S = 1.0
"""Longest wait for that request, s."""

LONGEST_LINE = 1000
"""Longest line of a script or of standard input, bytes."""

HARDWARE_NICENESS = -10
"""Niceness of this process if permitted, because hardware is not late on a busy machine."""


Lines = list[tuple[Emulator, Line]]
"""Emulated devices, each with its line."""


async def run(devices: Lines, load: Callable[[int], None] = lambda _: None) -> None:
    """Run devices for ever, in real time.

    Args:
        devices: Each device with its line.
        load: Called with the time in ns before the devices advance to it, to change the loads on them.
    """
    start_ns = now_ns = time.monotonic_ns()
    while True:
        await asyncio.sleep(max(TICK_NS - (time.monotonic_ns() - now_ns), 0) * 1e-9)
        before_ns, now_ns = now_ns, time.monotonic_ns()
        lag_ns = now_ns - before_ns
        if lag_ns > SUSPENDED_NS:
            start_ns += lag_ns
        for device, _ in devices:
            if hasattr(device, "began_ns"):
                device.began_ns = start_ns  # its readings carry the time of this host
        load(now_ns - start_ns)
        for device, line in devices:
            _advance(device, line, now_ns - start_ns, lost=lag_ns > LONGEST_LAG_NS)


def _advance(device: Emulator, line: Line, t_ns: int, *, lost: bool) -> None:
    opened, received = line.listen()
    if opened:
        device.opened(t_ns)
    output = [answer for data in received for answer in device.receive(data, t_ns)]
    sent = device.advance(t_ns)
    output += [] if lost else sent
    if output:
        line.send(output)


@contextlib.asynccontextmanager
async def emulated(devices: Sequence[tuple[str, Emulator, str]]) -> AsyncIterator[Lines]:
    """Open the lines of devices, and the servers of their inquiries.

    Args:
        devices: Name of each device in the list of devices, its emulator, and the address of its line.

    Raises:
        OSError: A line cannot be served at its address.
        ValueError: An address is invalid.
    """
    async with AsyncExitStack() as stack:
        lines: Lines = []
        for name, device, address in devices:
            lines.append((device, await stack.enter_async_context(open_line(address))))
            make = DEVICES[name].inquiry if hasattr(device, "inquire") else None
            inquiry = None if make is None else make(**device.options)
            if inquiry is not None:
                host = urlsplit(address).hostname
                await stack.enter_async_context(await _serve_inquiries(device, host, inquiry.port))
        yield lines


async def _serve_inquiries(device: Any, host: str | None, port: int) -> asyncio.Server:
    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(TimeoutError, ConnectionError):
            async with asyncio.timeout(QUESTION_S):
                writer.write(device.inquire(await reader.read(ANSWER_BYTES)))
                await writer.drain()
        writer.close()

    return await asyncio.start_server(answer, host, port)


def prepare_process() -> None:
    """Make this process as prompt as hardware; call it once its devices exist."""
    with contextlib.suppress(PermissionError):
        os.setpriority(os.PRIO_PROCESS, 0, HARDWARE_NICENESS)
    gc.collect()
    gc.freeze()  # no device pauses for a garbage collection


async def run_until_ended(*parts: Coroutine[Any, Any, None], stop: asyncio.Event | None = None) -> None:
    """Run parts until one of them ends, a signal comes, or ``stop`` is set; raise the fault of a part."""
    loop, stop = asyncio.get_running_loop(), stop or asyncio.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, stop.set)
    tasks = [asyncio.create_task(part) for part in (*parts, stop.wait())]
    await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    for task in tasks:
        task.cancel()
    for result in await asyncio.gather(*tasks, return_exceptions=True):
        if isinstance(result, Exception):
            raise result


async def serve_until_ended(
    devices: Sequence[tuple[str, Emulator, str]],
    load: Callable[[int], None] = lambda _: None,
    hear: Callable[[str], None] = lambda _: None,
    ready: Callable[[], None] = lambda: None,
) -> Lines:
    """Serve devices until a signal or the end of standard input; return them with their lines, which are closed.

    Args:
        devices: See `emulated`.
        load: See `run`.
        hear: Called with each line of the standard input.
        ready: Called once all are served.

    Raises:
        OSError: A line cannot be served at its address.
        ValueError: An address is invalid.
    """

    async def listen() -> None:
        async for line in standard_input():
            hear(line)

    async with emulated(devices) as lines:
        ready()
        await run_until_ended(run(lines, load), listen())
    return lines


async def standard_input() -> AsyncIterator[str]:
    """Yield the lines of standard input; wait forever without standard input, as in the background."""
    try:
        mode = os.fstat(sys.stdin.fileno()).st_mode
    except (OSError, ValueError, AttributeError):
        mode = stat.S_IFCHR
    if stat.S_ISREG(mode):
        for line in sys.stdin:
            yield line
    elif stat.S_ISCHR(mode) and not sys.stdin.isatty():
        await asyncio.Event().wait()
    else:
        reader = asyncio.StreamReader(limit=LONGEST_LINE)
        loop = asyncio.get_running_loop()
        transport, _ = await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
        try:
            async for line in lines_of(reader):
                yield line
        finally:
            transport.close()


async def lines_of(reader: asyncio.StreamReader) -> AsyncIterator[str]:
    """Yield the lines of a stream; one that is too long counts as its end."""
    with contextlib.suppress(ValueError, ConnectionError):
        while data := await reader.readline():
            yield data.decode(errors="replace")
