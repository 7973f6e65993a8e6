"""The processes that a test starts: they run the mutant too, and it is known which lines they run."""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import sys
import threading
from importlib.machinery import ModuleSpec, SourceFileLoader
from importlib.util import spec_from_file_location
from pathlib import Path
from types import CodeType

MUTANT, COVERAGE, TEST = "MUTATE_MUTANT", "MUTATE_COVERAGE", "MUTATE_TEST"
"""Environment variables: a file with the mutant; a folder for coverage data and what to measure; the running test."""

SAVE_S = 0.2
"""Coverage is saved this often, because tests kill processes, s."""


class _Loader(SourceFileLoader):
    """Loads a mutant in place of the source."""

    def __init__(self, name: str, path: str, source: str) -> None:
        super().__init__(name, path)
        self._source = source

    def get_code(self, fullname: str) -> CodeType:
        return compile(self._source, self.path, "exec")


class _Finder:
    """Finds the mutated module, and leaves all others to Python."""

    def __init__(self, module: str, path: str, source: str) -> None:
        self._module, self._path, self._source = module, path, source

    def find_spec(self, name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        if name != self._module:
            return None
        loader = _Loader(name, self._path, self._source)
        return spec_from_file_location(name, self._path, loader=loader)


def use_mutant(module: str, path: Path, source: str, folder: str) -> None:
    """Import a mutant in place of a module, here and in the processes that are started from here.

    Args:
        module: Name of the module.
        path: Its file.
        source: The mutant.
        folder: For a copy, while such processes may start.
    """
    copy = Path(folder) / "mutant.json"
    copy.write_text(json.dumps([module, str(path), source]), encoding="utf-8")
    sys.meta_path.insert(0, _Finder(module, str(path), source))
    _tell_children(MUTANT, str(copy))


def measure_children(include: str, folder: str) -> None:
    """Measure the coverage of the processes that are started from here, into a file of each."""
    _tell_children(COVERAGE, json.dumps([include, folder]))


def _tell_children(variable: str, value: str) -> None:
    os.environ[variable] = value
    here = Path(__file__).parent
    paths = (str(here / "child"), str(here.parent), os.environ.get("PYTHONPATH", ""))
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, paths))


def begin() -> None:
    """Begin a process that a test has started."""
    if mutant := os.environ.get(MUTANT):
        sys.meta_path.insert(0, _Finder(*json.loads(Path(mutant).read_text(encoding="utf-8"))))
    if measured := os.environ.get(COVERAGE):
        _measure(*json.loads(measured))


def _measure(include: str, folder: str) -> None:
    from coverage import Coverage  # here: no process loads it that is not measured

    file = f"{folder}/child.{os.getpid()}"
    coverage = Coverage(data_file=file, include=[include], config_file=False, context=os.environ.get(TEST))
    coverage.start()
    ended = threading.Event()

    def save() -> None:
        while not ended.wait(SAVE_S):
            with contextlib.suppress(Exception):  # the program runs on meanwhile
                coverage.save()

    def end() -> None:
        ended.set()
        saving.join()
        coverage.stop()
        coverage.save()

    saving = threading.Thread(target=save, daemon=True)
    saving.start()
    atexit.register(end)
