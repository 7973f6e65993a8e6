"""Load pyarrow, which a few commands need and the daemon does not."""

from __future__ import annotations

from types import ModuleType

from slipd.errors import SlipdError


def parquet_library(option: str, extra: str = "parquet") -> tuple[ModuleType, ModuleType]:
    """Return ``pyarrow`` and ``pyarrow.parquet``.

    Args:
        option: What needs them, for the error.
        extra: Extra of the package slipd that installs them, for the error.

    Raises:
        SlipdError: pyarrow is not installed.
    """
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as error:
        raise SlipdError(f"{option} needs the package pyarrow: pip install 'slipd[{extra}]'") from error
    return pyarrow, parquet
