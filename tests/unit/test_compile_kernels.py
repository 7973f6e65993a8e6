"""Kernels that the cache lacks are compiled with a message; the others are loaded silently."""

from __future__ import annotations

import numba
import pytest

from slipd import compile_kernels


def test_compiling_is_announced_once_and_a_compiled_kernel_is_not(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    first, second = numba.njit(lambda x: x + 1), numba.njit(lambda x: x + 2)
    monkeypatch.setattr(compile_kernels, "warm_up", lambda: first(1) + second(1))
    for expected in ("compiling kernels, once (about a minute)\n", ""):
        compile_kernels.compile_kernels()
        assert capfd.readouterr() == ("", expected)


def test_the_message_ends_with_a_failure(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    kernel = numba.njit(lambda x: x + 3)

    def fail() -> None:
        kernel(1)
        raise RuntimeError("no LLVM")

    monkeypatch.setattr(compile_kernels, "warm_up", fail)
    with pytest.raises(RuntimeError, match="no LLVM"):
        compile_kernels.compile_kernels()
    assert capfd.readouterr().err == "compiling kernels, once (about a minute)\n"
