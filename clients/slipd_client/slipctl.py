"""The ``slipctl`` command: look at a running slipd, and ask it for things."""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import time
from collections.abc import Sequence
from typing import Any

from slipd_client.errors import ClientError
from slipd_client.messages import STATUS_TOPIC
from slipd_client.requester import LEASE_MS, TARE_S, Requester
from slipd_client.view import View
from slipd_client.watch import print_view, watch

DONE, FAULT = 0, 1  # a wrong call exits with argparse's own 2

RENEW_S = LEASE_MS / 1000 / 3
"""Two renewals may come late before the lease ends."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; ``arguments`` are those of the command line when None.

    Returns:
        0 done, 1 fault at run time (told on standard error); a wrong call exits with 2.
    """
    parser = _parser()
    chosen = parser.parse_args(arguments)
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(errors="replace")  # type: ignore[union-attr] # a terminal without our signs shows "?"
    try:
        chosen.run(chosen)
        sys.stdout.flush()
    except ClientError as error:
        print(f"slipctl: {error}", file=sys.stderr)
        return FAULT
    except ValueError as error:  # an endpoint that is none
        parser.error(str(error))
    except BrokenPipeError:  # the reader of a pipe has seen enough; Python must not flush into it at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except KeyboardInterrupt:
        if chosen.run not in (_watch, _grip):
            print("slipctl: interrupted", file=sys.stderr)
            return FAULT
    return DONE


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="slipctl", description="Look at a running slipd, and ask it for things.")
    parser.add_argument("--publish", metavar="ENDPOINT", help="where slipd publishes")
    parser.add_argument("--requests", metavar="ENDPOINT", help="where slipd takes requests")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")

    look = commands.add_parser("watch", help="show levels, forces and health as they change")
    look.add_argument("--json", action="store_true", help="every message, one a line")
    look.add_argument("--once", action="store_true", help="show the last messages and end")
    look.set_defaults(run=_watch)

    status = commands.add_parser("status", help="ask what the daemon and its streams are doing")
    status.add_argument("--json", action="store_true", help="the whole map")
    status.set_defaults(run=_status)

    tare = commands.add_parser("tare", help="take a finger's present wrench as zero; nothing may touch it")
    tare.add_argument("finger", metavar="FINGER")
    tare.add_argument("--seconds", type=_positive, default=TARE_S, metavar="S", help="mean over so long (%(default)s)")
    tare.set_defaults(run=_tare)

    grip = commands.add_parser("grip", help="set the normal force on one pad")
    grip.add_argument("force_n", type=_positive, metavar="FORCE_N")
    grip.add_argument(
        "--hold", type=_not_negative, default=0.0, metavar="SECONDS", help="keep the lease so long (0); no end moves it"
    )
    grip.set_defaults(run=_grip)
    return parser


def _watch(chosen: argparse.Namespace) -> None:
    watch(chosen.publish, as_json=chosen.json, once=chosen.once)


def _status(chosen: argparse.Namespace) -> None:
    with Requester(chosen.requests) as requester:
        status = requester.status()
    if chosen.json:
        print(json.dumps(status))
        return
    view = View()
    view.update(STATUS_TOPIC, status)
    print_view(view)


def _tare(chosen: argparse.Namespace) -> None:
    with Requester(chosen.requests) as requester:
        _print_result(requester.tare(chosen.finger, chosen.seconds))


def _grip(chosen: argparse.Namespace) -> None:
    with Requester(chosen.requests) as requester, requester.lease(LEASE_MS):
        _print_result(requester.grip_set(chosen.force_n))
        until = time.monotonic() + chosen.hold
        while (left_s := until - time.monotonic()) > 0:
            time.sleep(min(left_s, RENEW_S))
            requester.renew()


def _print_result(result: dict[str, Any]) -> None:
    for field, value in result.items():
        print(f"{field}: {json.dumps(value)}", flush=True)


def _positive(text: str) -> float:
    value = _not_negative(text)
    if value == 0:
        raise argparse.ArgumentTypeError("must be more than 0")
    return value


def _not_negative(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no number") from None
    if not 0 <= value < math.inf:
        raise argparse.ArgumentTypeError(f"{text} is no finite number from 0 up")
    return value


if __name__ == "__main__":
    sys.exit(main())
