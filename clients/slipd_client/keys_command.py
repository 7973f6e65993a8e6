"""``slipctl keys``: creates keys of a daemon or a client, and shows existing ones. It needs no daemon."""

from __future__ import annotations

import argparse
from pathlib import Path

from slipd_client.errors import KeyFileError
from slipd_client.keys import PUBLIC_SUFFIX, SECRET_SUFFIX, create, load_public, load_secret


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
