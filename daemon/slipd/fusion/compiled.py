"""How kernels are compiled: once, and cached on disk.

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
    """Compiles ``function`` with Numba on its first call, with IEEE arithmetic in the order written."""
    return _compile(function, fastmath=False)


def compiled_sum(function: Callable[P, R]) -> Callable[P, R]:
    """Compiles a pass over the taxels whose sums may be taken in any order, so that it uses vector instructions.

    Nothing else is relaxed: not-a-number, infinity and signed zero keep their meaning.
    """
    return _compile(function, fastmath={"reassoc", "contract"})


def _compile(function: Callable[P, R], fastmath: bool | set[str]) -> Callable[P, R]:
    try:
        kernel = numba.njit(cache=True, error_model="numpy", fastmath=fastmath)(function)
    except RuntimeError as error:
        warnings.warn(
            f"compiled kernels cannot be cached ({error}); set NUMBA_CACHE_DIR to a writable directory",
            RuntimeWarning,
            stacklevel=3,
        )
        kernel = numba.njit(error_model="numpy", fastmath=fastmath)(function)
    return cast("Callable[P, R]", kernel)
