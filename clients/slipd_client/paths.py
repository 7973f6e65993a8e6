"""Where the daemon's sockets and files are, why nobody may answer there, and whether another user can change them.

A user who can write the config decides what moves; one who can create the sockets decides what clients believe.

The rule is that of OpenSSH's ``StrictModes``, as Debian ships it: the file and every folder on its path belong to root
or to the user who runs slipd, and nobody else may write to them; a private group of that user counts as the user. It
differs in two ways. Links are followed one by one, so the folder of a link counts too. And a folder with the sticky
bit, such as ``/tmp``, is accepted if root or that user owns it: others may add files there, but can neither replace nor
rename those of its owner.

The socket of a daemon may belong to one more user: one whose folder root made, such as ``/run/slipd`` of the service.
"""

from __future__ import annotations

import errno
import grp
import os
import pwd
import stat
from collections.abc import Iterator
from pathlib import Path

SERVICE_DIR = Path("/run/slipd")
"""Where the systemd service of slipd has its sockets."""


def runtime_dir() -> Path:
    """Return the directory of the daemon's sockets; it need not exist yet.

    ``$SLIPD_RUNTIME_DIR`` where set, else ``$XDG_RUNTIME_DIR/slipd``, else ``/tmp/slipd-<uid>``. Whoever creates it
    must own it and keep others from writing to it, because anyone may create names in ``/tmp``.
    """
    if chosen := os.environ.get("SLIPD_RUNTIME_DIR"):
        return Path(chosen)
    if session := os.environ.get("XDG_RUNTIME_DIR"):
        return Path(session) / "slipd"
    return Path(f"/tmp/slipd-{os.getuid()}")  # noqa: S108 - daemon and clients check its owner


def log_file() -> Path:
    """Return the file in which a daemon keeps its log while no journal does; the log before it ends in ``.1``."""
    return runtime_dir() / "log"


def publish_endpoint() -> str:
    """Return the ZeroMQ endpoint of the messages when none is configured."""
    return f"ipc://{runtime_dir()}/publish"


def requests_endpoint() -> str:
    """Return the ZeroMQ endpoint of the requests when none is configured."""
    return f"ipc://{runtime_dir()}/requests"


def hint_for(endpoint: str) -> str:
    """Return a sentence that says why nobody may answer at an endpoint, and what to do about it."""
    if endpoint.startswith("tcp:"):
        return "Is slipd running, and are the keys right?"
    directory = Path(endpoint.removeprefix("ipc://")).parent
    try:
        found = directory.stat()
    except OSError:
        if directory != SERVICE_DIR and SERVICE_DIR.is_dir():
            return f"Is slipd running? A service uses {SERVICE_DIR}: for that one set SLIPD_RUNTIME_DIR={SERVICE_DIR}"
        return "Is slipd running?"
    if os.access(directory, os.X_OK):
        return "Is slipd running?"
    return _who_may_enter(directory, found)


def _who_may_enter(directory: Path, found: os.stat_result) -> str:
    if not found.st_mode & stat.S_IXGRP:
        return f"Only {user_name(found.st_uid, 'user ')} may enter {directory}"
    try:
        group = grp.getgrgid(found.st_gid).gr_name
    except KeyError:
        group = str(found.st_gid)
    return f"Only the group {group} may enter {directory}: sudo usermod -aG {group} $USER, then log in again"


ROOT_UID = 0
MOST_LINKS = 40
"""The kernel follows this many links in one path."""


def trust_faults(path: Path) -> list[str]:
    """Find what lets another user change a file: owner or mode of the file, or of a folder or link on its path.

    Raises:
        OSError: The file does not exist, or a folder cannot be entered.
    """
    trusted = {ROOT_UID, os.geteuid()}
    found = path.stat()
    if not stat.S_ISREG(found.st_mode):  # such as a pipe of the shell, which has no folder
        return _faults(path, found, trusted)
    return [fault for here, entry in _walk(path) for fault in _faults(here, entry, trusted)]


def claim_socket(path: Path) -> list[str]:
    """Find what lets another user listen in the place of the daemon: on this socket, or on one created later.

    If the folder of the socket is missing where any user could create it, such as in ``/tmp``, create it for this user
    alone. A socket that does not exist yet, or cannot be reached, is otherwise judged by the folders above it.
    """
    trusted = {ROOT_UID, os.geteuid()}
    faults: list[str] = []
    others_create, only_root = False, False
    try:
        for here, entry in _walk(path):
            if only_root:
                trusted.add(entry.st_uid)
            is_folder = stat.S_ISDIR(entry.st_mode)
            others_create = is_folder and bool(entry.st_mode & stat.S_IWOTH)
            only_root = is_folder and entry.st_uid == ROOT_UID and not entry.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
            if is_folder or entry.st_uid not in trusted:  # who may connect to the socket is not the question here
                faults += _faults(here, entry, trusted)
    except FileNotFoundError:
        if others_create and not faults:
            if path.parent.is_dir():
                return [f"{path} may be created by any user: its folder must not be writable by other users"]
            path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            return claim_socket(path)
    except OSError:  # a folder that cannot be entered: ZeroMQ cannot connect either
        return faults
    return faults


def _walk(path: Path) -> Iterator[tuple[Path, os.stat_result]]:
    """Yield every folder, link and file that the kernel visits when it resolves a path."""
    here, links = Path("/"), 0
    pending = [*reversed((Path.cwd() / path).parts[1:])]
    yield here, here.lstat()
    while pending:
        name = pending.pop()
        if name == "..":
            here = here.parent
            continue
        entry = (here / name).lstat()
        yield here / name, entry
        if not stat.S_ISLNK(entry.st_mode):
            here = here / name
            continue
        links += 1
        if links > MOST_LINKS:
            raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), str(path))
        target = (here / name).readlink()
        if target.is_absolute():
            here = Path("/")
        pending += [part for part in reversed(target.parts) if part != "/"]


def _faults(path: Path, entry: os.stat_result, trusted: set[int]) -> list[str]:
    is_folder = stat.S_ISDIR(entry.st_mode)
    what = f"the folder {path} on its path" if is_folder else str(path)
    if entry.st_uid not in trusted:
        mend = f"chown {user_name(os.geteuid())} {path}"
        return [f"{what} must belong to root or to {user_name(os.geteuid())}, not to {user_name(entry.st_uid)}: {mend}"]
    if stat.S_ISLNK(entry.st_mode) or (is_folder and entry.st_mode & stat.S_ISVTX):
        return []
    by_group = entry.st_mode & stat.S_IWGRP and not _is_own_group(entry.st_gid)
    if not (by_group or entry.st_mode & stat.S_IWOTH):
        return []
    mode = stat.S_IMODE(entry.st_mode)
    return [f"{what} must not be writable by other users (mode {mode:04o}): chmod go-w {path}"]


def _is_own_group(gid: int) -> bool:
    """Return whether the group has no member but root and the user who runs slipd."""
    mine = {ROOT_UID, os.geteuid()}
    try:
        members = {pwd.getpwnam(name).pw_uid for name in grp.getgrgid(gid).gr_mem}
    except KeyError:  # a group or member that this machine does not know
        return False
    return members | {user.pw_uid for user in pwd.getpwall() if user.pw_gid == gid} <= mine


def user_name(uid: int, without_name: str = "") -> str:
    """Return the name of a user, or its number, after ``without_name``, where this machine has none."""
    try:
        return pwd.getpwuid(uid).pw_name
    except KeyError:
        return f"{without_name}{uid}"
