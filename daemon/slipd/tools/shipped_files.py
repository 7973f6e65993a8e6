"""What comes with slipd: lists and prints configs, pages and files for the system, and installs the systemd unit.

It imports nothing but the standard library, so ``make install`` and ``make uninstall`` run it without any package.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import sys
import textwrap
from pathlib import Path

from slipd.errors import SlipdError
from slipd.io.replaced_file import replace_file
from slipd.tools.shipped_paths import (
    CONFIGS,
    DOCS,
    config_files,
    page_file,
    pages,
    shipped_config,
    system_file,
    system_files,
)

DESCRIPTION = "Description=Slip warnings for a gripper"
"""The line by which a unit of slipd is known."""

HOMES = ("/home/", "/root/")
"""Folders that the system's unit cannot see (``ProtectHome``)."""

NEXT_STEPS = {
    True: """\
next:
    sudo systemd-sysusers                                  # the user slipd, member of dialout
    sudo usermod -aG slipd $USER                           # may read and request; log in again
    sudo install -m 644 my_rig.toml /etc/slipd/rig.toml
    sudo systemctl daemon-reload && sudo systemctl enable --now slipd""",
    False: """\
next:
    install -D -m 644 my_rig.toml ~/.config/slipd/rig.toml
    systemctl --user daemon-reload && systemctl --user enable --now slipd""",
}

LEAST_COLUMNS = 30
"""Width of the second column of a list on a narrow terminal."""


def install(root: Path, program: Path | None = None, *, system: bool) -> None:
    """Write the files, readable by all and writable by their owner alone, and print the next steps.

    A file that somebody changed is kept.

    Args:
        root: Folder that stands for ``/``, for packages.
        program: The program that the unit starts; None: this one.
        system: For all users; else for this user.

    Raises:
        SlipdError: A file cannot be written, the existing unit is not slipd's, or systemd could not start the program.
    """
    program = program or own_program()
    hidden = [program.resolve(), Path(sys.executable).resolve()] if root == Path("/") else []
    if system and (homes := [str(path) for path in hidden if str(path).startswith(HOMES)]):
        raise SlipdError(f"{homes[0]}: the service of all users cannot run a program of one user's home")
    os.umask(0o022)
    unit = _unit(root, system=system)
    try:
        if (there := _text(unit)) and DESCRIPTION not in there:
            raise SlipdError(f"{unit}: is not a unit of slipd, and is not replaced")
        for path, text in _others(root, system=system).items():
            if _text(path) in ("", text):
                _write(path, text)
            else:
                print(f"kept, because it was changed: {path}")
        if system:
            (root / "etc/slipd").mkdir(parents=True, exist_ok=True)
        shipped = system_file("slipd.service" if system else "slipd-user.service")
        _write(unit, with_program(shipped.read_text("utf-8"), program))
    except OSError as error:
        raise SlipdError(f"{error.filename}: cannot be written: {error.strerror}") from error
    print(NEXT_STEPS[system])


def uninstall(root: Path, program: Path | None = None, *, system: bool) -> None:
    """Remove the files that `install` wrote, but none that was changed and no unit of another program.

    Args:
        root: As for `install`.
        program: Likewise.
        system: Likewise.

    Raises:
        SlipdError: A file cannot be removed.
    """
    unit = _unit(root, system=system)
    try:
        if f"\n{_start(program or own_program())} " in _text(unit):
            _remove(unit)
        for path, text in _others(root, system=system).items():
            if _text(path) == text:
                _remove(path)
    except OSError as error:
        raise SlipdError(f"{error.filename}: cannot be removed: {error.strerror}") from error


def _unit(root: Path, *, system: bool) -> Path:
    """Return where systemd finds the unit."""
    if system:
        return root / "etc/systemd/system/slipd.service"
    home = Path(os.environ.get("XDG_CONFIG_HOME") or "~/.config").expanduser()
    return home / "systemd/user/slipd.service"


def _others(root: Path, *, system: bool) -> dict[Path, str]:
    """Return the other files with their contents: the user of the service, and rules for serial ports."""
    if not system:
        return {}
    shipped = {"etc/sysusers.d/slipd.conf": "slipd.sysusers", "etc/udev/rules.d/70-slipd.rules": "70-slipd.rules"}
    return {root / place: system_file(name).read_text("utf-8") for place, name in shipped.items()}


def own_program() -> Path:
    """Return the command ``slipd`` of this environment."""
    return Path(sys.prefix) / "bin" / "slipd"


def with_program(unit: str, program: Path) -> str:
    """Return a unit that starts this program."""
    return re.sub(r"^ExecStart=\S+", lambda _: _start(program), unit, flags=re.MULTILINE)


def _start(program: Path) -> str:
    """Return the beginning of the line that starts a program, quoted as systemd reads it."""
    quoted = str(program).replace("\\", "\\\\").replace('"', '\\"').replace("%", "%%")
    return f'ExecStart="{quoted}"' if re.search(r"[\s\"'\\]", quoted) else f"ExecStart={quoted}"


def _text(path: Path) -> str:
    """Return the text of a file; "" where there is none."""
    try:
        return path.read_text("utf-8")
    except FileNotFoundError:
        return ""


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, text, mode=0o644)
    print(f"{path}: written")


def _remove(path: Path) -> None:
    path.unlink()
    print(f"{path}: removed")


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
    path = {"config show": shipped_config, "docs": page_file, "service show": system_file}[kind](name)
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
