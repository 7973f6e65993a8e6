"""Kernels that the cache lacks are compiled with a message; the others are loaded silently."""

from __future__ import annotations

import signal
from concurrent.futures import ThreadPoolExecutor

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


def test_an_interrupt_while_compiling_ends_it_before_the_next_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    kernel, reached = numba.njit(lambda x: x + 4), []

    def interrupted() -> None:
        signal.raise_signal(signal.SIGINT)
        reached.append("here")  # not at once: it may be in a callback
        kernel(1)
        reached.append("a further kernel")

    monkeypatch.setattr(compile_kernels, "warm_up", interrupted)
    before = signal.getsignal(signal.SIGINT)
    assert compile_kernels.main() == 130
    assert reached == ["here"]
    assert signal.getsignal(signal.SIGINT) is before


def test_an_interrupt_after_the_last_kernel_is_not_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compile_kernels, "warm_up", lambda: signal.raise_signal(signal.SIGINT))
    assert compile_kernels.main() == 130


def test_an_ignored_interrupt_stays_ignored(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compile_kernels, "warm_up", lambda: signal.raise_signal(signal.SIGINT))
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        assert compile_kernels.main() == 0
    finally:
        signal.signal(signal.SIGINT, before)


def test_kernels_are_compiled_in_any_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compile_kernels, "warm_up", lambda: None)
    with ThreadPoolExecutor(1) as other:
        assert other.submit(compile_kernels.main).result() == 0
