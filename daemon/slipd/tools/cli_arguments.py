"""What the commands of ``slipd`` share: subcommands, and the kinds of their arguments."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any


def add_command(commands: Any, name: str, purpose: str) -> argparse.ArgumentParser:
    """Add a subcommand with its purpose for both help texts."""
    parser: argparse.ArgumentParser = commands.add_parser(
        name, help=purpose, description=f"{purpose[0].upper()}{purpose[1:]}."
    )
    return parser


def add_recordings(parser: argparse.ArgumentParser, purpose: str) -> None:
    """Add the argument ``recordings``: one path or several."""
    parser.add_argument("recordings", type=Path, nargs="+", metavar="RECORDING", help=purpose)


def positive(text: str) -> float:
    """Return a positive number."""
    value = number(text)
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"must be a positive number, got {text}")
    return value


def time_s(text: str) -> float:
    """Return a time that is not negative, s."""
    value = number(text)
    if not 0.0 <= value < float("inf"):
        raise argparse.ArgumentTypeError(f"must be 0 or a positive number, got {text}")
    return value


def number(text: str) -> float:
    """Return a number."""
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be a number, got {text!r}") from None


def picture(text: str) -> Path:
    """Return the path of a page or a picture."""
    if not text.endswith((".html", ".png")):
        raise argparse.ArgumentTypeError(f"must end in .html or .png, got {text!r}")
    return Path(text)


def speed(text: str) -> float | None:
    """Return a speed; None: as fast as possible."""
    return None if text == "max" else positive(text)
