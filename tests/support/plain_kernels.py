"""Kernels without compilation, which shows their lines to coverage: they must do what they do compiled."""

from __future__ import annotations

import copy
from collections.abc import Callable
from types import ModuleType
from typing import Any

import pytest


def run_without_compilation(patch: pytest.MonkeyPatch, *modules: ModuleType) -> None:
    """Replace the kernels of modules by their source."""
    for module in modules:
        for name, kernel in list(vars(module).items()):
            if hasattr(kernel, "py_func"):
                patch.setattr(module, name, kernel.py_func)


def check_without_compilation(kernel: Callable[..., Any], *arguments: Any) -> None:
    """Check that a kernel returns the same, and leaves the same in its arguments, if it is not compiled."""
    found = []
    for each in (kernel, getattr(kernel, "py_func", kernel)):
        given = copy.deepcopy(arguments)
        found.append((each(*given) or 0.0, *given))
    for compiled, plain in zip(*found, strict=True):
        assert plain == pytest.approx(compiled, rel=1e-9, abs=1e-15, nan_ok=True)
