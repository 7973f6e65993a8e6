"""Small changes of one place of a source file, each of which a test should notice."""

from __future__ import annotations

import ast
import copy
from collections.abc import Callable, Iterator
from dataclasses import dataclass

_COMPARED: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
}  # fmt: skip
_COMPUTED: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult, ast.LShift: ast.RShift, ast.RShift: ast.LShift, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd,
}  # fmt: skip
_BYTE_ORDERS = {"<": ">", ">": "<", "!": "<"}

Changes = Callable[[ast.AST], Iterator[tuple[str, Callable[[ast.AST], None]]]]
"""``changes(node)`` yields at most one change of each kind."""


@dataclass(frozen=True)
class Mutation:
    """One change.

    Attributes:
        index: Place of the changed node in `ast.walk` order.
        line: Its line in the source.
        kind: "operator", "constant", "condition" or "deleted"; others in `mutate.wire`.
        text: What changed, for people.
    """

    index: int
    line: int
    kind: str
    text: str


def mutations(source: str) -> list[Mutation]:
    """Return every change that `mutate` can make of a source file."""
    tree = ast.parse(source)
    skipped = skipped_nodes(tree)
    found = []
    for index, node in enumerate(ast.walk(tree)):
        if id(node) in skipped or not hasattr(node, "lineno"):
            continue
        for kind, change in _changes(node):
            before, after = short(node), "" if kind == "deleted" else short(change_at(node, change))
            if before != after:
                found.append(Mutation(index, node.lineno, kind, f"{before} → {after or 'pass'}"))
    return found


def change_at(node: ast.AST, change: Callable[[ast.AST], None]) -> ast.AST:
    """Return a copy of a node with a change."""
    changed = copy.deepcopy(node)
    change(changed)
    return changed


def mutate(source: str, mutation: Mutation, changes: Changes | None = None) -> str:
    """Return the source with one change; layout and comments are lost.

    Args:
        source: The source.
        mutation: The change.
        changes: What yielded the change; None: `mutations`.
    """
    tree = ast.parse(source)
    node = next(node for index, node in enumerate(ast.walk(tree)) if index == mutation.index)
    if mutation.kind == "deleted":
        for parent in ast.walk(tree):
            for _, body in ast.iter_fields(parent):
                if isinstance(body, list) and node in body:
                    body[body.index(node)] = ast.copy_location(ast.Pass(), node)
    else:
        next(change for kind, change in (changes or _changes)(node) if kind == mutation.kind)(node)
    return ast.unparse(ast.fix_missing_locations(tree))


def _changes(node: ast.AST) -> Iterator[tuple[str, Callable[[ast.AST], None]]]:
    """Yield at most one change of each kind."""
    match node:
        case ast.Compare() if type(node.ops[0]) in _COMPARED:
            yield "operator", _swap_comparison
        case ast.BinOp() if type(node.op) in _COMPUTED and not _is_text(node):
            yield "operator", _swap_operator
        case ast.BoolOp():
            yield "operator", _swap_bool
        case ast.Constant() if other_value(node.value) is not None:
            yield "constant", _change_constant
        case ast.If() | ast.IfExp():
            yield "condition", _always
        case ast.AugAssign() | ast.Raise():
            yield "deleted", _leave
        case ast.Expr() if isinstance(node.value, ast.Call):
            yield "deleted", _leave
        case ast.Assign() if all(isinstance(target, ast.Attribute) for target in node.targets):
            yield "deleted", _leave


def _leave(node: ast.AST) -> None:
    """Change nothing: `mutate` deletes the statement."""


def _swap_comparison(node: ast.AST) -> None:
    assert isinstance(node, ast.Compare)
    node.ops[0] = _COMPARED[type(node.ops[0])]()


def _swap_operator(node: ast.AST) -> None:
    assert isinstance(node, ast.BinOp)
    node.op = _COMPUTED[type(node.op)]()


def _swap_bool(node: ast.AST) -> None:
    assert isinstance(node, ast.BoolOp)
    node.op = ast.Or() if isinstance(node.op, ast.And) else ast.And()


def _change_constant(node: ast.AST) -> None:
    assert isinstance(node, ast.Constant)
    node.value = other_value(node.value)


def _always(node: ast.AST) -> None:
    """Make a condition true."""
    assert isinstance(node, ast.If | ast.IfExp)
    node.test = ast.Constant(True)


def other_value(value: object) -> object:
    """Return another value of the same type, None where there is nothing to change."""
    match value:
        case bool():
            return not value
        case int():
            return value + 1
        case float():
            return value * 1.25 if value else 1.0
        case str() if len(value) > 1 and value[0] in _BYTE_ORDERS and value[1:].replace("x", "").isalnum():
            return _BYTE_ORDERS[value[0]] + value[1:]
    return None


def _is_text(node: ast.BinOp) -> bool:
    return any(
        isinstance(side, ast.JoinedStr) or (isinstance(side, ast.Constant) and isinstance(side.value, str | bytes))
        for side in (node.left, node.right)
    )


def skipped_nodes(tree: ast.AST) -> set[int]:
    """Return the nodes that do nothing at run time, or nothing that a caller sees.

    These are annotations, type-checking blocks and their imports, and how a dataclass is laid out.
    """
    skipped: set[int] = set()
    for node in ast.walk(tree):
        parts: list[ast.AST | None] = []
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            arguments = node.args
            named = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs, arguments.vararg, arguments.kwarg]
            parts = [node.returns, *(argument.annotation for argument in named if argument is not None)]
        elif isinstance(node, ast.AnnAssign):
            parts = [node.annotation]
        elif isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            parts = [node]
        elif isinstance(node, ast.Call) and ast.unparse(node.func) == "cast":
            parts = [node.args[0]]
        elif isinstance(node, ast.ClassDef):
            parts = [each for each in node.decorator_list if "dataclass" in ast.unparse(each)]
        elif isinstance(node, ast.Call) and ast.unparse(node.func) == "field":
            parts = [keyword.value for keyword in node.keywords if keyword.arg in ("init", "compare", "repr")]
        for part in parts:
            if part is not None:
                skipped.update(id(inner) for inner in ast.walk(part))
    return skipped


def short(node: ast.AST) -> str:
    shown = node.test if isinstance(node, ast.If) else node
    text = " ".join(ast.unparse(ast.fix_missing_locations(copy.deepcopy(shown))).split())
    return text if len(text) <= 90 else text[:87] + "…"
