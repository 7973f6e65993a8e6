"""``slipd emulate``: every device of a config on real lines, pressed by commands, which ``slipd touch`` sends.

Commands come from standard input and from a local socket, one a line (`slipd.tools.sim.hand_commands`).
"""

from __future__ import annotations

import asyncio
import contextlib
import socket
import tempfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

from slipd import config
from slipd.errors import SlipdError, UsageError
from slipd.tools.shipped_files import shipped_config
from slipd.tools.sim.emulate import (
    LONGEST_LINE,
    emulated,
    lines_of,
    prepare_process,
    run,
    run_until_ended,
    standard_input,
)
from slipd.tools.sim.hand import PadLoad
from slipd.tools.sim.hand_commands import END, ERROR, HELP, OK, SOCKET, CommandError, parse_command
from slipd.tools.sim.touched_devices import TouchedDevices


def emulate_command(file: Path, folder: Path | None, seed: int, *, unkind: bool = False) -> None:
    """Emulate the devices of a config until Ctrl-C, SIGTERM, ``quit`` or the end of standard input.

    Args:
        file: The config, or the name of a shipped one.
        folder: For its copy, the socket and the pseudo-terminals; created if missing. None: a temporary one. A copy
            that was changed, as by ``slipd commission``, stays there.
        seed: Seed of the noise.
        unkind: Whether the sensors are as unkind as real ones.

    Raises:
        ConfigError: The config has faults.
        SlipdError: A line cannot be served, or the copy would replace a file that no emulation wrote.
        UsageError: The folder cannot be created, or an emulation runs there.
    """
    if not file.exists() and file.name == str(file) and not file.suffix:
        file = shipped_config(str(file))
    rig = config.load(file)
    temporary = folder is None
    folder = Path(tempfile.mkdtemp(prefix="slipd-emulated-")) if folder is None else folder
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    except OSError as error:
        raise UsageError(f"--dir {folder}: cannot be created: {error.strerror}") from None
    try:
        _check_free(folder)
        devices = TouchedDevices(rig, folder.absolute(), seed, unkind=unkind)
        place = folder.absolute() / file.name
        with emulated_copy(place, devices.config_text(), file):
            prepare_process()
            asyncio.run(_serve(devices, place))
    except (OSError, ValueError) as error:
        raise SlipdError(f"cannot emulate {file}: {error}") from error
    finally:
        if temporary:
            with contextlib.suppress(OSError):  # a copy that was changed stays in it
                folder.rmdir()


def _check_free(folder: Path) -> None:
    """Raise if an emulation runs in a folder: it would lose its copy of the config, and its commands."""
    with socket.socket(socket.AF_UNIX) as line, contextlib.suppress(OSError):
        line.connect(str(folder / SOCKET))
        raise UsageError(f"{folder}: an emulation runs there; end it, or give another --dir")


async def _serve(devices: TouchedDevices, written: Path) -> None:
    desk = _Desk(devices)
    place = written.with_name(SOCKET)
    async with emulated(devices.devices) as lines:
        place.unlink(missing_ok=True)
        server = await asyncio.start_unix_server(desk.serve_client, place, limit=LONGEST_LINE)
        place.chmod(0o600)
        for name, _, address in devices.devices:
            print(f"{name}: {address}")
        print(f"commands: slipd touch {place.parent} help\nby mouse: slipctl view --emulation {place.parent}")
        print(f"config: {written}", flush=True)
        try:
            await run_until_ended(run(lines, desk.advance), desk.serve_standard_input(), stop=desk.stop)
        finally:
            server.close()
            place.unlink(missing_ok=True)


class _Desk:
    """Carries out commands in the time of the emulation."""

    def __init__(self, devices: TouchedDevices) -> None:
        self._devices, self._t_ns = devices, 0
        self.stop = asyncio.Event()

    def advance(self, t_ns: int) -> None:
        self._t_ns = t_ns
        self._devices.advance(t_ns)

    async def serve_standard_input(self) -> None:
        async for line in standard_input():
            await self.carry_out(line, lambda text: print(text, flush=True))

    async def serve_client(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        def answer(text: str) -> None:
            writer.write(f"{text}\n".encode())

        with contextlib.suppress(ConnectionError, asyncio.CancelledError):  # cancelled: the emulation ends
            async for line in lines_of(reader):
                if await self.carry_out(line, answer):
                    answer(END if self.stop.is_set() else OK)
                await writer.drain()
        writer.close()

    async def carry_out(self, line: str, answer: Callable[[str], None]) -> bool:
        """Carry out the commands of a line; return whether all are right."""
        try:
            for part in line.partition("#")[0].split(";"):
                await self._one(part, answer)
        except CommandError as error:
            answer(f"{ERROR}{error}")
            return False
        return True

    async def _one(self, text: str, answer: Callable[[str], None]) -> None:
        command = parse_command(text, self._devices.fingers)
        if command is None:
            return
        if command.verb == "wait":
            await asyncio.sleep(command.seconds)
        elif command.verb == "quit":
            self.stop.set()
        elif command.verb == "help":
            answer(HELP)
        elif command.verb == "show":
            for name, load in self._devices.loads(self._t_ns).items():
                answer(load_text(name, load))
        else:
            self._devices.hand.carry_out(command, self._t_ns * 1e-9)


def load_text(name: str, load: PadLoad) -> str:
    """Return the load on a finger as a line for people."""
    if load.normal_n == 0.0:
        return f"{name}: nothing touches"
    (x, y), (fx, fy) = load.place_m, load.tangential_n
    return (
        f"{name}: normal {load.normal_n:.2f} N at {1e3 * x:.1f}, {1e3 * y:.1f} mm, "
        f"tangential {fx:.2f}, {fy:.2f} N, spin {1e3 * load.spin_nm:.1f} mN·m"
    )


HEAD = "# Copy of a config, with the addresses of emulated devices. Checksum of the lines below: {:08x}"
"""First line of a copy: by its checksum, a copy that was changed is known."""


@contextlib.contextmanager
def emulated_copy(path: Path, text: str, source: Path) -> Iterator[None]:
    """Write the copy of a config for the time of the emulation; if it was changed then, it stays under another name.

    Args:
        path: Of the copy. One that an emulation left when it was killed makes room for it likewise.
        text: The copy.
        source: The config.

    Raises:
        SlipdError: The copy would replace the config, or a file that no emulation wrote.
    """
    if path.exists():
        if path.samefile(source):
            raise SlipdError(f"{path}: --dir must not be the folder of the config, whose copy would replace it")
        _put_away(path)
    path.touch(0o600, exist_ok=False)
    path.write_text(f"{HEAD.format(zlib.crc32(text.encode()))}\n{text}", encoding="utf-8")
    try:
        yield
    finally:
        with contextlib.suppress(FileNotFoundError):
            _put_away(path)


def _put_away(path: Path) -> None:
    """Delete a copy, or rename it if it was changed."""
    first, _, text = path.read_bytes().partition(b"\n")
    if not first.startswith(HEAD.partition("{")[0].encode()):
        raise SlipdError(f"{path} exists, and no emulation wrote it: move it away, or give another --dir")
    if first == HEAD.format(zlib.crc32(text)).encode():
        path.unlink()
        return
    kept, number = path.with_stem(f"{path.stem}.commissioned"), 2
    while kept.exists():
        kept, number = path.with_stem(f"{path.stem}.commissioned-{number}"), number + 1
    path.rename(kept)
    print(f"the config was changed; it is kept, with the addresses of the emulated devices, as {kept}", flush=True)
