"""A daemon with two devices on pseudo-terminals, in this process or in one of its own."""

from __future__ import annotations

import asyncio
import contextlib
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from daemon_peers import Client, Device
from known_zeros import keep_zeros
from loop_waits import PATIENCE_S, eventually
from rig_parts import endpoints_of

from slipd import config, service
from slipd.recording.reader import open_recording
from slipd.service_run import Endpoints

SLIPD = str(Path(sys.executable).with_name("slipd"))

RIG = """
[finger.left]
mu = 0.5

[finger.left.wrench]
device = "bota"
port = "{wrench}"
rate_hz = 100.0

[finger.left.pad]
device = "pvdf"
port = "{pad}"
rate_hz = 100.0
rows = 4
cols = 4
pitch_m = 0.004
electrode_m = 0.002
axis_scale = [0.01]
threshold = 0.05

[rates]
status_hz = 50.0
"""


class Rig:
    """Two devices on ptys, and the config of the daemon that reads them."""

    def __init__(self, folder: Path) -> None:
        self.wrench, self.pad = Device(folder / "wrench"), Device(folder / "pad")
        self.file = folder / "rig.toml"
        self.file.write_text(RIG.format(wrench=self.wrench.path, pad=self.pad.path), encoding="utf-8")
        keep_zeros(self.config)

    @property
    def config(self) -> config.Config:
        return config.load(self.file)

    def send(self) -> None:
        """Send one reading of each device, the image first."""
        self.pad.send_image()
        self.wrench.send_wrench()


@asynccontextmanager
async def serving(rig: config.Config, **options: Any) -> AsyncIterator[Client]:
    """Run the daemon in this loop for the duration of ``with``; yield a client."""
    ready: asyncio.Future[Endpoints] = asyncio.get_running_loop().create_future()
    stop = asyncio.Event()
    async with asyncio.TaskGroup() as tasks:
        tasks.create_task(service.serve(rig, on_ready=ready.set_result, stop=stop, **options))
        client = Client(await asyncio.wait_for(ready, PATIENCE_S))
        try:
            yield client
        finally:
            client.close()
            stop.set()


async def asked(client: Client, op: str) -> dict[str, Any]:
    """Return the reply to a request with a valid envelope; one that comes too late is sent again."""
    async with asyncio.timeout(PATIENCE_S):
        while True:
            client.ask(op="hello")
            hello = (await eventually(client.answer))["result"]
            client.ask(op=op, id=hello["t_ns"], boot=hello["boot"], deadline_ns=time.monotonic_ns() + 400_000_000)
            reply: dict[str, Any] = await eventually(client.answer)
            if reply["ok"] or reply["error"]["code"] != "deadline_passed":
                return reply


@contextlib.contextmanager
def started(
    rig: Path, *arguments: str, command: Sequence[str] = (SLIPD,), **options: Any
) -> Iterator[tuple[subprocess.Popen[str], Client]]:
    """Start a daemon process, which ends even if the test fails; once it serves, yield it and a client."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    run = [*command, "run", "--config", str(rig), *arguments]
    with subprocess.Popen(run, text=True, **(pipes | options)) as process:
        try:
            with contextlib.closing(Client(endpoints_of(process))) as client:
                yield process, client
        finally:
            process.kill()


def assert_complete(recording: Path) -> None:
    """Check that a recording lacks nothing."""
    recorded = open_recording(recording)
    assert sum(1 for _ in recorded.entries()) > 0
    assert recorded.complete
