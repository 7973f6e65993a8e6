"""Lists and prints what comes with slipd: configs, pages, files for the system; and what ``slipd`` alone prints."""

from __future__ import annotations

import json
import shutil
import textwrap
from pathlib import Path

from slipd import __version__
from slipd.config.config_file import (
    CONFIGS,
    DOCS,
    config_file,
    config_files,
    page_file,
    pages,
    system_file,
    system_files,
)
from slipd.tools.service_command import own_program, with_program

FIRST_STEPS = f"""\
slipd {__version__} warns a robot that its gripper is about to drop something.

Without hardware:
    slipd demo                       run the daemon on a virtual gripper

With your rig:
    slipd init my_rig.toml           find the devices on the serial ports, and write a first config
    slipd check my_rig.toml          report every fault in it
    slipd run my_rig.toml            run the daemon
    slipd commission my_rig.toml     find mounting, weight and friction, in another terminal
    slipctl status                   show the health of every sensor

For devices on a network:
    slipd config list                list the shipped configs: choose the nearest
    slipd config show NAME           print one: adapt the values marked MEASURE

To read on:
    slipd docs                       list the pages; slipd docs NAME prints one
    slipd --help                     list all commands"""

LEAST_COLUMNS = 30
"""Width of the second column of a list on a narrow terminal."""


def shipped_command(kind: str, name: str | None = None, *, as_json: bool = False) -> None:
    """Print a file as it is, so that it can be redirected; a systemd unit starts this program.

    Args:
        kind: The command that prints one: "config show", "docs" or "service show".
        name: Its name in the list; None: print the list.
        as_json: Print the list as one JSON document.

    Raises:
        UsageError: There is no such file.
    """
    if name is None:
        _list_files(kind, as_json=as_json)
        return
    path = {"config show": config_file, "docs": page_file, "service show": system_file}[kind](name)
    text = path.read_text(encoding="utf-8")
    print(with_program(text, own_program()) if path.suffix == ".service" else text, end="")


def _list_files(kind: str, *, as_json: bool) -> None:
    """Print the folder of the configs, pages or files for the system, and each file with what it is."""
    folder, rows = {
        "config show": (CONFIGS, {path.name.removesuffix(".toml"): _purpose(path) for path in config_files()}),
        "docs": (DOCS, {name: _title(path) for name, path in pages().items()}),
        "service show": (CONFIGS, {path.name: _purpose(path) for path in system_files()}),
    }[kind]
    if as_json:
        print(json.dumps({"folder": str(folder), "files": rows}, ensure_ascii=False))
        return
    print(f"{folder}: `slipd {kind} NAME` prints one")
    columns = shutil.get_terminal_size().columns
    indent = 6 + max(map(len, rows))
    for name, text in rows.items():
        lines = textwrap.wrap(text, max(columns - indent, LEAST_COLUMNS))
        print(f"    {name}".ljust(indent) + f"\n{'':{indent}}".join(lines))


def _purpose(path: Path) -> str:
    """Return the first sentence of a file's leading comment."""
    comment = []
    for line in path.read_text(encoding="utf-8").splitlines():
        if not line.startswith("# "):
            break
        comment.append(line.removeprefix("# "))
    return " ".join(comment).partition(". ")[0].rstrip(".")


def _title(path: Path) -> str:
    first, _, _ = path.read_text(encoding="utf-8").partition("\n")
    return first.removeprefix("# ")
