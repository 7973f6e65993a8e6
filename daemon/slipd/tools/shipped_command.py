"""The commands ``slipd config`` and ``slipd docs``, and what ``slipd`` alone prints."""

from __future__ import annotations

import shutil
import textwrap
from pathlib import Path

from slipd import __version__
from slipd.config.shipped_files import CONFIGS, DOCS, config_file, config_files, page_file, pages
from slipd.tools.service_command import own_program, with_program

FIRST_STEPS = f"""\
slipd {__version__} warns a robot that its gripper is about to drop something.

Without hardware:
    slipd demo                                run the daemon on a virtual gripper

With your rig:
    slipd config list                         list the shipped configs: choose the nearest
    slipd config show NAME > my_rig.toml      then adapt the values marked MEASURE
    slipd check my_rig.toml                   report every fault in it
    slipd run my_rig.toml                     run the daemon
    slipctl status                            show the health of every sensor, in another terminal

To read on:
    slipd docs                                list the pages; slipd docs NAME prints one
    slipd --help                              list all commands"""


LEAST_COLUMNS = 30
"""Width of the second column of a list on a narrow terminal."""


def print_configs() -> None:
    """Print the folder of the shipped configs, and each file with the first sentence of its comment."""
    print(f"{CONFIGS}: `slipd config show NAME` prints one")
    _print_table({path.name.removesuffix(".toml"): _purpose(path) for path in config_files()})


def print_config(name: str) -> None:
    """Print a shipped config as it is, so that it can be redirected to a file; a systemd unit starts this program.

    Raises:
        SlipdError: There is no such file.
    """
    path = config_file(name)
    text = path.read_text(encoding="utf-8")
    print(with_program(text, own_program()) if path.suffix == ".service" else text, end="")


def print_pages() -> None:
    """Print the folder of the docs, which has their pictures too, and each page with its title."""
    print(f"{DOCS}: `slipd docs NAME` prints a page")
    _print_table({name: _title(path) for name, path in pages().items()})


def print_page(name: str) -> None:
    """Print one page, Markdown.

    Raises:
        SlipdError: There is no such page.
    """
    print(page_file(name).read_text(encoding="utf-8"), end="")


def _print_table(rows: dict[str, str]) -> None:
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
