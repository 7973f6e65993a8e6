"""How kernels are compiled: once, and cached on disk.

Numba dates a cached kernel by the file that defines it, so a change in another file that the kernel calls into, or in
the dtype of its rows, would go unseen. Here the date also covers every source file of this folder: after any change
all kernels are compiled again. A kernel therefore calls only kernels of its own file and of `slipd.fusion`.

Numba puts what a kernel calls into its machine code. A kernel that only kernels call is therefore a part: it needs no
file in the cache, and no wrapper that makes Python objects of its results, which takes as long as the kernel itself.

A cache that cannot be written costs start-up time and nothing else, so it is a warning. Set ``NUMBA_CACHE_DIR`` to a
writable directory to avoid it.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

import numba
from numba.extending import register_jitable

from slipd.types.source_stamp import source_stamp

P = ParamSpec("P")
R = TypeVar("R")

_ANY_ORDER = {"reassoc", "contract"}
"""What a sum in any order relaxes of IEEE arithmetic."""

KERNELS: list[Callable[..., Any]] = []
"""Every kernel that Python calls and that is defined so far."""

PARTS: list[Callable[..., Any]] = []
"""Likewise every kernel that only kernels call."""


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile ``function`` with Numba on its first call, with IEEE arithmetic in the order written."""
    return _compile(function, fastmath=False)


def compiled_sum(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a pass over the taxels whose sums may be taken in any order, so that it uses vector instructions.

    Nothing else is relaxed: NaN, infinity and signed zero keep their meaning.
    """
    return _compile(function, fastmath=_ANY_ORDER)


def compiled_part(function: Callable[P, R]) -> Callable[P, R]:
    """Do what `compiled` does for a kernel that only kernels call; Python that calls it runs it uncompiled."""
    return _compile_part(function, fastmath=False)


def compiled_sum_part(function: Callable[P, R]) -> Callable[P, R]:
    """Do what `compiled_sum` does for a kernel that only kernels call; Python that calls it runs it uncompiled."""
    return _compile_part(function, fastmath=_ANY_ORDER)


def _compile(function: Callable[P, R], fastmath: bool | set[str]) -> Callable[P, R]:
    options = _options(fastmath)
    try:
        kernel = numba.njit(cache=True, **options)(function)
        if kernel is not function:  # NUMBA_DISABLE_JIT returns the function itself
            _date_by_folder(kernel)
    except (RuntimeError, OSError, AttributeError) as error:
        _warn_of_no_cache(str(error))
        kernel = numba.njit(**options)(function)
    KERNELS.append(kernel)
    return cast("Callable[P, R]", kernel)


def _compile_part(function: Callable[P, R], fastmath: bool | set[str]) -> Callable[P, R]:
    PARTS.append(function)
    part: Callable[P, R] = register_jitable(**_options(fastmath), no_cpython_wrapper=True)(function)
    return part


def _options(fastmath: bool | set[str]) -> dict[str, Any]:
    """Return the options that all kernels share. None is called from C, so none has a C wrapper."""
    return {"error_model": "numpy", "fastmath": fastmath, "no_cfunc_wrapper": True}


def _warn_of_no_cache(reason: str) -> None:
    """Warn at the first kernel; the others have the same reason."""
    if KERNELS:
        return
    cost = "compiled kernels cannot be cached, so every start compiles them, for about a minute"
    warnings.warn(f"{cost}; set NUMBA_CACHE_DIR to a writable directory ({reason})", RuntimeWarning, stacklevel=4)


def _date_by_folder(kernel: Any) -> None:
    """Add this folder's hash to the version of Numba with which a kernel's cache is compared.

    Numba reads that version before anything else and then leaves another version's cache alone. Its own date of the
    source comes too late: to read it, the types of the cached signatures are loaded, which fails where one was renamed.
    Numba offers no public way to do this.

    Raises:
        AttributeError: This version of Numba keeps its cache in another way: without the hash it must not be used.
    """
    cache_file = kernel._cache._cache_file  # noqa: SLF001
    cache_file._version = f"{cache_file._version} {source_stamp(Path(__file__).parent)}"  # noqa: SLF001
