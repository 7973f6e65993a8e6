"""An aarch64 machine out of Debian's packages and wheels, run by qemu-user: Jetson and Raspberry Pi are of its kind.

Nothing of this system is changed: packages are unpacked into a folder, and their index is kept there.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

from project import MODULES, ROOT

QEMU = "qemu-aarch64-static"
PYTHON = f"python{sys.version_info.major}.{sys.version_info.minor}"
LIBRARIES = ("libstdc++6", "libatomic1", "libgomp1")
"""What the wheels of NumPy, SciPy and Numba expect of the system."""
PLATFORMS = ("manylinux_2_28_aarch64", "manylinux_2_27_aarch64", "manylinux_2_17_aarch64", "manylinux2014_aarch64")
"""Kinds of wheel that run on Debian 12 and newer."""


class UnavailableError(Exception):
    """The machine cannot be made here; the message says what is missing."""


def prepare(folder: Path) -> tuple[list[str], dict[str, str]]:
    """Make the machine in ``folder``; return the command that is its Python, and the environment for it.

    Raises:
        UnavailableError: A tool is missing, or a package cannot be had.
    """
    missing = [tool for tool in (QEMU, "apt-get", "apt-cache", "dpkg") if shutil.which(tool) is None]
    if missing:
        raise UnavailableError(f"aarch64 needs {', '.join(missing)}; on Debian: apt install qemu-user-static")
    root, site = folder / "root", folder / "site"
    if not (root / "usr/bin" / PYTHON).exists():
        _unpack_python(folder, root)
    if not site.exists():
        _install_wheels(site)
    search = (site, ROOT / "daemon", ROOT / "clients", MODULES)
    env = {"PYTHONHOME": str(root / "usr"), "PYTHONPATH": ":".join(map(str, search))}
    return [QEMU, "-L", str(root), str(root / "usr/bin" / PYTHON)], env


def _unpack_python(folder: Path, root: Path) -> None:
    """Unpack Debian's Python and all it depends on, but for what installs packages."""
    debs = folder / "debs"
    for path in (folder / "lists/partial", folder / "cache/archives/partial", debs, root):
        path.mkdir(parents=True, exist_ok=True)
    settings = {
        "APT::Architecture": "arm64",
        "APT::Architectures": "arm64",
        "APT::Sandbox::User": "root",
        "Dir::State::lists": folder / "lists",
        "Dir::State::status": "/dev/null",
        "Dir::Cache": folder / "cache",
    }
    options = [word for name, value in settings.items() for word in ("-o", f"{name}={value}")]
    _run("apt-get", *options, "update", "-qq")
    kinds = ("recommends", "suggests", "conflicts", "breaks", "replaces", "enhances")
    listed = _run(
        "apt-cache", *options, "depends", "--recurse", *(f"--no-{kind}" for kind in kinds), PYTHON, *LIBRARIES
    )
    names = {line for line in listed.splitlines() if line[:1].isalnum()}
    _run("apt-get", *options, "download", "-qq", *sorted(names), cwd=debs)
    for package in debs.glob("*.deb"):
        _run("dpkg", "-x", str(package), str(root))


def _install_wheels(site: Path) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = [*project["dependencies"], *project["optional-dependencies"]["dev"]]
    platforms = [word for name in PLATFORMS for word in ("--platform", name)]
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--only-binary=:all:"]
    _run(*pip, *platforms, "--target", str(site), *wanted)


def _run(*command: str, cwd: Path | None = None) -> str:
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)
    if done.returncode:
        raise UnavailableError(f"{' '.join(command[:2])} failed: {done.stderr.strip()[-300:]}")
    return done.stdout
