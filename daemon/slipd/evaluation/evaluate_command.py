"""The command ``slipd evaluate``: a table on the standard output, and a picture in a folder."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path

from slipd import config
from slipd.errors import SlipdError
from slipd.evaluation.config_run import RECORDED
from slipd.evaluation.evaluate import Evaluation, NamedConfig, evaluate, short_names
from slipd.evaluation.evaluation_table import as_map, comparisons, table
from slipd.evaluation.level_picture import picture
from slipd.evaluation.result_cache import ResultCache, cache_folder
from slipd.progress import Progress

PICTURE = "levels.svg"


def evaluate_command(recordings: Sequence[Path], configs: Sequence[Path], out: Path | None, *, as_json: bool) -> bool:
    """Evaluate, print the table and write the picture.

    Args:
        recordings: The recordings.
        configs: Configs to replay them with, beside that of each recording.
        out: Folder for the picture, made where it is missing; None: no picture.
        as_json: Print one JSON list instead of the table.

    Returns:
        Whether every recording is complete and was replayed with every config.

    Raises:
        ConfigError: A config cannot be read or has faults.
        SlipdError: The picture cannot be written.
    """
    named = _named(list(dict.fromkeys(configs)))
    if out is not None:
        _make(out)
    progress = Progress(lambda done, of: f"{done} of {of} runs")
    try:
        found = evaluate(recordings, named, ResultCache(cache_folder()), progress.show)
    finally:
        progress.erase()
    if as_json:
        print(json.dumps(as_map(found), ensure_ascii=False, allow_nan=False))
    else:
        _print(found)
    if out is not None:
        _write(out / PICTURE, picture(found))
        print(f"{out / PICTURE}: written", file=sys.stderr if as_json else sys.stdout)
    faults = list(dict.fromkeys(fault for one in found for fault in one.faults))
    for fault in faults:
        print(f"slipd: {fault}", file=sys.stderr)
    return not faults


def _named(paths: list[Path]) -> list[NamedConfig]:
    names = [f"./{name}" if name == RECORDED else name for name in short_names(paths)]
    return [NamedConfig(name, config.load(path).text) for name, path in zip(names, paths, strict=True)]


def _print(found: Sequence[Evaluation]) -> None:
    for line in table(found):
        print(line)
    compared = list(comparisons(found))
    if compared:
        print()
    for line in compared:
        print(line)


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SlipdError(f"{folder}: cannot be made: {error.strerror}") from error


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise SlipdError(f"{path}: cannot be written: {error.strerror}") from error
