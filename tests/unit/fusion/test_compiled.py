"""Compiled kernels: no stale cache, a warning without a writable cache, the same results without compilation."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

import slipd.fusion

FUSION = Path(slipd.fusion.__file__).parent


def kernels(tree: ast.Module) -> set[str]:
    return {
        node.name
        for node in tree.body
        if isinstance(node, ast.FunctionDef) and any(getattr(d, "id", "") == "compiled" for d in node.decorator_list)
    }


def test_a_kernel_calls_only_kernels_of_its_own_file() -> None:
    trees = {path: ast.parse(path.read_text()) for path in FUSION.glob("*.py")}
    everywhere = {name: path for path, tree in trees.items() for name in kernels(tree)}
    assert len(everywhere) > 8
    for path, tree in trees.items():
        for node in tree.body:
            if isinstance(node, ast.FunctionDef) and node.name in kernels(tree):
                called = {c.func.id for c in ast.walk(node) if isinstance(c, ast.Call) and isinstance(c.func, ast.Name)}
                foreign = {name for name in called if everywhere.get(name, path) != path}
                assert not foreign, f"{path.name}: {node.name} calls {foreign}"


@pytest.mark.process
@pytest.mark.process
def test_a_cache_that_cannot_be_written_is_a_warning_and_no_crash() -> None:
    """Numba looks for a place when it decorates; no permission stops a test that runs as root, so none is offered."""
    code = (
        "import numba.core.caching as c\n"
        "getattr(c, 'CacheImpl', getattr(c, '_CacheImpl', None))._locator_classes = []\n"
        "import warnings\n"
        "with warnings.catch_warnings(record=True) as told:\n"
        "    warnings.simplefilter('always')\n"
        "    from slipd.fusion import tipping_margin\n"
        "assert any('NUMBA_CACHE_DIR' in str(w.message) for w in told), told\n"
        "assert tipping_margin([0, 1, 1, 0], [0, 0, 1, 1], (0.5, 0.5)) == 0.5\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.process
@pytest.mark.process
def test_kernels_give_the_same_without_compilation() -> None:
    """The plain run is also what lets coverage see the kernels' lines."""
    if os.environ.get("NUMBA_DISABLE_JIT") == "1":
        pytest.skip("this is the run without compilation")
    file = Path(__file__).parent / "test_limit_surface.py"
    run = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(file)]
    run += ["-W", "ignore::RuntimeWarning"]  # what is not compiled warns of inf · 0, which the result tells
    done = subprocess.run(
        [*run, "-k", "ring or points or obtuse or collinear or one_taxel or bad_data or duplicate or no_load"],
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=False,
        timeout=100,
    )
    assert done.returncode == 0, done.stdout[-3000:]
