"""How kernels are compiled: once, cached on disk, with IEEE arithmetic as written.

A cache that cannot be written costs start-up time and nothing else, so it is a warning: set ``NUMBA_CACHE_DIR`` to a
writable directory to get it back.

The cache of a kernel is dated by the file it stands in: a kernel therefore calls only kernels of its own file, or a
change in the other file would go unseen.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

import numba

P = ParamSpec("P")
R = TypeVar("R")


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compiles ``function`` with Numba on its first call."""
    try:
        kernel = numba.njit(cache=True, error_model="numpy")(function)
    except RuntimeError as error:
        warnings.warn(
            f"compiled kernels cannot be cached ({error}); set NUMBA_CACHE_DIR to a writable directory",
            RuntimeWarning,
            stacklevel=2,
        )
        kernel = numba.njit(error_model="numpy")(function)
    return cast("Callable[P, R]", kernel)
