"""The layout of the daemon: file names that are unique, files of a readable length, rooms with a description and
tests."""

from __future__ import annotations

import ast
from collections import Counter
from pathlib import Path

from project import DAEMON, ROOT

MOST_LINES = 300
LONGER = {
    "engine/engine.py": "every event enters here, and every output leaves here",
    "finger/finger.py": "the order of all steps from a reading to its verdict, and all that other rooms ask of it",
    "fusion/limit_surface.py": "each question about a contact has its whole contract and an example beside it",
    "fusion/loads.py": "likewise each rule that distributes a normal force",
    "gripper/grip_rules.py": "one function for each rule of the gate",
}
"""Longer files, and why."""

FILES = sorted(DAEMON.rglob("*.py"))


def test_no_file_name_occurs_twice() -> None:
    names = Counter(path.name for path in FILES if path.name != "__init__.py")
    assert [name for name, count in names.items() if count > 1] == []


def test_no_file_is_too_long() -> None:
    lengths = {str(path.relative_to(DAEMON)): len(path.read_text(encoding="utf-8").splitlines()) for path in FILES}
    assert {name for name, lines in lengths.items() if lines > MOST_LINES} <= LONGER.keys()


def test_every_room_has_a_description() -> None:
    for folder in {path.parent for path in FILES}:
        text = (folder / "__init__.py").read_text(encoding="utf-8")
        assert ast.get_docstring(ast.parse(text)), f"{folder} needs a docstring in its __init__.py"


def rooms(folder: Path) -> set[str]:
    return {path.parent.name for path in folder.glob("*/*.py")}


def test_the_unit_tests_have_the_rooms_of_the_daemon() -> None:
    """Besides them, ``client`` has the tests of ``clients/slipd_client``, and ``docs`` those of the documents."""
    assert rooms(ROOT / "tests" / "unit") - {"client", "docs"} == rooms(DAEMON)
