"""Which tests of a room run a line, and how long each takes: a mutant needs only these."""

from __future__ import annotations

import ast
import json
import math
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from coverage import Coverage, CoverageData
from mutate.children import TEST, measure_children
from mutate.forked import RunPytest, in_fork
from mutate.mutations import Mutation

LONGEST_TEST_S = 10
"""A test that takes longer without a mutant is left out, s."""

ENOUGH_S = 30.0
"""Tests that are tried on one mutant in a function take at most this long without it, s."""


class _Recorder:
    """A plugin of pytest that attributes each line to the test that runs it, and each passed test its time."""

    def __init__(self, coverage: Coverage) -> None:
        self.seconds: dict[str, float] = {}
        self._coverage = coverage

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        self._coverage.switch_context(nodeid)
        os.environ[TEST] = nodeid  # for the processes that it starts

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        took = report.duration if report.passed else math.inf
        self.seconds[report.nodeid] = self.seconds.get(report.nodeid, 0.0) + took


@dataclass(frozen=True)
class CoveredRoom:
    """Tests of a room, and the lines that each runs.

    Attributes:
        seconds: Node id of each test that passes → its time, s.
        lines: File relative to the project → line → node ids of the tests that run it, and "" if it is run on import.
    """

    seconds: dict[str, float]
    lines: dict[str, dict[int, set[str]]]

    def tests(self, path: str, source: str, mutation: Mutation) -> list[str]:
        """Return the tests that a mutant must pass: first those of the file of the same name, those that run its line,
        and those that run its file, the quickest first.

        Of what is run on import, and of a kernel, whose lines are not seen, these are all tests of the room, so that it
        takes longer.
        """
        lines = self.lines.get(path, {})
        ran = {test for line in _statement(source, mutation.line) for test in lines.get(line, ())}
        ran_file = {test for tests in lines.values() for test in tests}
        everywhere = "" in ran or not _is_in_function(source, mutation.line) or is_compiled(source, mutation)
        near = f"test_{Path(path).stem}"
        ordered = sorted(
            (self.seconds.keys() if everywhere else ran & self.seconds.keys()),
            key=lambda test: (near not in test, test not in ran, test not in ran_file, self.seconds[test], test),
        )
        return list(_at_most(ordered, self.seconds, 3.0 * ENOUGH_S if everywhere else ENOUGH_S))


def covered_room(project: Path, sources: Path, tests: list[str], scratch: Path) -> CoveredRoom:
    """Run the tests of a room in a fork and return what each covers.

    Args:
        project: Folder of the project.
        sources: Folder of the sources of the room.
        tests: Folders and files of the tests, relative to the project.
        scratch: Folder for what the fork found; created.

    Raises:
        SystemExit: No test passed.
    """

    include = str(sources / "*")
    scratch.mkdir()

    def run(run_pytest: RunPytest) -> int:
        coverage = Coverage(data_file=str(scratch / "tests"), include=[include], config_file=False)
        recorder = _Recorder(coverage)
        measure_children(include, str(scratch))
        coverage.start()
        run_pytest([f"--timeout={LONGEST_TEST_S}", *tests], [recorder])
        coverage.stop()
        coverage.save()
        (scratch / "seconds.json").write_text(json.dumps(recorder.seconds), encoding="utf-8")
        return 0

    in_fork(run)
    seconds = json.loads((scratch / "seconds.json").read_text(encoding="utf-8"))
    passed = {test: took for test, took in seconds.items() if took < LONGEST_TEST_S}
    if not passed:
        raise SystemExit(f"mutate: no test of {' '.join(tests)} passes without a mutant")
    return CoveredRoom(passed, _lines(project, [scratch / "tests", *scratch.glob("child.*")]))


def _lines(project: Path, files: list[Path]) -> dict[str, dict[int, set[str]]]:
    """Return the lines of each source, and the tests that run each or "" on import, by the coverage of processes."""
    lines: dict[str, dict[int, set[str]]] = {}
    for file in files:
        data = CoverageData(str(file))
        data.read()
        for name in data.measured_files():
            found = lines.setdefault(Path(name).relative_to(project).as_posix(), {})
            for line, tests in data.contexts_by_lineno(name).items():
                found.setdefault(line, set()).update(tests)
    return lines


def is_compiled(source: str, mutation: Mutation) -> bool:
    """Return whether a mutant changes compiled code: a kernel, or a constant of a file with kernels."""
    functions = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.FunctionDef)]
    kernels = [node for node in functions if any("compiled" in ast.unparse(each) for each in node.decorator_list)]
    at = [node for node in functions if node.lineno <= mutation.line <= (node.end_lineno or node.lineno)]
    return bool(kernels) and (not at or any(node in kernels for node in at))


def _statement(source: str, line: int) -> range:
    """Return the lines of the innermost simple statement at a line; of a compound one, those of its header."""
    best = range(line, line + 1)
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.stmt) and node.lineno <= line <= (node.end_lineno or node.lineno):
            body = getattr(node, "body", None)
            end = body[0].lineno - 1 if body else node.end_lineno or node.lineno
            if line <= max(end, node.lineno):
                best = range(node.lineno, max(end, node.lineno) + 1)
    return best


def _is_in_function(source: str, line: int) -> bool:
    """Whether a line stands in the body of a function."""
    return any(
        node.body[0].lineno <= line <= (node.end_lineno or node.lineno)
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    )


def _at_most(tests: list[str], seconds: dict[str, float], most_s: float) -> Iterator[str]:
    total = 0.0
    for test in tests:
        total += seconds[test]
        if total > most_s:
            return
        yield test
