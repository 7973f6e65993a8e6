"""The copy of a config while its devices are emulated: what changed in it is kept, also if that is killed."""

from __future__ import annotations

import contextlib
import itertools
import json
import tempfile
from collections.abc import Iterator, Mapping
from difflib import SequenceMatcher
from pathlib import Path
from typing import Any

from slipd.config.config_file import ENCODING
from slipd.errors import SlipdError

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
        print(f"changed {when}: with your ports, the config is kept as {kept}", flush=True)


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


def with_other_port(line: str, others: Mapping[str, str]) -> str:
    """Return a line of a config with another port in place of its own, if ``others`` names one for it."""
    for port, other in others.items():
        for quoted in (json.dumps(port), f"'{port}'"):
            if quoted in line:
                return line.replace(quoted, json.dumps(other))
    return line
