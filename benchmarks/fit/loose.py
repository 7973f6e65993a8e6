"""The rules of the load with constants that are given at run time: their source is rewritten, and compiled once.

The daemon compiles its rules with their constants. Here every function of these files also takes an array of the
constants that an ablation changes, and hands it on.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import math
from collections.abc import Callable, Sequence
from typing import Any

import numba

FILES = ("load_blocks", "slide", "explained", "load_jump", "slow_fall", "load_lag", "load_drop")
"""Of `slipd.fusion`, each after those that it uses."""


class _Loosen(ast.NodeTransformer):
    """Rewrites a function of one file.

    Args:
        file: The file.
        given: Constants that are given at run time, as "file.NAME", in the order of the array.
        functions: Names of all functions that take the array.
    """

    def __init__(self, file: str, given: Sequence[str], functions: set[str]) -> None:
        self._module = importlib.import_module(f"slipd.fusion.{file}")
        self._given, self._functions = list(given), functions

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        """Add the array to the parameters, and leave out types and decorators, which are the daemon's."""
        node.args.args.append(ast.arg("given"))
        for argument in node.args.args:
            argument.annotation = None
        node.returns, node.decorator_list = None, []
        return self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> ast.AST:
        """Hand the array on."""
        if isinstance(node.func, ast.Name) and node.func.id in self._functions:
            node.args.append(ast.Name("given", ast.Load()))
        return self.generic_visit(node)

    def visit_Name(self, node: ast.Name) -> ast.AST:
        """Replace a constant by its place in the array, or by its value; that of this file before that of its owner."""
        if not node.id.isupper():
            return node
        value, own = vars(self._module)[node.id], self._module.__name__.rsplit(".", 1)[1]
        owners = (file for file in FILES if vars(importlib.import_module(f"slipd.fusion.{file}")).get(node.id) is value)
        for file in (own, next(owners)):
            if (name := f"{file}.{node.id}") in self._given:
                return ast.parse(f"given[{self._given.index(name)}]", mode="eval").body
        return ast.parse(repr(value), mode="eval").body


def loose_follow_load(given: Sequence[str]) -> Callable[..., bool]:
    """Return `slipd.fusion.load_drop.follow_load` that takes an array of these constants at the end."""
    trees = {file: ast.parse(inspect.getsource(importlib.import_module(f"slipd.fusion.{file}"))) for file in FILES}
    defined = {file: [one for one in tree.body if isinstance(one, ast.FunctionDef)] for file, tree in trees.items()}
    functions = {one.name for some in defined.values() for one in some}
    space: dict[str, Any] = {"math": math}
    for file, some in defined.items():
        for one in some:
            code = ast.fix_missing_locations(ast.Module([_Loosen(file, given, functions).visit(one)], []))
            exec(compile(code, file, "exec"), space)
    for name in functions:
        space[name] = numba.njit(error_model="numpy")(space[name])
    found: Callable[..., bool] = space["follow_load"]
    return found
