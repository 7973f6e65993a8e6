"""Kernels: a stale cache is never used, an unwritable one is no crash, and without compilation the results agree."""

from __future__ import annotations

import ast
import os
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import slipd
import slipd.fusion
from slipd.fusion import compiled
from slipd.types.source_stamp import source_stamp

ROOT = Path(slipd.__file__).parent
FUSION = Path(slipd.fusion.__file__).parent
PARTS = {"compiled_part", "compiled_sum_part"}


def kernels(
    tree: ast.Module, decorators: set[str] = PARTS | {"compiled", "compiled_sum"}
) -> dict[str, ast.FunctionDef]:
    return {
        node.name: node
        for node in tree.body
        if isinstance(node, ast.FunctionDef) and decorators & {getattr(d, "id", "") for d in node.decorator_list}
    }


def called(*nodes: ast.stmt) -> set[str]:
    calls = (each for node in nodes for each in ast.walk(node) if isinstance(each, ast.Call))
    return {call.func.id for call in calls if isinstance(call.func, ast.Name)}


def test_a_kernel_calls_only_kernels_of_its_own_file_and_of_fusion() -> None:
    """The stamp of the cache covers no more than that."""
    found = {path: kernels(ast.parse(path.read_text())) for path in ROOT.rglob("*.py")}
    names = {name: path for path, there in found.items() for name in there}
    assert len(names) > 30
    assert sum(len(there) for there in found.values()) == len(names), "each name stands once"
    for path, there in found.items():
        for kernel in there.values():
            foreign = {name for name in called(kernel) & names.keys() if path != names[name]}
            assert all(FUSION in names[name].parents for name in foreign), f"{path.name}: {kernel.name} calls {foreign}"


def test_only_kernels_call_a_part() -> None:
    """A part has no compiled code for Python: a call from there is slow."""
    trees = [ast.parse(path.read_text()) for path in ROOT.rglob("*.py")]
    parts = {name for tree in trees for name in kernels(tree, PARTS)}
    assert len(parts) > 30
    for tree in trees:
        imports = [node for node in tree.body if isinstance(node, ast.ImportFrom) and "fusion" in str(node.module)]
        known = kernels(tree, PARTS).keys() | {name.name for node in imports for name in node.names}
        outside = [node for node in tree.body if node not in kernels(tree).values()]
        assert not parts & known & called(*outside)


ASKS = """
import warnings
warnings.simplefilter("error")
from slipd.fusion import grip_needed_n
from slipd.fusion.limit import bounds, grip_factor, sweep
needed_n = grip_needed_n([0.0, 0.01], [0.0, 0.0], [1.0, 1.0], 0.5, (1.0, 0.0), 0.0, (0.005, 0.0))
bounds.spin_lower(sweep.Field(0.1, 0.0, 0.5, 0.1), 0.2, 0.0, 1e-15)
hits = (sum(kernel.stats.cache_hits.values()) for kernel in (grip_factor.solve_grip_factor, bounds.spin_lower))
print(round(needed_n, 6), sum(hits))
"""


def ask(package: Path, cache: Path, field: str = "Field") -> tuple[float, int]:
    """The grip force that a load needs, and how many of two kernels the process took from its cache."""
    done = subprocess.run(
        [sys.executable, "-c", ASKS.replace("Field", field)],
        env=os.environ | {"PYTHONPATH": str(package), "NUMBA_CACHE_DIR": str(cache), "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    value, hits = done.stdout.split()
    return float(value), int(hits)


@pytest.mark.skipif(os.environ.get("NUMBA_DISABLE_JIT") == "1", reason="nothing is cached without compilation")
def test_the_cache_of_a_kernel_is_used_until_any_file_of_its_folder_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compiled, "__file__", str(tmp_path / "compiled.py"))
    monkeypatch.setattr(compiled, "KERNELS", [])
    (tmp_path / "kernel.py").write_text(
        "from slipd.fusion.compiled import compiled\ntwice = compiled(lambda x: 2 * x)\ntwice(1.0)\n"
    )
    hits = []
    for other in ("1", "1", "2"):
        (tmp_path / "other.py").write_text(other)
        source_stamp.cache_clear()
        hits.append(sum(runpy.run_path(str(tmp_path / "kernel.py"))["twice"].stats.cache_hits.values()))
    assert hits == [0, 1, 0]


@pytest.mark.long
@pytest.mark.process
def test_a_change_in_another_file_of_the_folder_is_seen_in_spite_of_the_cache(tmp_path: Path) -> None:
    if os.environ.get("NUMBA_DISABLE_JIT") == "1":
        pytest.skip("nothing is cached without compilation")
    package, cache = tmp_path / "package", tmp_path / "cache"
    fusion = package / "slipd" / "fusion"
    shutil.copytree(ROOT / "fusion", fusion, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(ROOT / "types", package / "slipd" / "types", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "__init__.py", package / "slipd" / "__init__.py")
    assert (ask(package, cache), ask(package, cache)) == ((2.0, 0), (2.0, 2)), "the second process compiles nothing"
    callee = fusion / "limit" / "frame.py"
    text, scaled = callee.read_text(), "return Frame(total, cx, cy, ex, ey, mean, ct, st)"
    assert text.count(scaled) == 1
    callee.write_text(text.replace(scaled, scaled.replace("total", "3.0 * total")))
    assert ask(package, cache) == (0.666667, 0), "grip_factor.py calls this kernel, and did not change"
    for path in fusion.rglob("*.py"):
        path.write_text(path.read_text().replace("Field", "FrictionField"))
    assert ask(package, cache, "FrictionField") == (0.666667, 0), "a renamed type of a cached signature is no fault"


NOWHERE = "getattr(c, 'CacheImpl', getattr(c, '_CacheImpl', None))._locator_classes = []"
"""No place to write; no permission stops a test that runs as root."""
ELSEWHERE = """
kept = c.Cache.__init__
def elsewhere(self, function):
    kept(self, function)
    self._file = self.__dict__.pop('_cache_file')
c.Cache.__init__ = elsewhere
"""
"""A Numba that keeps its cache in another way: nobody can tell whether a cached kernel is stale."""


@pytest.mark.process
@pytest.mark.parametrize(
    ("changed", "told"),
    [(NOWHERE, "set NUMBA_CACHE_DIR to a writable directory"), (ELSEWHERE, "cannot be cached")],
)
def test_a_cache_that_cannot_be_used_is_a_warning_and_no_crash(changed: str, told: str) -> None:
    """Numba looks for a place when it decorates."""
    code = f"""
import numba.core.caching as c
{changed}
import warnings
with warnings.catch_warnings(record=True) as told:
    warnings.simplefilter('always')
    from slipd.fusion.contact import contact_numbers
assert any({told!r} in str(each.message) for each in told), told
assert contact_numbers(0.0, 3.0, 4.0, 0.0, 0.0, 0.0, 0.0, 0.0)[8] == 0.75
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


PLAIN = {
    "limit_surface": ("closed_form", "bad_data", "duplicate", "no_load"),
    "limit_passes": ("follow",),
    "levels": ("path5", "path8", "path13", "mu_changes", "nor_above"),
    "contact": ("gives_it_back", "follow", "any_size", "not_measured"),
}
"""Words of the tests that are run without compilation, by file."""


@pytest.mark.process
def test_kernels_give_the_same_without_compilation() -> None:
    if os.environ.get("NUMBA_DISABLE_JIT") == "1":
        pytest.skip("this is the run without compilation")
    chosen = " or ".join(f"(test_{name} and ({' or '.join(words)}))" for name, words in PLAIN.items())
    files = [str(Path(__file__).parent / f"test_{name}.py") for name in PLAIN]
    run = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *files, "-k", chosen]
    run += ["-W", "ignore::RuntimeWarning"]  # plain NumPy warns of inf · 0, which the result shows
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(run, env=environment, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stdout[-3000:]
