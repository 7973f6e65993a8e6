"""``slipd emulate``: every device of a config on real lines, pressed by commands, which ``slipd touch`` sends.

Commands come from a script, from standard input, and from a local socket, one a line (`slipd.tools.sim.hand_commands`).
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import json
import socket
import tempfile
from collections.abc import Callable, Iterator, Mapping
from difflib import SequenceMatcher
from pathlib import Path
from typing import Any

from slipd import config
from slipd.config.config_file import ENCODING
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
from slipd.tools.sim.touched_devices import TouchedDevices, pad_reaches, with_other_port


def emulate_command(file: Path, folder: Path | None, script: Path | None, seed: int, *, unkind: bool = False) -> None:
    """Emulate the devices of a config until Ctrl-C, SIGTERM, ``quit`` or the end of standard input.

    Args:
        file: The config, or the name of a shipped one.
        folder: For its copy, the socket and the pseudo-terminals; created if missing. None: a temporary one. A copy
            that was changed, as by ``slipd commission``, is kept in the working directory.
        script: Commands to carry out first.
        seed: Seed of the noise.
        unkind: Whether the sensors are as unkind as real ones.

    Raises:
        ConfigError: The config has faults.
        SlipdError: A line cannot be served, or a line of the script is wrong.
        UsageError: The folder cannot be created.
    """
    if not file.exists() and file.name == str(file) and not file.suffix:
        file = shipped_config(str(file))
    rig = config.load(file)
    lines = _script_lines(script, rig)
    with contextlib.ExitStack() as stack:
        if folder is None:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="slipd-emulated-")))
        try:
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        except OSError as error:
            raise UsageError(f"--dir {folder}: cannot be created: {error.strerror}") from None
        try:
            _check_free(folder)
            devices = TouchedDevices(rig, folder.absolute(), seed, unkind=unkind)
            place = folder.absolute() / file.name
            stack.enter_context(emulated_copy(place, devices.config_text(), file, devices.addresses))
            prepare_process()
            asyncio.run(_serve(devices, place, lines))
        except (OSError, ValueError) as error:
            raise SlipdError(f"cannot emulate {file}: {error}") from error


def _check_free(folder: Path) -> None:
    """Raise if an emulation runs in a folder: it would lose its copy of the config, and its commands."""
    with socket.socket(socket.AF_UNIX) as line, contextlib.suppress(OSError):
        line.connect(str(folder / SOCKET))
        raise SlipdError(f"{folder}: an emulation runs there; end it, or give another --dir")


def _script_lines(script: Path | None, rig: config.Config) -> list[str]:
    """Return the commands of a script, once all are right."""
    if script is None:
        return []
    try:
        lines = script.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise UsageError(f"{script}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise UsageError(f"{script}: cannot be read: it is not UTF-8 text") from None
    fingers = pad_reaches(rig)
    for number, line in enumerate(lines, start=1):
        try:
            for part in line.partition("#")[0].split(";"):
                parse_command(part, fingers)
        except CommandError as error:
            raise SlipdError(f"{script}:{number}: {error}") from None
    return lines


async def _serve(devices: TouchedDevices, written: Path, script: list[str]) -> None:
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
            await run_until_ended(run(lines, desk.advance), desk.serve_script(script), stop=desk.stop)
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

    async def serve_script(self, script: list[str]) -> None:
        """Carry out the script, then the lines of standard input."""
        for line in script:
            await self.carry_out(line, print)
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


RECORD = ".{name}.emulated"
"""Name of the file beside the copy that holds the copy as it was written, and the config that it comes from."""


@contextlib.contextmanager
def emulated_copy(path: Path, text: str, source: Path, addresses: Mapping[str, str]) -> Iterator[None]:
    """Write the copy of a config for the time of the emulation; what changed in it then is kept.

    Args:
        path: Of the copy. One that an emulation left when it was killed is replaced, and its changes are kept.
        text: The copy.
        source: The config.
        addresses: Address of the emulated device of each port of the config.

    Raises:
        SlipdError: The copy would replace the config, or a file that no emulation wrote.
    """
    record_path = path.with_name(RECORD.format(name=path.name))
    if path.exists():
        if path.samefile(source):
            raise SlipdError(f"{path}: --dir must not be the folder of the config, whose copy would replace it")
        try:
            left = json.loads(record_path.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            raise SlipdError(f"{path} exists, and no emulation wrote it: move it away, or give another --dir") from None
        _keep_changes(path, left, "before the last emulation was killed")
    record = {"source": source.read_text(encoding=ENCODING), "copy": text, "addresses": dict(addresses)}
    for file, content in ((record_path, json.dumps(record)), (path, text)):
        file.unlink(missing_ok=True)
        file.touch(0o600, exist_ok=False)
        file.write_text(content, encoding="utf-8")
    try:
        yield
    finally:
        with contextlib.suppress(FileNotFoundError):
            _keep_changes(path, record, "meanwhile")
        path.unlink(missing_ok=True)
        record_path.unlink(missing_ok=True)


def _keep_changes(path: Path, record: Mapping[str, Any], when: str) -> None:
    try:
        now = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise SlipdError(f"{path}: changed {when}, and is not UTF-8 text now; it stays, move it away") from None
    if now != record["copy"]:
        text = with_changes(record["source"], record["copy"], now, record["addresses"])
        kept = keep(text, path.name, Path.cwd())
        print(f"the config was changed {when}; it is kept, with your ports, as {kept}", flush=True)


ENDING = ".commissioned"
"""Before the suffix of the name of a kept config."""


def with_changes(source: str, copy: str, now: str, addresses: Mapping[str, str]) -> str:
    """Return a config with the lines that changed in its copy; ports, identities and the bus stay its own.

    Args:
        source: The config.
        copy: Its copy as it was written, line for line, with the addresses of the emulated devices.
        now: The copy as it is now.
        addresses: Address of the emulated device of each port of ``source``.
    """
    before, after, lines = copy.splitlines(), now.splitlines(), source.splitlines()
    ports = {address: port for port, address in addresses.items()}
    found: list[str] = []
    for kind, first, last, new_first, new_last in SequenceMatcher(None, before, after, autojunk=False).get_opcodes():
        if kind == "equal":
            found += lines[first:last]
        else:
            found += [with_other_port(line, ports) for line in after[new_first:new_last]]
    return "\n".join(found) + "\n"


def keep(text: str, name: str, folder: Path) -> Path:
    """Write a config under a name that is free, and return its path.

    Args:
        text: The config.
        name: Name of the file that it comes from.
        folder: Where to write it; if that fails, a new temporary folder takes its place.

    Raises:
        OSError: The temporary folder cannot be written either.
    """
    try:
        return _write(text, name, folder)
    except OSError:
        return _write(text, name, Path(tempfile.mkdtemp(prefix="slipd-commissioned-")))


def _write(text: str, name: str, folder: Path) -> Path:
    stem, suffix = Path(name).stem, Path(name).suffix
    names = (f"{stem}{ENDING}{f'-{number}' if number > 1 else ''}{suffix}" for number in itertools.count(1))
    path = next(folder / name for name in names if not (folder / name).exists())
    with path.open("x", encoding="utf-8") as file:
        file.write(text)
    return path
