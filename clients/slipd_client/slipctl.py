"""The ``slipctl`` command: show the state of a running slipd, and send it requests."""

from __future__ import annotations

import contextlib
import os
import re
import sys
from collections.abc import Sequence

from slipd_client import slipctl_parser
from slipd_client.errors import ClientError, SlipdClientError

DONE, REFUSED, WRONG, INTERRUPTED = 0, 1, 2, 130
"""Exit codes, as those of ``slipd``: docs/commands.md."""

COMMANDS = {op: name for name, (_, op, _) in slipctl_parser.REQUESTS.items()}
"""Requests that the daemon names in refusals, and what a person types for each."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; ``arguments`` are those of the command line when None.

    Returns:
        0 done; 1 the daemon refused or did not answer; 2 wrong use, a missing file or a missing package; 130 ended by
        Ctrl-C. The reason is reported on standard error.
    """
    chosen = slipctl_parser.parser().parse_args(arguments)
    if chosen.version:
        print(f"slipctl {version()}")
        return DONE
    if not chosen.command:
        chosen.refuse()
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(errors="replace")  # type: ignore[union-attr] # a terminal that lacks a character shows "?"
    try:
        from slipd_client import slipctl_commands  # here: ``--help`` and wrong arguments need no ZeroMQ

        slipctl_commands.run(chosen)
        sys.stdout.flush()
    except BrokenPipeError:  # the reader of the pipe has closed it; Python must not flush into it at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except KeyboardInterrupt:
        return INTERRUPTED
    except SlipdClientError as error:
        text = re.sub(r"`?\b([a-z]+\.[a-z]+)\b`?", _typed, str(error))
        print(f"slipctl: {text}", file=sys.stderr)
        return REFUSED if isinstance(error, ClientError) else WRONG
    return DONE


def _typed(request: re.Match[str]) -> str:
    return f"`slipctl {COMMANDS[request[1]]}`" if request[1] in COMMANDS else request[0]


def version() -> str:
    """Return the version of the package that holds this client: its own wheel, or that of slipd."""
    from importlib import metadata

    for package in ("slipd-client", "slipd"):
        with contextlib.suppress(metadata.PackageNotFoundError):
            return metadata.version(package)
    return "unknown"


if __name__ == "__main__":
    sys.exit(main())
