"""Installs and removes the systemd unit, and what it needs of the system.

It imports nothing but the standard library, so ``make install`` and ``make uninstall`` run it without any package.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from slipd.errors import SlipdError, UsageError
from slipd.io.replaced_file import replace_file
from slipd.tools.shipped_files import own_program, start_line, system_file, with_program

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


def install(root: Path, program: Path | None = None, *, system: bool) -> None:
    """Write the files, readable by all and writable by their owner alone, and print the next steps.

    A file that somebody changed is kept.

    Args:
        root: Folder that stands for ``/``, for packages.
        program: The program that the unit starts; None: this one.
        system: For all users; else for this user.

    Raises:
        SlipdError: A file cannot be written, the existing unit is not slipd's, or systemd could not start the program.
        UsageError: There is no such program, or the service of one user is to be written below a root.
    """
    program = program or own_program()
    if root == Path("/") and not program.exists():
        raise UsageError(f"{program}: there is no such program; name the installed slipd with --program")
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
        UsageError: The service of one user is named together with a root.
    """
    unit = _unit(root, system=system)
    try:
        if f"\n{start_line(program or own_program())} " in (there := _text(unit)):
            _remove(unit)
        elif there:
            print(f"kept, because it starts another program: {unit}")
        for path, text in _others(root, system=system).items():
            if _text(path) == text:
                _remove(path)
    except OSError as error:
        raise SlipdError(f"{error.filename}: cannot be removed: {error.strerror}") from error


def _unit(root: Path, *, system: bool) -> Path:
    """Return where systemd finds the unit."""
    if system:
        return root / "etc/systemd/system/slipd.service"
    if root != Path("/"):
        raise UsageError("--root is for the service of all users: name --system")
    home = Path(os.environ.get("XDG_CONFIG_HOME") or "~/.config").expanduser()
    return home / "systemd/user/slipd.service"


def _others(root: Path, *, system: bool) -> dict[Path, str]:
    """Return the other files with their contents: the user of the service, and rules for serial ports."""
    if not system:
        return {}
    shipped = {"etc/sysusers.d/slipd.conf": "slipd.sysusers", "etc/udev/rules.d/70-slipd.rules": "70-slipd.rules"}
    return {root / place: system_file(name).read_text("utf-8") for place, name in shipped.items()}


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
