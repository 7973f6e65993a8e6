"""Types of arguments that several commands of ``slipctl`` have."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable

Add = Callable[[str, str], argparse.ArgumentParser]
"""Adds a command, given its name and help text."""


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
