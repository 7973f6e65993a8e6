"""Keys for connections over a network: CURVE certificate files in the format of ZeroMQ's tools.

ZeroMQ's own writer leaves the secret key readable by every user under the usual umask, and its reader does not check.
"""

from __future__ import annotations

import os
import re
import stat
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import zmq

from slipd_client.errors import KeyFileError as KeyFileError

PUBLIC_SUFFIX, SECRET_SUFFIX = ".key", ".key_secret"

MAX_FILE_BYTES = 4096
"""Largest certificate file that is read: two keys and some lines about them."""

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
_LINE = re.compile(r'^\s*(public-key|secret-key)\s*=\s*"([^"\n]*)"\s*$', re.MULTILINE)

_HEADER = "#   CURVE {kind} key of {name}, for slipd{warning}\n\nmetadata\ncurve\n"


@dataclass(frozen=True)
class Keys:
    """The keys with which a client is admitted, and with which it recognises its daemon.

    Attributes:
        public: The client's public key, 40 characters of Z85; it must be among those that the daemon allows.
        secret: Its secret key, likewise.
        server: The daemon's public key, likewise.
    """

    public: bytes
    secret: bytes = field(repr=False)
    server: bytes

    def apply(self, socket: zmq.Socket[Any]) -> None:
        """Make a socket use the keys; call it before the socket connects."""
        socket.setsockopt(zmq.CURVE_PUBLICKEY, self.public)
        socket.setsockopt(zmq.CURVE_SECRETKEY, self.secret)
        socket.setsockopt(zmq.CURVE_SERVERKEY, self.server)


def load(secret_path: str | os.PathLike[str], server_public_path: str | os.PathLike[str]) -> Keys:
    """Read a client's keys.

    Args:
        secret_path: The client's ``NAME.key_secret``.
        server_public_path: The daemon's ``NAME.key``.

    Raises:
        KeyFileError: A file cannot be read or holds no key, or other users may read the secret key.
    """
    public, secret = load_secret(secret_path)
    return Keys(public, secret, load_public(server_public_path))


def load_secret(path: str | os.PathLike[str]) -> tuple[bytes, bytes]:
    """Read a pair of keys, public and secret, from a ``NAME.key_secret``.

    Raises:
        KeyFileError: The file cannot be read, holds no such pair, belongs to another user, or others may read it.
    """
    found, about = _read(Path(path))
    if "secret-key" not in found:  # checked first: every user may read the public key
        what = "only the public key" if "public-key" in found else "no key"
        raise KeyFileError(f"{path}: must hold a secret key ({SECRET_SUFFIX}), but holds {what}")
    _check_private(Path(path), about)
    secret = found["secret-key"]
    public: bytes = zmq.curve_public(secret)
    if found.get("public-key", public) != public:
        raise KeyFileError(
            f"{path}: the public key must be that of the secret key, and is not; make new keys with slipctl keys new"
        )
    return public, secret


def load_public(path: str | os.PathLike[str]) -> bytes:
    """Read the public key of a ``NAME.key``.

    Raises:
        KeyFileError: The file cannot be read or holds no public key, or it holds a secret key.
    """
    return _public(Path(path), _read(Path(path))[0])


def _public(path: Path, found: dict[str, bytes]) -> bytes:
    if "secret-key" in found:
        raise KeyFileError(f"{path}: must hold only a public key ({PUBLIC_SUFFIX}), but holds a secret key")
    if "public-key" not in found:
        raise KeyFileError(f"{path}: must hold a public key, and holds none; slipctl keys new makes one")
    return found["public-key"]


def load_allowed(directory: str | os.PathLike[str]) -> frozenset[bytes]:
    """Read every ``*.key`` of a directory; without any, nobody is allowed.

    Raises:
        KeyFileError: The directory cannot be read, one of its files holds no public key, or the directory or one of
            them belongs to another user (except root) or may be written by others, who could then admit themselves.
    """
    folder, allowed = Path(directory), set()
    try:
        files = sorted(file for file in folder.iterdir() if file.suffix == PUBLIC_SUFFIX)
    except OSError as error:
        raise KeyFileError(
            f"{folder}: must be a readable directory: {error.strerror}; slipctl keys new creates a first key"
        ) from None
    _check_own(folder, folder.stat())
    for file in files:
        found, about = _read(file)
        _check_own(file, about)
        allowed.add(_public(file, found))
    return frozenset(allowed)


def create(name: str, directory: Path) -> tuple[Path, Path]:
    """Create new keys: ``NAME.key`` for everybody, ``NAME.key_secret`` for its user alone.

    Args:
        name: Letters, digits, dots, hyphens and underscores.
        directory: Created for its user alone where it is missing.

    Returns:
        Both paths, the public one first.

    Raises:
        KeyFileError: The name is not valid, one of the files exists, or they cannot be written.
    """
    if not _NAME.fullmatch(name):
        raise KeyFileError(f"name must consist of letters, digits, '.', '-' and '_', e.g. robot-1, got {name!r}")
    public_path, secret_path = directory / f"{name}{PUBLIC_SUFFIX}", directory / f"{name}{SECRET_SUFFIX}"
    public, secret = zmq.curve_keypair()
    warning = ": only its user may read it"
    pair = f'    public-key = "{public.decode()}"\n    secret-key = "{secret.decode()}"\n'
    texts = {
        secret_path: (0o600, _HEADER.format(kind="secret", name=name, warning=warning) + pair),
        public_path: (0o644, _HEADER.format(kind="public", name=name, warning="") + pair.splitlines(True)[0]),
    }
    made: list[Path] = []
    try:
        directory.mkdir(mode=0o700, parents=True, exist_ok=True)
        for path, (mode, text) in texts.items():
            _write_new(path, mode, text, made)
    except OSError as error:
        for path in made:
            path.unlink()
        why = "exists already, and keys are never overwritten" if isinstance(error, FileExistsError) else error.strerror
        raise KeyFileError(f"{error.filename or directory / name}: {why}; choose another name or directory") from None
    return public_path, secret_path


def _write_new(path: Path, mode: int, text: str, made: list[Path]) -> None:
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
    made.append(path)
    with os.fdopen(descriptor, "w", encoding="utf-8") as file:
        os.fchmod(descriptor, mode)
        file.write(text)


def _read(path: Path) -> tuple[dict[str, bytes], os.stat_result]:
    """Return the keys in a file by their names there, and the status of the file."""
    try:
        with path.open("rb") as file:
            about = os.fstat(file.fileno())
            data = file.read(MAX_FILE_BYTES + 1)
    except OSError as error:
        raise KeyFileError(f"{path}: cannot be read: {error.strerror}") from None
    if len(data) > MAX_FILE_BYTES:
        raise KeyFileError(f"{path}: a key file must have at most {MAX_FILE_BYTES} bytes")
    found = {what: text.encode() for what, text in _LINE.findall(data.decode("utf-8", errors="replace"))}
    for what, key in found.items():
        try:
            zmq.curve_public(key)  # ZeroMQ's own decoder of Z85 decides; it accepts any key as a secret one
        except (ValueError, zmq.ZMQError):
            raise KeyFileError(f"{path}: its {what} must have 40 characters of Z85") from None
    return found, about


def _check_private(path: Path, found: os.stat_result) -> None:
    if found.st_uid != os.geteuid():
        raise KeyFileError(
            f"{path}: a secret key must belong to the user who uses it, {os.geteuid()}; it belongs to {found.st_uid}"
        )
    if found.st_mode & 0o077:
        raise KeyFileError(
            f"{path}: only its user may read a secret key, and others may read this one "
            f"(mode {stat.S_IMODE(found.st_mode):04o}); run chmod 600 on it, or make a new one"
        )


def _check_own(path: Path, found: os.stat_result) -> None:
    if found.st_uid not in (0, os.geteuid()):
        raise KeyFileError(
            f"{path}: must belong to root or to the daemon's user; user {found.st_uid}, who could allow keys, owns it"
        )
    if found.st_mode & 0o022:
        raise KeyFileError(
            f"{path}: others must not write to it, and could allow keys (mode {stat.S_IMODE(found.st_mode):04o}); run "
            "chmod go-w on it"
        )
