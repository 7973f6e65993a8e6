"""``slipd commission`` as a person uses it: in a terminal, with a daemon that admits only keys, on emulated devices."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import sys
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import numpy as np
import pytest
from commission_person import touch_for
from daemon_peers import PATIENCE_S, Client
from own_address import free_port, own_host
from service_rig import serving

from slipd import config
from slipd.tools.sim import touched_devices
from slipd.tools.sim.emulate import emulated
from slipd.tools.sim.hand_commands import parse_command
from slipd_client import keys

RIG = """# One finger.
[finger.left.wrench]
device = "bota"
port = "/dev/serial/by-id/left"
rate_hz = 100.0
sign = 1  # MEASURE
stale_s = 0.5
pad_from_sensor = { xyz_m = [0.004, -0.002, -0.025], quat_xyzw = [0.9659258, 0.2588190, 0.0, 0.0] }
"""
KEYED = """
[bus]
publish = "tcp://{host}:{publish}"
requests = "tcp://{host}:{requests}"
secret_key = "{folder}/daemon.key_secret"
readers = "{folder}/admitted"
requesters = "{folder}/admitted"
"""


def listing(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def make_keys(folder: Path) -> str:
    """Create the keys of the daemon and of a person; return the part of the config."""
    admitted = folder / "admitted"
    admitted.mkdir(mode=0o700)
    keys.create("daemon", folder)
    public, _ = keys.create("person", folder)
    public.rename(admitted / public.name)
    return KEYED.format(host=own_host(), publish=free_port(), requests=free_port(), folder=folder)


class Person:
    """Reads the terminal of the command, and touches the pads as it asks."""

    def __init__(self, touch: Callable[[str], None]) -> None:
        self._touch = touch
        self.lines: list[str] = []

    async def follow(self, file: Path, *options: str, until: str = "never") -> int:
        """Run the command, press Ctrl-C at a line that begins so, and return the exit code."""
        master, slave = os.openpty()
        command = [sys.executable, "-m", "slipd", "commission", str(file), *options]
        process = await asyncio.create_subprocess_exec(
            *command, stdin=slave, stdout=slave, stderr=slave, start_new_session=True
        )
        os.close(slave)
        reader = asyncio.StreamReader()
        transport, _ = await asyncio.get_running_loop().connect_read_pipe(
            lambda: asyncio.StreamReaderProtocol(reader), os.fdopen(master, "rb", buffering=0)
        )
        try:
            with contextlib.suppress(OSError):  # the command has ended
                async for line in reader:
                    self.lines.append(line.decode().rstrip())
                    if (touch := touch_for(self.lines[-1])) is not None:
                        self._touch(touch)
                    if self.lines[-1].startswith(until):
                        process.send_signal(signal.SIGINT)
            return await asyncio.wait_for(process.wait(), PATIENCE_S)
        finally:
            transport.close()
            if process.returncode is None:
                process.kill()
                await process.wait()

    @property
    def text(self) -> str:
        return "\n".join(self.lines)


@contextlib.asynccontextmanager
async def rig(folder: Path, bus: str = "") -> AsyncIterator[tuple[Path, Callable[[str], None], Client]]:
    """Run a daemon whose config has the wrong sign; yield the config, how to touch, and a client."""
    true = config.parse(RIG.replace("sign = 1", "sign = -1"), "rig")
    devices = touched_devices.TouchedDevices(true, folder)
    file = folder / "rig.toml"
    file.write_text(devices.config_text().replace("sign = -1", "sign = 1") + bus, encoding="utf-8")
    now_ns = 0

    def advance(t_ns: int) -> None:
        nonlocal now_ns
        now_ns = t_ns
        devices.advance(t_ns)

    def touch(line: str) -> None:
        for part in line.split(";"):
            command = parse_command(part, devices.hand.fingers)
            assert command is not None
            devices.hand.carry_out(command, now_ns * 1e-9)

    async with emulated(devices.devices, advance) as emulation:
        running = asyncio.create_task(emulation.run())
        try:
            async with serving(config.load(file)) as daemon:
                yield file, touch, daemon
        finally:
            running.cancel()
            await asyncio.wait([running])


@pytest.fixture(autouse=True)
def unbiased(runtime: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The force sensor reads about zero: with a wrong sign, its bias may look like a contact, which cannot be tared."""
    monkeypatch.setattr(touched_devices, "BIAS", np.zeros(6))


async def test_what_is_found_is_written_with_a_backup_where_the_daemon_admits_only_keys(tmp_path: Path) -> None:
    async with rig(tmp_path, make_keys(tmp_path)) as (file, touch, _):
        before, listed = file.read_text(), listing(tmp_path)
        person = Person(touch)
        secret = str(tmp_path / "person.key_secret")
        assert await person.follow(file, "--key", secret, until="Now restart the daemon") == 130
        previous = tmp_path / "rig.toml.previous"
        assert listing(tmp_path) == sorted([*listed, previous.name])
        assert previous.read_text() == before
        assert file.read_text() == before.replace("sign = 1  # MEASURE", "sign = -1  # slipd commission")
    assert "not taken" not in person.text
