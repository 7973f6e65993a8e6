"""The keys that guard a connection over a network: CURVE certificate files in the form that ZeroMQ's tools use.

ZeroMQ's own writer leaves the secret readable by everybody under the usual umask, and its reader does not look.
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
"""Longest certificate file read: two keys and some lines about them."""

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
_LINE = re.compile(r'^\s*(public-key|secret-key)\s*=\s*"([^"\n]*)"\s*$', re.MULTILINE)

_HEADER = "#   CURVE {kind} key of {name}, for slipd{warning}\n\nmetadata\ncurve\n"


@dataclass(frozen=True)
class Keys:
    """What a client needs to be let in, and to be sure that it talks to the right daemon.

    Attributes:
        public: The client's public key, 40 letters of Z85; it must be among those that the daemon allows.
        secret: Its secret key, likewise.
        server: The daemon's public key, likewise.
    """

    public: bytes
    secret: bytes = field(repr=False)
    server: bytes

    def apply(self, socket: zmq.Socket[Any]) -> None:
        """Make a socket use them; to be called before it connects."""
        socket.setsockopt(zmq.CURVE_PUBLICKEY, self.public)
        socket.setsockopt(zmq.CURVE_SECRETKEY, self.secret)
        socket.setsockopt(zmq.CURVE_SERVERKEY, self.server)


def load(secret_path: str | os.PathLike[str], server_public_path: str | os.PathLike[str]) -> Keys:
    """Read a client's keys.

    Args:
        secret_path: The client's ``NAME.key_secret``.
        server_public_path: The daemon's ``NAME.key``.

    Raises:
        KeyFileError: One cannot be read or holds no key, or others than its user may read the secret.
    """
    public, secret = load_secret(secret_path)
    return Keys(public, secret, load_public(server_public_path))


def load_secret(path: str | os.PathLike[str]) -> tuple[bytes, bytes]:
    """Read a pair of keys from a ``NAME.key_secret``: public and secret.

    Raises:
        KeyFileError: It cannot be read or holds no such pair, belongs to another user, or others may read it.
    """
    found, about = _read(Path(path))
    if "secret-key" not in found:  # said first: the public half may be read by all, and should be
        what = "the public key alone" if "public-key" in found else "no key"
        raise KeyFileError(f"{path}: holds {what}; name the file of the secret one, which ends with {SECRET_SUFFIX}")
    _check_private(Path(path), about)
    secret = found["secret-key"]
    public: bytes = zmq.curve_public(secret)
    if found.get("public-key", public) != public:
        raise KeyFileError(f"{path}: the public key is not that of the secret key; make new ones: slipctl keys new")
    return public, secret


def load_public(path: str | os.PathLike[str]) -> bytes:
    """Read the key of a ``NAME.key``.

    Raises:
        KeyFileError: It cannot be read or holds no public key, or holds a secret one that does not belong there.
    """
    return _public(Path(path), _read(Path(path))[0])


def _public(path: Path, found: dict[str, bytes]) -> bytes:
    if "secret-key" in found:
        raise KeyFileError(
            f"{path}: holds a secret key; name the file of the public one, which ends with {PUBLIC_SUFFIX}"
        )
    if "public-key" not in found:
        raise KeyFileError(f"{path}: holds no public key; slipctl keys new makes one")
    return found["public-key"]


def load_allowed(directory: str | os.PathLike[str]) -> frozenset[bytes]:
    """Read every ``*.key`` of a directory; none is a list of nobody.

    Raises:
        KeyFileError: It is no directory, one of its files is no public key, or it or one of them belongs to another
            user (but root) or may be written by others: who may do that lets itself in.
    """
    folder = Path(directory)
    try:
        found = folder.stat()
        files = sorted(folder.iterdir())
    except OSError as error:
        raise KeyFileError(
            f"{folder}: cannot be read: {error.strerror}; name a directory of {PUBLIC_SUFFIX} files"
        ) from None
    _check_own(folder, found)
    return frozenset(_allowed(file) for file in files if file.suffix == PUBLIC_SUFFIX)


def _allowed(file: Path) -> bytes:
    found, about = _read(file)
    _check_own(file, about)
    return _public(file, found)


def create(name: str, directory: Path) -> tuple[Path, Path]:
    """Make new keys: ``NAME.key`` for everybody, ``NAME.key_secret`` for its user alone.

    Args:
        name: Of letters, digits, dots, hyphens and underscores.
        directory: Made for its user alone where it is missing.

    Returns:
        Both paths, the public one first.

    Raises:
        KeyFileError: The name is none, one of the files exists, or they cannot be written.
    """
    if not _NAME.fullmatch(name):
        raise KeyFileError(f"{name!r} is no name; one is made of letters, digits, '.', '-' and '_', such as robot-1")
    public_path, secret_path = directory / f"{name}{PUBLIC_SUFFIX}", directory / f"{name}{SECRET_SUFFIX}"
    public, secret = zmq.curve_keypair()
    warning = ": for its user's eyes alone"
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
        why = "exists already, and a key is never overwritten" if isinstance(error, FileExistsError) else error.strerror
        raise KeyFileError(f"{error.filename}: {why}; choose another name or directory") from None
    return public_path, secret_path


def _write_new(path: Path, mode: int, text: str, made: list[Path]) -> None:
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
    made.append(path)
    with os.fdopen(descriptor, "w", encoding="utf-8") as file:
        os.fchmod(descriptor, mode)
        file.write(text)


def _read(path: Path) -> tuple[dict[str, bytes], os.stat_result]:
    """Return the keys in a file by their names there, and the owner of the file."""
    try:
        with path.open("rb") as file:
            about = os.fstat(file.fileno())
            data = file.read(MAX_FILE_BYTES + 1)
    except OSError as error:
        raise KeyFileError(f"{path}: cannot be read: {error.strerror}") from None
    if len(data) > MAX_FILE_BYTES:
        raise KeyFileError(f"{path}: is longer than {MAX_FILE_BYTES} bytes; a key file is not")
    found = {what: text.encode() for what, text in _LINE.findall(data.decode("utf-8", errors="replace"))}
    for what, key in found.items():
        if not _is_key(key):
            raise KeyFileError(f"{path}: its {what} is none; a key has 40 letters of Z85")
    return found, about


def _check_private(path: Path, found: os.stat_result) -> None:
    if found.st_uid != os.geteuid():
        raise KeyFileError(
            f"{path}: belongs to user {found.st_uid}; a secret key belongs to who uses it, {os.geteuid()}"
        )
    if found.st_mode & 0o077:
        mode = stat.S_IMODE(found.st_mode)
        raise KeyFileError(
            f"{path}: others may use this secret key (mode {mode:04o}); run chmod 600, or make a new one"
        )


def _check_own(path: Path, found: os.stat_result) -> None:
    if found.st_uid not in (0, os.geteuid()):
        raise KeyFileError(f"{path}: belongs to user {found.st_uid}, who could allow keys; make it your own, or root's")
    if found.st_mode & 0o022:
        mode = stat.S_IMODE(found.st_mode)
        raise KeyFileError(f"{path}: others may write to it, and so allow keys (mode {mode:04o}); run chmod go-w on it")


def _is_key(text: bytes) -> bool:
    try:
        zmq.curve_public(text)  # ZeroMQ's own reader of Z85 judges, and takes any key for a secret one
    except (ValueError, zmq.ZMQError):
        return False
    return True
