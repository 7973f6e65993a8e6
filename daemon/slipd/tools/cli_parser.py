"""Makes the argument parser of ``slipd`` of the list of its commands."""

from __future__ import annotations

import argparse
from typing import Any

from slipd import __version__
from slipd.tools.cli_commands import COMMANDS

EXIT = "Exit code: 0 done, 1 the answer is no, 2 wrong use, 130 Ctrl-C (slipd docs commands)."


def parser() -> argparse.ArgumentParser:
    """Return the parser; ``command`` of the parsed arguments is the command, e.g. "replay" or "import grips"."""
    top = argparse.ArgumentParser(
        prog="slipd", description="Warn a robot that its gripper is about to drop something.", epilog=EXIT
    )
    top.add_argument("--version", action="version", version=f"slipd {__version__}")
    top.set_defaults(command="", run="slipd.cli:first_steps")
    lists: dict[str, Any] = {"": top.add_subparsers(metavar="COMMAND")}
    for each in COMMANDS:
        above, _, word = each.name.rpartition(" ")
        purpose = each.purpose
        command = lists[above].add_parser(
            word, help=purpose, description=f"{purpose[0].upper()}{purpose[1:]}.", epilog=each.more
        )
        command.set_defaults(command=each.name, run=each.run, **each.given)
        for add in each.arguments:
            add(command)
        if each.below:
            lists[each.name] = command.add_subparsers(required=True, metavar=each.below)
    return top
