"""``slipctl keys``: creates keys of a daemon or a client, and shows existing ones. It needs no daemon."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from slipd_client.errors import KeyFileError
from slipd_client.keys import PUBLIC_SUFFIX, SECRET_SUFFIX, create, load_public, load_secret


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the commands to a parser; ``command`` of the parsed arguments is "keys new", "keys list" or "keys show"."""
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    for name, what in (
        ("new", "create a pair of keys"),
        ("list", "show the public keys in a directory"),
        ("show", "show one public key, and whether its secret key can be used"),
    ):
        command = commands.add_parser(name, help=what, description=f"{what[0].upper()}{what[1:]}.")
        command.set_defaults(command=f"keys {name}")
        if name != "list":
            command.add_argument("name", metavar="NAME")
        command.add_argument(
            "--dir",
            type=Path,
            default=default_directory(),
            metavar="DIRECTORY",
            help="directory of the keys (default: %(default)s)",
        )


def default_directory() -> Path:
    """Return ``$XDG_CONFIG_HOME/slipd/keys``, or ``~/.config/slipd/keys`` where that is not set."""
    return Path(os.environ.get("XDG_CONFIG_HOME") or "~/.config").expanduser() / "slipd" / "keys"


def run(chosen: argparse.Namespace) -> None:
    """Run the chosen command and print its result, but never a secret key.

    Raises:
        KeyFileError: A key file cannot be used or created; the text says why.
    """
    if chosen.command == "keys new":
        public, secret = create(chosen.name, chosen.dir)
        print(f"{public}: public key, for the list of keys that the other side allows")
        print(f"{secret}: secret key, for this user alone")
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
            f"{directory}: must be a readable directory: {error.strerror}; slipctl keys new creates a first key"
        ) from None
    for public in files:
        _show(public)


def _secret_of(public: Path) -> str:
    """Return whether the secret key of a public key is there and can be used."""
    secret = public.with_suffix(SECRET_SUFFIX)
    if not secret.exists():
        return "(public key only)"
    try:
        same = load_secret(secret)[0] == load_public(public)
    except KeyFileError as error:
        return f"(secret key unusable: {error})"
    return "(with its secret key)" if same else "(secret key unusable: it belongs to another public key)"
