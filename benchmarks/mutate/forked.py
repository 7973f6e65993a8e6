"""One mutant against tests in a fork of this process, which has imported all libraries: nothing is imported twice."""

from __future__ import annotations

import os
import signal
import sys
from importlib.machinery import ModuleSpec, SourceFileLoader
from importlib.util import spec_from_file_location
from pathlib import Path
from types import CodeType

import hypothesis.strategies  # noqa: F401 - imported once, for all forks
import numba  # noqa: F401
import numpy as np  # noqa: F401
import pydantic  # noqa: F401
import pytest
import scipy.optimize  # noqa: F401
import zmq  # noqa: F401

OPTIONS = (
    *("-x", "-q", "-p", "no:cacheprovider", "-m", "not long and not process"),
    *("-W", "ignore::pytest.PytestAssertRewriteWarning"),
)


class _Loader(SourceFileLoader):
    """Loads a mutant in place of the source."""

    def __init__(self, name: str, path: str, source: str) -> None:
        super().__init__(name, path)
        self._source = source

    def get_code(self, fullname: str) -> CodeType:
        return compile(self._source, self.path, "exec")


class _Finder:
    """Finds the mutated module, and leaves all others to Python."""

    def __init__(self, module: str, path: Path, source: str) -> None:
        self._module, self._path, self._source = module, path, source

    def find_spec(self, name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        if name != self._module:
            return None
        loader = _Loader(name, str(self._path), self._source)
        return spec_from_file_location(name, self._path, loader=loader)


def is_noticed(root: Path, path: Path, source: str, tests: list[str], limit_s: int) -> bool:
    """Return whether tests notice a mutant of a file, or take too long over it.

    Args:
        root: Folder of the package.
        path: The file.
        source: The mutant.
        tests: Arguments of pytest.
        limit_s: Longest run of the tests, s.
    """
    module = ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__")
    if (child := os.fork()) == 0:
        signal.alarm(limit_s)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        os.dup2(1, 2)
        sys.meta_path.insert(0, _Finder(module, path, source))
        os._exit(int(pytest.main([*OPTIONS, *tests])))
    return os.waitpid(child, 0)[1] != 0
