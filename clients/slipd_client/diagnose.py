"""``slipctl diagnose``: one file with everything that a person who helps needs, without secrets."""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import platform
import re
import shutil
import stat
import subprocess
import sys
import tarfile
import tempfile
import time
from collections.abc import Callable
from importlib import metadata
from pathlib import Path

from slipd_client.errors import CallError, SlipdClientError
from slipd_client.grip import GripClient
from slipd_client.keys import Keys
from slipd_client.paths import log_file, trust_faults
from slipd_client.repairs import repairs
from slipd_client.subscriber import Subscriber

MOST_RECORDING_BYTES = 200_000_000
"""A longer recording is left out: the bundle is sent by mail or chat."""

LOG_LINES = 5000
PACKAGES = ("slipd", "slipd-client", "pyzmq", "msgpack", "numpy", "scipy", "numba", "pyserial", "websockets")

NOT_INSTALLED = "not installed here"

REMOVED = "(removed)"

_NAMED = r"secret|password|passwd|passphrase|token|credential|authorization|api[_-]?key"
_SECRET_VALUES = re.compile(
    rf"(?i)([\w.-]*(?:{_NAMED})[\w.-]*[\"']?\s*[=:]\s*)"
    r"(?:(\")[^\"\n]*\"|(')[^'\n]*'|(?:basic |bearer )?[^\s&,;}\])]+)"
)
_KEYS = re.compile(
    r"(?<![0-9A-Za-z.\-:+=^!/*?&<>()\[\]{}@%$#])((?:[\w-]+[=:]|\()?)[0-9A-Za-z.\-:+=^!/*?&<>()\[\]{}@%$#]{40}"
    r"(?=[\"'\s,;)]|$)"
)
"""Keys of ZeroMQ as text (Z85), by their length; most punctuation may be part of one."""

_USERS = re.compile(r"(\w+://)[^/\s@]+@")
_RECORDING = re.compile(rb"\x89MCAP0\r\n\x01.{8}\x05\0\0\0slipd", re.DOTALL)
"""Start of a recording: magic bytes of MCAP, and a header with the profile of slipd."""

_HOMES = re.compile(r"/(?:home|Users)/[\w.-]+")


def without_secrets(text: str) -> str:
    """Return a text without passwords, tokens, keys, the users of addresses and the names of home directories."""
    text = _SECRET_VALUES.sub(rf"\1\2\3{REMOVED}\2\3", text)
    text = _USERS.sub(rf"\1{REMOVED}@", text)
    text = _KEYS.sub(lambda found: found[0] if found[0].startswith(("/", "./")) else found[1] + REMOVED, text)
    return _HOMES.sub("~", text)


class Bundle:
    """Collects parts; a part that cannot be had is listed in ``problems.txt``, with the reason."""

    def __init__(self) -> None:
        self.parts: dict[str, bytes] = {}
        self.problems: list[str] = []

    def add(self, name: str, collect: Callable[[], str]) -> None:
        """Add a text without its secrets."""
        try:
            self.parts[name] = without_secrets(collect()).encode("utf-8", "replace")
        except (OSError, SlipdClientError, subprocess.SubprocessError) as error:
            self.problems.append(f"{name}: {error}")

    def add_recording(self, path: Path) -> None:
        """Add a recording of this user without its secrets; a daemon could name any file, so any other is left out."""
        try:
            fault = _fault_of_recording(path) or self._add_clean(path)
        except OSError as error:
            fault = str(error)
        if fault:
            self.problems.append(f"{path}: left out: {fault}")

    def _add_clean(self, recording: Path) -> str:
        """Add a recording without its secrets, which only slipd itself can rewrite; return why that failed, or ""."""
        with tempfile.TemporaryDirectory() as folder:
            clean = Path(folder, recording.name)
            command = [sys.executable, "-m", "slipd", "recover", str(recording), str(clean), "--without-secrets"]
            done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603
            if done.returncode:
                why = (done.stderr or done.stdout).strip().rpartition("\n")[2]
                return f"slipd cannot remove its secrets: {why}"
            self.parts[recording.name] = clean.read_bytes()
        return ""

    def write(self, path: Path) -> None:
        """Write a new file that only this user can read.

        Raises:
            CallError: The file exists, or cannot be written.
        """
        parts = self.parts | {"problems.txt": "".join(f"{line}\n" for line in self.problems).encode()}
        try:
            with path.open("xb") as file:
                path.chmod(0o600)
                with tarfile.open(fileobj=file, mode="w:gz") as archive:
                    for name, data in parts.items():
                        member = tarfile.TarInfo(f"{path.name.removesuffix('.tar.gz')}/{name}")
                        member.size, member.mtime, member.mode = len(data), int(time.time()), 0o600
                        archive.addfile(member, io.BytesIO(data))
        except FileExistsError:
            raise CallError(f"{path}: exists, and is not overwritten; name another file") from None
        except OSError as error:
            with contextlib.suppress(OSError):
                path.unlink()
            raise CallError(f"{path}: cannot be written: {error.strerror}") from error


def run(chosen: argparse.Namespace, keys: Keys | None) -> None:
    """Write the bundle and print what is in it; a daemon that does not answer is a problem like any other.

    Before it is written, a person at a terminal is asked, unless the list is printed as JSON.

    Raises:
        CallError: The file exists, or cannot be written.
    """
    out: Path = chosen.out
    if out.exists():
        raise CallError(f"{out}: exists, and is not overwritten; name another file")
    bundle = Bundle()
    bundle.add("versions.json", _versions)
    recordings: list[str] = []

    def status() -> str:
        with GripClient(chosen.requests, keys=keys) as client:
            reply = client.status()
        recordings.extend(part.path for part in (reply.recording, reply.run_recording) if part and part.path)
        return json.dumps({**reply, "repairs": [repair.as_map() for repair in repairs(reply)]}, indent=1)

    bundle.add("status.json", status)
    bundle.add("messages.jsonl", lambda: _messages(chosen.publish, keys, chosen.seconds))
    if chosen.config is not None:
        bundle.add("config.toml", lambda: chosen.config.read_text(encoding="utf-8", errors="replace"))
    bundle.add("log.txt", _log)
    for path in recordings:
        bundle.add_recording(Path(path))
    if chosen.json:
        bundle.write(out)
        sizes = {name: len(data) for name, data in bundle.parts.items()}
        print(json.dumps({"file": str(out), "bytes": sizes, "problems": bundle.problems}))
        return
    for name, data in bundle.parts.items():
        print(f"{name}: {len(data)} bytes")
    for problem in bundle.problems:
        print(f"not in it: {problem}")
    if sys.stdin.isatty():
        input(f"Enter writes this to {out}, Ctrl-C writes nothing ")
    bundle.write(out)
    print(f"{out}: written")


def _fault_of_recording(path: Path) -> str:
    """Return why a file is not a recording of slipd that this user, and nobody else, could have written; "" if it is.

    Raises:
        OSError: It cannot be read.
    """
    found = path.lstat()
    if not stat.S_ISREG(found.st_mode) or found.st_uid != os.geteuid():
        return "it must be a file of the user who runs this command"
    if faults := trust_faults(path):
        return "; ".join(faults)
    with path.open("rb") as file:
        if not _RECORDING.match(file.read(64)):
            return "it is not a recording of slipd"
    if found.st_size > MOST_RECORDING_BYTES:
        return f"it has {found.st_size} bytes, and the most is {MOST_RECORDING_BYTES}"
    return ""


def _versions() -> str:
    found = {"python": sys.version, "platform": platform.platform(), "libc": " ".join(platform.libc_ver())}
    for package in PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            found[package] = NOT_INSTALLED
    if found["slipd-client"] == NOT_INSTALLED != found["slipd"]:
        found["slipd-client"] = f"{found['slipd']} (in slipd)"  # the wheel of the daemon contains the client
    return json.dumps(found, indent=1)


def _messages(endpoint: str | None, keys: Keys | None, seconds: float) -> str:
    lines, until_s = [], time.monotonic() + seconds
    with Subscriber(endpoint, keys=keys, silence_s=None) as subscriber:
        while (left_s := until_s - time.monotonic()) > 0.0:
            message = subscriber.receive(left_s)
            if message is not None:
                lines.append(json.dumps({"topic": message.topic, **message.raw}))
    return "".join(f"{line}\n" for line in lines)


def _log() -> str:
    """Return the end of the log: of the service, of the system and of this user, and the file of a run without it."""
    found = ""
    if program := shutil.which("journalctl"):
        for unit in (("--unit", "slipd"), ("--user-unit", "slipd")):
            command = [program, *unit, "--lines", str(LOG_LINES), "--no-pager", "--output", "short-iso-precise"]
            done = subprocess.run(command, capture_output=True, text=True, timeout=20.0, check=False)  # noqa: S603
            found += f"== {' '.join(unit)}\n{done.stdout}{done.stderr}"
    for path in (Path(f"{log_file()}.1"), log_file()):
        if path.is_file():
            lines = path.read_text(encoding="utf-8", errors="replace").splitlines(keepends=True)
            found += f"== {path}\n{''.join(lines[-LOG_LINES:])}"
    if not found:
        raise FileNotFoundError(f"there is no journalctl here and no {log_file()}: add the output of slipd yourself")
    return found
