"""Files that come with slipd: configs, files for systemd and udev, and pages of the docs, found by name."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from pathlib import Path

from slipd.errors import UsageError

_PACKAGE = Path(__file__).parents[1] / "shipped"
ROOT = _PACKAGE if _PACKAGE.is_dir() else Path(__file__).parents[3]
"""The folder of README.md, ``config/`` and ``docs/``."""
CONFIGS, DOCS = ROOT / "config", ROOT / "docs"


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
    raise UsageError(f"there is no {kind} {name!r}; {_nearest(name, [key.removesuffix(suffix) for key in files])}")


def _nearest(name: str, known: Iterable[str]) -> str:
    names = list(known)
    near = difflib.get_close_matches(name, names, n=1)
    return f"did you mean {near[0]!r}?" if near else f"known: {', '.join(names)}"
