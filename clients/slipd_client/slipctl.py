"""The ``slipctl`` command: show the state of a running slipd, and send it requests."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from slipd_client import slipctl_parser
from slipd_client.errors import ClientError, SlipdClientError

DONE, FAULT = 0, 1  # wrong arguments exit with argparse's own 2

ENDED_BY_HAND = ("watch", "view", "viewers", "relay", "ros2", "bridge", "fleet", "gravity", "grip set", "grip adjust")
"""Commands that Ctrl-C ends normally."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; ``arguments`` are those of the command line when None.

    Returns:
        0 for success, 1 if the daemon refused or did not answer (reported on standard error); wrong arguments exit
        with 2.
    """
    parser = slipctl_parser.parser()
    chosen = parser.parse_args(arguments)
    if not chosen.command:
        chosen.refuse()
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(errors="replace")  # type: ignore[union-attr] # a terminal that lacks a character shows "?"
    try:
        from slipd_client import slipctl_commands  # here: ``--help`` and wrong arguments need no ZeroMQ

        slipctl_commands.run(chosen)
        sys.stdout.flush()
    except ClientError as error:
        print(f"slipctl: {error}", file=sys.stderr)
        return FAULT
    except SlipdClientError as error:  # a wrong endpoint or key file
        parser.error(str(error))
    except BrokenPipeError:  # the reader of the pipe has closed it; Python must not flush into it at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except KeyboardInterrupt:
        if chosen.command not in ENDED_BY_HAND:
            print("slipctl: interrupted", file=sys.stderr)
            return FAULT
    return DONE


if __name__ == "__main__":
    sys.exit(main())
