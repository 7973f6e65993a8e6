"""The ``slipctl`` command: show the state of a running slipd, and send it requests."""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import pkgutil
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from slipd_client import slipctl_parser
from slipd_client.errors import CallError, ClientError, RequestRefused, SlipdClientError, require
from slipd_client.messages.ops import lease_rule
from slipd_client.terminal import INTERRUPTED, standard_output

if TYPE_CHECKING:
    from slipd_client.keys import Keys

DONE, REFUSED, WRONG = 0, 1, 2
"""Exit codes, as those of ``slipd``: docs/commands.md."""

MOST_LISTED = 12
"""Entries of a list that are shown to people: the zero of a pad has one for each taxel."""

COMMANDS = {each.given["op"]: each.name for each in slipctl_parser.COMMANDS if "op" in each.given}
"""Requests that the daemon names in refusals, and what a person types for each."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; ``arguments`` are those of the command line when None.

    Returns:
        0 done; 1 the daemon refused or did not answer; 2 wrong use, a missing file or a missing package; 130 ended by
        Ctrl-C. The reason is reported on standard error.
    """
    with standard_output("slipctl"):
        parser = slipctl_parser.parser()
        chosen = parser.parse_args(arguments)
        if not chosen.command and not chosen.version:
            parser.refuse()
        try:
            _carry_out(chosen)
        except KeyboardInterrupt:
            return INTERRUPTED
        except SlipdClientError as error:
            print(f"slipctl: {_in_words_to_type(str(error))}", file=sys.stderr)
            return REFUSED if isinstance(error, ClientError) else WRONG
    return DONE


def _in_words_to_type(text: str) -> str:
    """Return a text of the daemon with what a person types in place of requests and their fields."""
    typed = re.sub(r"`?\b([a-z]+\.[a-z]+)\b`?", _typed, text).replace("drop: true", "--drop")
    return re.sub(r"\b(slipctl [a-z ]+) \(`\1`\)", r"\1", typed)


def _typed(request: re.Match[str]) -> str:
    return f"`slipctl {COMMANDS[request[1]]}`" if request[1] in COMMANDS else request[0]


def version() -> str:
    """Return the version of the package that holds this client: its own wheel, or that of slipd."""
    from importlib import metadata

    for package in ("slipd-client", "slipd"):
        with contextlib.suppress(metadata.PackageNotFoundError):
            return metadata.version(package)
    return "unknown"


def _carry_out(chosen: argparse.Namespace) -> None:
    """Carry out one command and print what it returns.

    Raises:
        ClientError: The daemon refused, or did not answer.
        CallError: An endpoint is wrong, options do not go together, or a package is missing.
        KeyFileError: A key file cannot be used or created.
    """
    if chosen.version:
        print(f"slipctl {version()}")
        return
    for module, package in chosen.needs.items():
        require(module, package, f"slipctl {chosen.command}")
    reply = pkgutil.resolve_name(chosen.run)(chosen, _keys(chosen))
    if reply is not None:
        _print_reply(reply, as_json=chosen.json)


def send_request(chosen: argparse.Namespace, keys: Keys | None) -> None:
    """Send the request of a command, with the lease where it needs one or may need one, and print the reply."""
    from slipd_client.grip import GripClient

    rule = lease_rule(chosen.op)
    with contextlib.ExitStack() as stack:
        client = stack.enter_context(GripClient(chosen.requests, keys=keys))
        lease = None
        if rule == "holder":
            lease = stack.enter_context(client.lease())
        elif rule == "not_another's" and chosen.op != "tare":
            with contextlib.suppress(RequestRefused):
                stack.enter_context(client.lease())
        method = getattr(client, chosen.op.replace(".", "_"))
        reply = method(**{name: getattr(chosen, name) for name in chosen.fields})
        _print_reply(reply, as_json=chosen.json)
        if lease is not None and (seconds := getattr(chosen, "hold", 0.0)):
            lease.wait(seconds)


def _keys(chosen: argparse.Namespace) -> Keys | None:
    if (chosen.key is None) != (chosen.server_key is None):
        raise CallError("--key (secret key of this client) and --server-key (public key of the daemon) go together")
    if chosen.key is None:
        return None
    from slipd_client import keys

    return keys.load(chosen.key, chosen.server_key)


def new_keys(chosen: argparse.Namespace, _: Keys | None) -> None:
    """Create a pair of keys, and print the paths; it needs no daemon."""
    from slipd_client import keys

    configs = Path(os.environ.get("XDG_CONFIG_HOME") or "~/.config").expanduser()
    public, secret = keys.create(chosen.name, chosen.dir or configs / "slipd" / "keys")
    if chosen.json:
        print(json.dumps({"public_file": str(public), "secret_file": str(secret)}))
        return
    print(f"{public}: public key, for the list of keys that the other side allows")
    print(f"{secret}: secret key, for this user alone")


def _print_reply(reply: dict[str, object], *, as_json: bool) -> None:
    print(json.dumps(reply) if as_json else "\n".join(_lines(reply)) or "done", flush=True)


def _lines(reply: Mapping[str, object], indent: str = "") -> Iterator[str]:
    """Yield the fields of a reply for people, one a line; those of a map are indented below its name."""
    for field, value in reply.items():
        if isinstance(value, Mapping):
            yield f"{indent}{field}:"
            yield from _lines(value, indent + "    ")
        else:
            yield f"{indent}{field}: {_text(value)}"


def _text(value: object) -> str:
    """Return a value for people: numbers with six digits, of a long list the first entries."""
    if isinstance(value, list):
        entries = [_text(each) for each in value[:MOST_LISTED]]
        entries += [f"… {len(value)} in all, with --json"] if len(value) > MOST_LISTED else []
        return f"[{', '.join(entries)}]"
    return json.dumps(float(f"{value:.6g}") if isinstance(value, float) else value, ensure_ascii=False)


if __name__ == "__main__":
    sys.exit(main())
