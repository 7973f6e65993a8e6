"""A copy of this machine, booted by systemd in a container; what it changes is gone with it.

Needs root, ``systemd-nspawn`` and a kernel with overlay file systems. Network and package index are those of this
machine.
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from rig_parts import wait_for

PYTHON = "/usr/bin/python3"
SOURCE = "/srv/source"
BOOT_S = 300.0
QUIET = ("avahi-daemon.service", "postgresql.service", "apt-daily.timer", "apt-daily-upgrade.timer")
"""Units of this machine that the copy need not start."""


def why_not() -> str:
    """Return why no copy can be booted here; "" where one can."""
    if os.geteuid() != 0:
        return "only root boots a container"
    if shutil.which("systemd-nspawn") is None or shutil.which(PYTHON) is None:
        return f"needs systemd-nspawn (package systemd-container) and {PYTHON}"
    code = "import ensurepip, sys; sys.exit(sys.version_info < (3, 11))"
    suffices = subprocess.run([PYTHON, "-c", code], check=False).returncode == 0
    return "" if suffices else f"{PYTHON} is older than 3.11, or has no venv"


class BootedMachine:
    """The running copy.

    Args:
        leader: Process id of its systemd, seen from outside.
    """

    def __init__(self, leader: int) -> None:
        self._leader = leader

    def run(self, command: str, *, user: str = "root", timeout_s: float = 300.0) -> subprocess.CompletedProcess[str]:
        """Run a line of the shell in it."""
        inside = ["nsenter", f"--target={self._leader}", "--mount", "--uts", "--ipc", "--net", "--pid", "--cgroup"]
        bare = ["env", "-i", "PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin", "HOME=/root"]
        shell = ["bash", "-c", command if user == "root" else f"su {user} -c {shlex.quote(command)}"]
        return subprocess.run([*inside, *bare, *shell], capture_output=True, text=True, timeout=timeout_s, check=False)

    def show(self, unit: str, what: str) -> str:
        """Return a property of a unit."""
        return self.run(f"systemctl show {unit} --property={what} --value").stdout.strip()


@contextmanager
def booted_machine(folder: Path, source: Path) -> Iterator[BootedMachine]:
    """Boot a copy in a folder, and end it; it has the sources of slipd in `SOURCE`, read-only."""
    with ExitStack() as stack:
        stack.enter_context(_mounted(["mount", "-t", "tmpfs", "tmpfs", str(folder)], folder))
        root, upper, work = folder / "root", folder / "upper", folder / "work"
        for made in (root, upper, work):
            made.mkdir()
        options = f"lowerdir=/,upperdir={upper},workdir={work}"
        stack.enter_context(_mounted(["mount", "-t", "overlay", "overlay", "-o", options, str(root)], root))
        for unit in QUIET:
            (root / "etc/systemd/system" / unit).unlink(missing_ok=True)
            (root / "etc/systemd/system" / unit).symlink_to("/dev/null")
        boot = ["systemd-nspawn", f"--directory={root}", "--boot", "--register=no", "--keep-unit", "--quiet"]
        boot.append(f"--bind-ro={source}:{SOURCE}")
        streams = subprocess.DEVNULL
        container = subprocess.Popen(boot, stdin=streams, stdout=streams, stderr=streams, start_new_session=True)
        try:
            yield wait_for(lambda: _booted(container), BOOT_S)
        finally:
            container.terminate()
            container.wait()


@contextmanager
def _mounted(command: list[str], place: Path) -> Iterator[None]:
    subprocess.run(command, check=True)
    try:
        yield
    finally:
        subprocess.run(["umount", "--lazy", str(place)], check=True)


def _booted(container: subprocess.Popen[bytes]) -> BootedMachine | None:
    """Return the machine once its systemd is up; the first child of the container only starts that."""
    for leader in Path(f"/proc/{container.pid}/task/{container.pid}/children").read_text(encoding="ascii").split():
        machine = BootedMachine(int(leader))
        if machine.run("systemctl is-system-running").stdout in ("running\n", "degraded\n"):
            return machine
    return None
