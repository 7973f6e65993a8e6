"""Files that come with slipd: configs, files for systemd and udev, and pages of the docs, found by name and printed.

It imports nothing but the standard library, so ``make install`` and ``make uninstall`` run it without any package.
"""

from __future__ import annotations

import difflib
import json
import re
import shutil
import sys
import textwrap
from pathlib import Path

from slipd.errors import UsageError

_PACKAGE = Path(__file__).parents[1] / "shipped"
ROOT = _PACKAGE if _PACKAGE.is_dir() else Path(__file__).parents[3]
"""The folder of README.md, ``config/`` and ``docs/``."""
CONFIGS, DOCS = ROOT / "config", ROOT / "docs"

LEAST_COLUMNS = 30
"""Width of the second column of a list on a narrow terminal."""


def shipped_config(name: str) -> Path:
    """Return a config of ``config/``; ``.toml`` may be left out.

    Raises:
        UsageError: There is no such config; the text names the nearest one.
    """
    if name in {path.name for path in system_files()}:
        raise UsageError(f"{name} is no config of a rig; print it with: slipd service show {name}")
    return _named("config", name, {path.name: path for path in config_files()}, ".toml")


def config_files() -> list[Path]:
    """Return the configs of ``config/``."""
    return sorted(CONFIGS.rglob("*.toml"))


def system_file(name: str) -> Path:
    """Return a file for systemd or udev.

    Raises:
        UsageError: There is no such file; the text names the nearest one.
    """
    return _named("file", name, {path.name: path for path in system_files()}, ".service")


def system_files() -> list[Path]:
    """Return the files of ``config/`` for systemd and udev."""
    return sorted(path for path in CONFIGS.rglob("*") if path.is_file() and path.suffix != ".toml")


def page_file(name: str) -> Path:
    """Return a page of the docs by its name in `pages`; ``.md`` may be left out.

    Raises:
        UsageError: There is no such page; the text names the nearest one.
    """
    return _named("page", name.removeprefix("docs/"), pages(), ".md")


def pages() -> dict[str, Path]:
    """Return the pages of the docs by name, such as "physics" or "measured/peers"; README comes first."""
    found = [path.relative_to(DOCS) for path in DOCS.rglob("*.md")]
    ordered = sorted(found, key=lambda path: (len(path.parts), path))
    return {"README": ROOT / "README.md"} | {path.with_suffix("").as_posix(): DOCS / path for path in ordered}


def _named(kind: str, name: str, files: dict[str, Path], suffix: str) -> Path:
    for known in (name, name + suffix, name.removesuffix(suffix)):
        if known in files:
            return files[known]
    names = [key.removesuffix(suffix) for key in files]
    near = difflib.get_close_matches(name, [*names, *files], n=1)
    hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(names)}"
    raise UsageError(f"there is no {kind} {name!r}; {hint}")


def own_program() -> Path:
    """Return the command ``slipd`` of this environment."""
    return Path(sys.prefix) / "bin" / "slipd"


def with_program(unit: str, program: Path) -> str:
    """Return a unit that starts this program."""
    return re.sub(r"^ExecStart=\S+", lambda _: start_line(program), unit, flags=re.MULTILINE)


def start_line(program: Path) -> str:
    """Return the beginning of the line that starts a program, quoted as systemd reads it."""
    quoted = str(program).replace("\\", "\\\\").replace('"', '\\"').replace("%", "%%")
    return f'ExecStart="{quoted}"' if re.search(r"[\s\"'\\]", quoted) else f"ExecStart={quoted}"


def shipped_command(kind: str, name: str | None = None, *, as_json: bool = False) -> None:
    """Print a file as it is, so that it can be redirected; a systemd unit starts this program.

    Args:
        kind: The command that prints one: "config show", "docs" or "service show".
        name: Its name in the list; None: print the list.
        as_json: Print the list as one JSON document.

    Raises:
        UsageError: There is no such file.
    """
    if name is None:
        _list_files(kind, as_json=as_json)
        return
    path = {"config show": shipped_config, "docs": page_file, "service show": system_file}[kind](name)
    text = path.read_text(encoding="utf-8")
    print(with_program(text, own_program()) if path.suffix == ".service" else text, end="")


def _list_files(kind: str, *, as_json: bool) -> None:
    """Print the folder of the configs, pages or files for the system, and each file with what it is."""
    folder, rows = {
        "config show": (CONFIGS, {path.name.removesuffix(".toml"): _purpose(path) for path in config_files()}),
        "docs": (DOCS, {name: _title(path) for name, path in pages().items()}),
        "service show": (CONFIGS, {path.name: _purpose(path) for path in system_files()}),
    }[kind]
    if as_json:
        print(json.dumps({"folder": str(folder), "files": rows}, ensure_ascii=False))
        return
    print(f"{folder}: `slipd {kind} NAME` prints one")
    columns = shutil.get_terminal_size().columns
    indent = 6 + max(map(len, rows))
    for name, text in rows.items():
        lines = textwrap.wrap(text, max(columns - indent, LEAST_COLUMNS))
        print(f"    {name}".ljust(indent) + f"\n{'':{indent}}".join(lines))


def _purpose(path: Path) -> str:
    """Return the first sentence of a file's leading comment."""
    comment = []
    for line in path.read_text(encoding="utf-8").splitlines():
        if not line.startswith("# "):
            break
        comment.append(line.removeprefix("# "))
    return " ".join(comment).partition(". ")[0].rstrip(".")


def _title(path: Path) -> str:
    first, _, _ = path.read_text(encoding="utf-8").partition("\n")
    return first.removeprefix("# ")
