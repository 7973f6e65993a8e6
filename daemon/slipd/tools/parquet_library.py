"""Loads pyarrow, which a few commands need and the daemon does not, and makes texts fit for it."""

from __future__ import annotations

from types import ModuleType

from slipd.errors import UsageError


def parquet_library(option: str, extra: str = "parquet") -> tuple[ModuleType, ModuleType]:
    """Return ``pyarrow`` and ``pyarrow.parquet``.

    Args:
        option: What needs them, for the error.
        extra: Extra of the package slipd that installs them, for the error.

    Raises:
        UsageError: pyarrow is not installed.
    """
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as error:
        raise UsageError(f"{option} needs the package pyarrow: pip install 'slipd[{extra}]'") from error
    return pyarrow, parquet


def storable(text: str) -> str:
    r"""Return a text that Arrow can store: an undecodable byte of a file name becomes an escape such as ``\xff``."""
    return text.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")
