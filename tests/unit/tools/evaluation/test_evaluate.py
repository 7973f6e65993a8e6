"""Recordings with several configs: cached, and one bad recording does not harm the others."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest
from replays import RECORDINGS

from slipd.tools.evaluation import evaluate as module
from slipd.tools.evaluation.config_run import RECORDED, ConfigRun, run_config
from slipd.tools.evaluation.evaluate import Evaluation, ResultCache, evaluations, finished_runs, short_names
from slipd.tools.evaluation.executors import Finished, LastingFault, NamedConfig, Work, here

Write = Callable[..., Path]
XELA, GAUGES = RECORDINGS / "xela.mcap", RECORDINGS / "gauges.mcap"


@pytest.fixture
def cache(tmp_path: Path) -> ResultCache:
    return ResultCache(tmp_path / "results")


def evaluate(paths: Sequence[Path], configs: Sequence[NamedConfig], cache: ResultCache) -> list[Evaluation]:
    return evaluations(finished_runs(paths, configs, cache), paths, configs)


def only_known(work: Work) -> Iterator[Finished]:
    """An executor that has nothing to replay."""
    for found in work:
        assert isinstance(found, Finished)
        yield found


def test_every_recording_is_replayed_with_its_own_config_first(cache: ResultCache, config_file: Write) -> None:
    (found,) = evaluate([XELA], [NamedConfig("a.toml", config_file("xela", "a.toml").read_text())], cache)
    run = run_config(XELA, None, RECORDED)
    assert (found.name, found.faults, list(found.runs.items())) == ("xela.mcap", [], [(RECORDED, run), ("a.toml", run)])


def test_a_second_evaluation_replays_nothing(cache: ResultCache, config_file: Write) -> None:
    other = NamedConfig("a.toml", config_file("xela", "a.toml").read_text())
    first = {found.job.config.name: (found.run, True) for found in finished_runs([XELA], [other], cache)}
    again = finished_runs([XELA], [other], cache, only_known)
    assert {found.job.config.name: (found.run, found.kept) for found in again} == first


def test_a_recording_that_a_worker_cannot_open_is_tried_again(cache: ResultCache, tmp_path: Path) -> None:
    path, elsewhere = tmp_path / "away.mcap", tmp_path / "elsewhere.mcap"
    path.write_bytes(XELA.read_bytes())

    def without_the_storage(work: Work) -> Iterator[Finished]:
        for job in work:
            path.rename(elsewhere)
            yield from here(iter([job]))
            elsewhere.rename(path)

    (first,) = finished_runs([path], [], cache, without_the_storage)
    assert first.run == f"{path}: cannot be opened: No such file or directory"
    (again,) = finished_runs([path], [], cache)
    assert isinstance(again.run, ConfigRun)


def test_long_recordings_are_replayed_in_processes(cache: ResultCache, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "FEW_BYTES", 0)
    monkeypatch.setattr(module.os, "sched_getaffinity", lambda pid: {0, 1})
    monkeypatch.setattr(module, "in_processes", lambda work: (Finished(job, "elsewhere") for job in work))
    assert [found.run for found in finished_runs([XELA, GAUGES], [], cache)] == ["elsewhere", "elsewhere"]


def test_a_config_that_fits_one_recording_may_not_fit_another(cache: ResultCache, config_file: Write) -> None:
    other = NamedConfig("a.toml", config_file("gauges", "a.toml").read_text())
    xela, gauges = evaluate([XELA, GAUGES], [other], cache)
    assert [type(run) for found in (gauges, xela) for run in found.runs.values()] == [*[ConfigRun] * 3, LastingFault]
    assert xela.faults[0].endswith("the config must have the link 'left.pad' of an event, got left.wrench (a.toml)")


def test_names_have_as_many_folders_as_make_them_differ() -> None:
    assert short_names([Path("/runs/x/a.mcap"), Path("/runs/y/a.mcap")]) == ["x/a.mcap", "y/a.mcap"]
    assert short_names([]) == []
