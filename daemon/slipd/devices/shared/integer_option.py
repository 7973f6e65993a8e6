"""Check of options that are integers within bounds, such as a rate or an address."""

from __future__ import annotations


def check_integer(name: str, value: object, least: int, most: int) -> None:
    """Check an option of a decoder or session.

    Raises:
        ValueError: It is not an integer, or out of bounds.
    """
    if not (isinstance(value, int) and least <= value <= most):
        raise ValueError(f"{name} must be an integer from {least} to {most}, got {value!r}")
