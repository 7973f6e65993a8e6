"""Processors to test on: this one, told to do without what older ones lack, in NumPy, OpenBLAS and Numba."""

from __future__ import annotations

import os
import platform
from dataclasses import dataclass

from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__


@dataclass(frozen=True, slots=True)
class Setting:
    """One processor.

    Attributes:
        name: Few words.
        env: Environment variables that make a process act as on it.
    """

    name: str
    env: dict[str, str]

    def __str__(self) -> str:
        return " ".join(f"{name}={value}" for name, value in self.env.items()) or "as it is"


def settings() -> list[Setting]:
    """The settings that this machine can act as, the oldest processor first and the machine itself last."""
    found = [_oldest()]
    if platform.machine() == "x86_64" and any(_is_avx512(name) for name in _dispatched()):
        found.append(_without_avx512())
    return [*found, Setting("this processor", {})]


def _oldest() -> Setting:
    """No vector instruction that NumPy, OpenBLAS or LLVM may choose to use."""
    core = {"x86_64": "Nehalem", "aarch64": "ARMV8"}.get(platform.machine(), "GENERIC")
    return Setting("oldest", _env(_dispatched(), core, "generic"))


def _without_avx512() -> Setting:
    return Setting("AVX2", _env([name for name in _dispatched() if _is_avx512(name)], "Haswell", "haswell"))


def _env(numpy_without: list[str], openblas_core: str, llvm_cpu: str) -> dict[str, str]:
    env = {"OPENBLAS_CORETYPE": openblas_core, "NUMBA_CPU_NAME": llvm_cpu}
    if llvm_cpu == "generic":
        env["NUMBA_CPU_FEATURES"] = ""
    if numpy_without:
        env["NPY_DISABLE_CPU_FEATURES"] = ",".join(numpy_without)
    return env


def _dispatched() -> list[str]:
    """Instruction sets beyond NumPy's baseline that NumPy would use here."""
    already = os.environ.get("NPY_DISABLE_CPU_FEATURES", "")
    if already:
        raise RuntimeError(f"NPY_DISABLE_CPU_FEATURES is set already ({already}): unset it")
    return [name for name in __cpu_dispatch__ if __cpu_features__[name]]


def _is_avx512(name: str) -> bool:
    """NumPy names the level X86_V4 (2.4 and newer) or each set by itself."""
    return name.startswith("AVX512") or name == "X86_V4"
