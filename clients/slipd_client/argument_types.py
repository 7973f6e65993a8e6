"""Parts of the parser of ``slipctl``: its commands, and types of arguments that several of them have."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Mapping
from typing import Any

Add = Callable[[str, str], argparse.ArgumentParser]
"""Adds a command, given its name and help text."""


class CommandParser(argparse.ArgumentParser):
    """A parser of commands, of which one may be left out.

    Attributes:
        default: That command; "" where every command must be named.
        names: All of them, in a map.
    """

    default = ""
    names: Mapping[str, object] = {}

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Put the default before arguments that begin with no command and no option."""
        if self.default and args and args[0] not in self.names and not args[0].startswith("-"):
            args = [self.default, *args]
        return super().parse_known_args(args, namespace)


def finite(text: str) -> float:
    """Return a finite number."""
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be a number, got {text!r:.80}") from None
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"must be finite, got {text}")
    return value


def rate_hz(text: str) -> float:
    """Return a rate of 0.001 to 1e6 Hz."""
    value = finite(text)
    if not 0.001 <= value <= 1e6:
        raise argparse.ArgumentTypeError(f"must be from 0.001 to 1e6 Hz, got {text}")
    return value
