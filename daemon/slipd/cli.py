"""The command ``slipd``: runs the command that was typed, and turns its end into an exit code.

The module of a command is imported only when it runs. A command returns False where the answer is no, for example where
a recording is damaged.
"""

from __future__ import annotations

import argparse
import contextlib
import errno
import os
import pkgutil
import sys
from typing import NoReturn

from slipd import __version__
from slipd.errors import ConfigError, SlipdError, UsageError, printable_lines
from slipd.io.log_lines import log_uncaught, open_log
from slipd.tools.cli_commands import parser
from slipd_client.terminal import INTERRUPTED, standard_output

DONE, NO, WRONG = 0, 1, 2
"""Exit codes, those of ``slipctl`` too; docs/commands.md explains them."""

WRONG_PLACES = (FileNotFoundError, FileExistsError, IsADirectoryError)
"""Causes of an error that are wrong use: a file is missing, a place or an endpoint is taken, or a folder was named."""

ENDED_IN_ORDER = ("run", "demo")
"""Commands that Ctrl-C ends in good order: recordings are closed, and the demo prints its summary."""

SERVING = ("view", "emulate")
"""Commands that run until Ctrl-C, which ends them without a message."""

FIRST_STEPS = f"""\
slipd {__version__} warns a robot that its gripper is about to drop something.

Without hardware:
    slipd demo                       run the daemon on a virtual gripper

With your rig:
    slipd init my_rig.toml           find the devices on the serial ports, and write a first config
    slipd check my_rig.toml          report every fault in it
    slipd run my_rig.toml            run the daemon
    slipd commission my_rig.toml     find mounting, weight and friction, in another terminal
    slipctl status                   show the health of every sensor

For devices on a network:
    slipd config list                list the shipped configs: choose the nearest
    slipd config show NAME           print one: adapt the values marked MEASURE

To read on:
    slipd docs                       list the pages; slipd docs NAME prints one
    slipd --help                     list all commands"""

_INTERRUPTED = {
    "evaluate": "; the same command goes on from here",
    "export": "; nothing was written",
    "commission": "; the present step changed nothing, the gripper keeps its force",
}


def main(argv: list[str] | None = None) -> int:
    """Run one command; return its exit code: 0 done, 1 the answer is no, 2 wrong use, 130 interrupted."""
    with standard_output("slipd"):
        arguments = parser().parse_args(argv)
        open_log()
        if argv is None:
            log_uncaught()
        code = _exit_code(arguments)
        if argv is None and arguments.command == "run":
            _end_process(code)
        return code
    return DONE


def carry_out(arguments: argparse.Namespace) -> object:
    """Call what carries out a command; return its answer."""
    options = vars(arguments).copy()
    del options["command"]
    return pkgutil.resolve_name(options.pop("run"))(**options)


def _exit_code(arguments: argparse.Namespace) -> int:
    try:
        return NO if carry_out(arguments) is False else DONE
    except ConfigError as error:
        print(error, file=sys.stderr)
        return WRONG
    except SlipdError as error:
        print(f"slipd: {printable_lines(str(error))}", file=sys.stderr)
        cause = error.__cause__
        is_taken = isinstance(cause, WRONG_PLACES) or getattr(cause, "errno", None) == errno.EADDRINUSE
        return WRONG if isinstance(error, UsageError) or is_taken else NO
    except KeyboardInterrupt:
        if arguments.command in ENDED_IN_ORDER:
            return DONE
        if arguments.command not in SERVING:
            print(f"slipd: interrupted{_INTERRUPTED.get(arguments.command, '')}", file=sys.stderr)
        return INTERRUPTED


def _end_process(code: int) -> NoReturn:
    """End without taking down the interpreter: all is closed, and that alone takes longer than a stop may."""
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    os._exit(code)


def first_steps() -> None:
    """Print what to type first, where no command is given."""
    print(FIRST_STEPS)
    raise UsageError("a command is missing; slipd --help lists all")
