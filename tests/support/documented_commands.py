"""The shell commands of the documents: every command line of their code blocks, cut into single commands."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from string import Template

from project import DOCS, ROOT

PAGES = [ROOT / "README.md", ROOT / "clients" / "README.md", *sorted(DOCS.glob("*.md"))]

SHELL = ("sh", "bash", "console")
"""Languages of a fenced block of commands; a block that is only indented counts if it begins like one."""

KEYWORDS = {"for", "until", "while", "do", "done", "if", "then", "fi", "wait", "kill", "cd", "["}
"""What the shell itself does."""

PROGRAMS = {"slipd", "slipctl", "python", "make"}
"""Ours, and those that get something of ours as an argument."""

OTHERS = {
    "pip",
    "pipx",
    "uv",
    "sudo",
    "cp",
    "sleep",
    "colcon",
    "ros2",
    "systemctl",
    "journalctl",
    "ssh",
    "docker",
    "ls",
    "openssl",
}
"""Programs of others that a document may name."""

LOOP = re.compile(r"""\bfor (\w+) in "([^"]*)\"""")
"""The variable of a loop, and its first value."""

ASSIGNMENT = re.compile(r"[A-Z_]+=")
SUBSTITUTION = re.compile(r"\$\([^)]*\)")
IMAGE = "IMAGE"
"""Stands for a container's image; a command for the container follows."""

INLINE = re.compile(r"`((?:slipd|slipctl) [a-z][^`]*)`")


@dataclass(frozen=True, slots=True)
class Command:
    """One command of a page.

    Attributes:
        page: The page.
        line: Its line, 1-based.
        words: Program and arguments, without redirections.
        output: File that the standard output is redirected to; "" if it is not.
    """

    page: Path
    line: int
    words: tuple[str, ...]
    output: str

    def __str__(self) -> str:
        return f"{self.page.relative_to(ROOT)}:{self.line}: {' '.join(self.words)}"


def commands(page: Path) -> list[Command]:
    """Return the commands of the code blocks of a page."""
    return [each for line, text in _shell_lines(page) for each in _parse(page, line, text)]


def mentions(page: Path) -> list[Command]:
    """Return the commands of slipd that the text of a page mentions, such as `slipd check FILE`."""
    rows = page.read_text(encoding="utf-8").splitlines()
    found = [(n, text) for n, row in enumerate(rows, start=1) for text in INLINE.findall(row)]
    return [each for line, text in found for each in _parse(page, line, text)[:1]]


def _shell_lines(page: Path) -> Iterator[tuple[int, str]]:
    """Yield the command lines with their numbers; those that end with a backslash are joined."""
    joined = ""
    for number, text in _rows(page):
        joined += text.removesuffix("\\")
        if not text.endswith("\\"):
            yield number, joined
            joined = ""


def _rows(page: Path) -> Iterator[tuple[int, str]]:
    language: str | None = None
    variables: dict[str, str] = {}
    goes_on = False
    for number, row in enumerate(page.read_text(encoding="utf-8").splitlines(), start=1):
        if row.startswith("```"):
            language = row[3:].strip() if language is None else None
        elif language in SHELL or (language is None and row.startswith("    ") and (goes_on or _is_command(row))):
            goes_on = row.endswith("\\")
            variables |= dict(LOOP.findall(row))
            yield number, Template(row.strip()).safe_substitute(variables)


def _is_command(row: str) -> bool:
    words = [word for word in row.split() if not ASSIGNMENT.match(word)]
    return bool(words) and words[0].removeprefix(".venv/bin/") in PROGRAMS | OTHERS


def _parse(page: Path, line: int, text: str) -> list[Command]:
    lexer = shlex.shlex(SUBSTITUTION.sub("0", text), posix=True, punctuation_chars=True)
    lexer.commenters = "#"
    lexer.whitespace_split = True
    found: list[Command] = []
    words: list[str] = []
    output, target = "", False
    for token in [*lexer, ";"]:
        if token in (">", ">>", "<", ">&", "<&"):
            words, target = words[:-1] if words and words[-1] in ("1", "2") else words, True
            direction = token
        elif target:
            output, target = (token if direction == ">" else output), False
        elif set(token) <= set(";&|()"):
            words = [word for word in words if word not in ("do", "then") and not ASSIGNMENT.match(word)]
            if IMAGE in words:
                words = words[words.index(IMAGE) + 1 :]
            if words and words[0] not in KEYWORDS:
                found.append(Command(page, line, (words[0].removeprefix(".venv/bin/"), *words[1:]), output))
            words, output = [], ""
        else:
            words.append(token)
    return found
