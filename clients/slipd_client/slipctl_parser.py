"""Argument parser of ``slipctl``."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable

from slipd_client import keys_command
from slipd_client.asking import TARE_S

Add = Callable[[str, str], argparse.ArgumentParser]
"""Adds a command, given its name and help text."""


def parser() -> argparse.ArgumentParser:
    """Build the parser; ``command`` of the parsed arguments is the whole command, e.g. "grip set"."""
    top = argparse.ArgumentParser(prog="slipctl", description="Show the state of a running slipd and send it requests.")
    top.add_argument("--publish", metavar="ENDPOINT", help="where slipd publishes")
    top.add_argument("--requests", metavar="ENDPOINT", help="where slipd takes requests")
    top.add_argument("--key", metavar="FILE", help="this client's secret key, for a daemon across a network")
    top.add_argument("--server-key", metavar="FILE", help="the daemon's public key")
    add = _commands(top, "")

    watch = add("watch", "show levels, forces and health as they change")
    watch.add_argument("--json", action="store_true", help="print every message, one per line")
    watch.add_argument("--once", action="store_true", help="show the last messages and exit")
    status = add("status", "ask what the daemon and its streams are doing")
    status.add_argument("--json", action="store_true", help="print the whole reply")

    _grip(_commands(add("grip", "move the gripper or change its force; takes the lease"), "grip "))
    _tare(_commands(add("tare", "take, show or undo the zero of a finger's sensors"), "tare "))

    friction = add("friction", "set the friction between a finger's pad and the object; a larger value takes the lease")
    friction.add_argument("finger", metavar="FINGER")
    friction.add_argument("mu_s", type=_positive, metavar="MU_S", help="static coefficient")
    friction.add_argument("mu_d", type=_positive, metavar="MU_D", nargs="?", help="dynamic coefficient, at most MU_S")

    record = _commands(add("record", "record what the daemon receives and publishes"), "record ")
    record("start", "start a recording; the daemon names the file")
    record("stop", "end the recording")
    keys_command.add_arguments(add("keys", "keys for a daemon across a network"))
    return top


def _grip(add: Add) -> None:
    setting = add("set", "set the normal force on one pad")
    setting.add_argument("force_n", type=_positive, metavar="FORCE_N")
    adjust = add("adjust", "change that force; a negative change loosens")
    adjust.add_argument("delta_n", type=_finite, metavar="DELTA_N")
    for each in (setting, adjust):
        each.add_argument(
            "--hold",
            type=_not_negative,
            default=0.0,
            metavar="S",
            help="keep the lease for S seconds (0); its end moves nothing",
        )
    add("hold", "stop moving fingers and keep the present force")
    close = add("close", "close onto an object")
    close.add_argument("force_n", type=_positive, metavar="FORCE_N", help="normal force on one pad")
    opening = add("open", "open; refused in contact without --drop")
    activate = add("activate", "make the gripper ready; some open and close for it")
    for each in (close, opening):
        each.add_argument("--width-m", type=_not_negative, metavar="M", help="between the pads")
        each.add_argument("--speed-mps", type=_positive, metavar="MPS")
    for each in (opening, activate):
        each.add_argument("--drop", action="store_true", help="even if an object is held, or may be")
    add("stop", "stop the fingers where they are")
    add("ack", "acknowledge the latched fault")


def _tare(add: Add) -> None:
    take = add("take", "take a finger's present readings as zero; nothing may touch the finger")
    take.add_argument(
        "--seconds", type=_positive, default=TARE_S, metavar="S", help="average over S seconds (%(default)s)"
    )
    take.add_argument(
        "--unloaded", action="store_true", help='confirm that nothing touches a finger with the reason "pulled"'
    )
    for each in (take, add("get", "show the tare in use"), add("undo", "go back to the tare before the last one")):
        each.add_argument("finger", metavar="FINGER")
        streams = ("wrench", "pad", "all") if each is take else ("wrench", "pad")
        each.add_argument("--stream", choices=streams, help="default: the sensor that measures the force")


def _commands(parent: argparse.ArgumentParser, prefix: str) -> Add:
    group = parent.add_subparsers(title="commands", required=True, metavar="COMMAND")

    def add(name: str, what: str) -> argparse.ArgumentParser:
        command = group.add_parser(name, help=what, description=f"{what[0].upper()}{what[1:]}.")
        command.set_defaults(command=prefix + name)
        return command

    return add


def _positive(text: str) -> float:
    value = _not_negative(text)
    if value == 0:
        raise argparse.ArgumentTypeError(f"must be above 0, got {text}")
    return value


def _not_negative(text: str) -> float:
    value = _finite(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"must be a finite number from 0 up, got {text}")
    return value


def _finite(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be a number, got {text!r}") from None
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"must be finite, got {text}")
    return value
