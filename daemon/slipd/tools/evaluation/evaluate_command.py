"""The command ``slipd evaluate``: a table and a picture for a person, or a Parquet file of many recordings."""

from __future__ import annotations

import contextlib
import json
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from slipd.errors import SlipdError
from slipd.io.progress import Progress
from slipd.tools.evaluation.config_run import RECORDED
from slipd.tools.evaluation.evaluate import Evaluation, evaluations, finished_runs, short_names
from slipd.tools.evaluation.evaluation_table import as_map, comparisons, table
from slipd.tools.evaluation.executors import Executor
from slipd.tools.evaluation.jobs import Finished, NamedConfig
from slipd.tools.evaluation.level_picture import picture
from slipd.tools.evaluation.result_cache import ResultCache
from slipd.types.device_text import printable

PICTURE = "levels.svg"

SHOWN_FAULTS = 20
"""Most faults that are printed beside a Parquet file, which has all of them."""


class EvaluateCommand:
    """Replays recordings with several configs.

    Args:
        recordings: The recordings, each once.
        configs: Configs to replay them with, beside that of each recording.
        cache: Results of earlier evaluations.
        executor: Where the replays run; None: on all cores of this machine.

    Raises:
        ConfigError: A config cannot be read or has faults.
    """

    def __init__(
        self, recordings: Sequence[Path], configs: Sequence[Path], cache: ResultCache, executor: Executor | None = None
    ) -> None:
        self._recordings = recordings
        self._configs = _named(list(dict.fromkeys(configs)))
        self._cache = cache
        self._executor = executor

    def show(self, out: Path | None, *, as_json: bool) -> bool:
        """Print the table, and write the picture.

        Args:
            out: Folder for the picture, made where it is missing; None: no picture.
            as_json: Print one JSON list instead of the table.

        Returns:
            Whether every recording is complete and was replayed with every config.

        Raises:
            SlipdError: The picture cannot be written.
        """
        if out is not None:
            _make(out)
        with self._finished() as finished:
            found = evaluations(finished, self._recordings, self._configs)
        if as_json:
            print(json.dumps(as_map(found), ensure_ascii=False, allow_nan=False))
        else:
            _print(found)
        if out is not None:
            _write(out / PICTURE, picture(found))
            print(f"{out / PICTURE}: written", file=sys.stderr if as_json else sys.stdout)
        return _told(dict.fromkeys(fault for one in found for fault in one.faults))

    def write(self, path: Path) -> bool:
        """Write a Parquet file with one row for each recording and config.

        Returns:
            Whether every recording is complete and was replayed with every config.

        Raises:
            SlipdError: pyarrow is not installed, or the file cannot be written.
        """
        from slipd.tools.evaluation.run_table import write_table  # here: only a table needs what reads recordings

        with self._finished() as finished:
            totals = write_table(path, finished, SHOWN_FAULTS)
        print(
            f"{path}: {totals.runs} runs of {len(self._recordings)} recordings, {totals.kept} of them known before, "
            f"{totals.without_run} failed, {totals.warned} with an alarm; {totals.compute_s:.1f} s of computing"
        )
        return _told(totals.faults)

    @contextmanager
    def _finished(self) -> Iterator[Iterator[Finished]]:
        """Give the finished runs, and show how far they are."""
        of = len(self._recordings) * (1 + len(self._configs))
        begun_s = time.monotonic()
        progress = Progress(lambda done, of: f"{done} of {of} runs, {time.monotonic() - begun_s:.0f} s")
        with progress.shown() as show:
            show(0, of)
            with contextlib.closing(
                finished_runs(self._recordings, self._configs, self._cache, self._executor)
            ) as runs:
                yield _counted(runs, show, of)


def _counted(runs: Iterable[Finished], show: Callable[[int, int], None], of: int) -> Iterator[Finished]:
    for done, run in enumerate(runs, 1):
        show(done, of)
        yield run


def _told(faults: Iterable[str]) -> bool:
    """Print faults; return whether there are none."""
    none = True
    for fault in faults:
        none = False
        print(f"slipd: {printable(fault)}", file=sys.stderr)
    return none


def _named(paths: list[Path]) -> list[NamedConfig]:
    if not paths:
        return []
    from slipd import config  # here: only a config that is given needs the models of its tables

    names = [f"./{name}" if name == RECORDED else name for name in short_names(paths)]
    return [NamedConfig(name, config.load(path).text) for name, path in zip(names, paths, strict=True)]


def _print(found: Sequence[Evaluation]) -> None:
    for line in table(found):
        print(printable(line))
    compared = list(comparisons(found))
    if compared:
        print()
    for line in compared:
        print(printable(line))


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
