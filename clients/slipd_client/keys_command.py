"""``slipctl keys``: makes the keys of a daemon or a client, and shows those that are there. It asks no daemon."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from slipd_client.errors import KeyFileError
from slipd_client.keys import PUBLIC_SUFFIX, SECRET_SUFFIX, create, load_public, load_secret


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Give a parser the commands; ``command`` of what it returns is then "keys new", "keys list" or "keys show"."""
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    for name, what in (
        ("new", "make a pair of keys"),
        ("list", "show the public keys of a directory"),
        ("show", "show one public key, and whether its secret one can be used"),
    ):
        command = commands.add_parser(name, help=what, description=f"{what[0].upper()}{what[1:]}.")
        command.set_defaults(command=f"keys {name}")
        if name != "list":
            command.add_argument("name", metavar="NAME")
        command.add_argument(
            "--dir", type=Path, default=default_directory(), metavar="D", help="directory (%(default)s)"
        )


def default_directory() -> Path:
    """``$XDG_CONFIG_HOME/slipd/keys``, or what that stands for where it is not set."""
    return Path(os.environ.get("XDG_CONFIG_HOME") or "~/.config").expanduser() / "slipd" / "keys"


def run(chosen: argparse.Namespace) -> None:
    """Do what was chosen, and print what came of it; never a secret key.

    Raises:
        KeyFileError: It cannot be done; the text says why.
    """
    if chosen.command == "keys new":
        public, secret = create(chosen.name, chosen.dir)
        print(f"{public}: public, for the list of those that the other side lets in")
        print(f"{secret}: secret, for who made it alone")
    elif chosen.command == "keys show":
        _show(chosen.dir / f"{chosen.name}{PUBLIC_SUFFIX}")
    else:
        _list(chosen.dir)


def _show(public: Path) -> None:
    print(f"{public.stem} {load_public(public).decode()} {_secret_of(public)}")


def _list(directory: Path) -> None:
    try:
        files = sorted(file for file in directory.iterdir() if file.suffix == PUBLIC_SUFFIX)
    except OSError as error:
        raise KeyFileError(
            f"{directory}: cannot be read: {error.strerror}; slipctl keys new makes a first key"
        ) from None
    for public in files:
        _show(public)


def _secret_of(public: Path) -> str:
    """A word about the secret key that belongs to a public one."""
    secret = public.with_suffix(SECRET_SUFFIX)
    if not secret.exists():
        return "(public key alone)"
    try:
        same = load_secret(secret)[0] == load_public(public)
    except KeyFileError as error:
        return f"(secret key unusable: {error})"
    return "(with its secret key)" if same else "(secret key unusable: it is another's)"
