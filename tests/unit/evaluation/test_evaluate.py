"""Recordings with several configs: cached, in processes, and one bad recording does not harm the others."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from replays import RECORDINGS

from slipd.evaluation import evaluate as module
from slipd.evaluation.config_run import RECORDED, ConfigRun, run_config
from slipd.evaluation.evaluate import NamedConfig, evaluate, short_names
from slipd.evaluation.result_cache import ResultCache

Write = Callable[..., Path]
XELA, GAUGES = RECORDINGS / "xela.mcap", RECORDINGS / "gauges.mcap"


@pytest.fixture
def cache(tmp_path: Path) -> ResultCache:
    return ResultCache(tmp_path / "results")


def test_every_recording_is_replayed_with_its_own_config_first(cache: ResultCache, config_file: Write) -> None:
    other = NamedConfig("a.toml", config_file("xela", "a.toml").read_text())
    seen: list[tuple[int, int]] = []
    found = evaluate([XELA, XELA], [other], cache, lambda done, of: seen.append((done, of)))
    assert [one.name for one in found] == ["xela.mcap"]
    assert list(found[0].runs) == [RECORDED, "a.toml"]
    assert found[0].runs[RECORDED] == found[0].runs["a.toml"] == run_config(XELA, None, RECORDED)
    assert (found[0].truth, found[0].faults) == (None, [])
    assert seen == [(0, 2), (1, 2), (2, 2)]


def test_a_second_evaluation_replays_nothing(cache: ResultCache, monkeypatch: pytest.MonkeyPatch) -> None:
    first = evaluate([XELA], [], cache)

    def replayed(*arguments: object) -> None:
        raise AssertionError(arguments)

    monkeypatch.setattr(module, "run_config", replayed)
    assert evaluate([XELA], [], cache) == first


def test_processes_give_the_same(cache: ResultCache, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "FEW_BYTES", 0)
    monkeypatch.setattr(module.os, "sched_getaffinity", lambda pid: {0, 1})
    found = evaluate([XELA, GAUGES], [], cache)
    assert [one.runs[RECORDED] for one in found] == [run_config(path, None, RECORDED) for path in (XELA, GAUGES)]


def test_a_bad_recording_does_not_lose_the_others(cache: ResultCache, tmp_path: Path) -> None:
    foreign, cut, gone = tmp_path / "foreign.mcap", tmp_path / "cut.mcap", tmp_path / "gone.mcap"
    foreign.write_bytes(b"no recording")
    cut.write_bytes(XELA.read_bytes()[:-2000])
    found = evaluate([foreign, gone, tmp_path, cut, GAUGES], [], cache)
    assert [one.faults for one in found[:3]] == [
        [f"{foreign}: not an MCAP file, and so not a recording of slipd"],
        [f"{gone}: cannot be opened: No such file or directory"],
        [f"{tmp_path}: cannot be opened: Is a directory"],
    ]
    assert isinstance(found[3].runs[RECORDED], ConfigRun)
    assert len(found[3].faults) == 1
    assert found[4].faults == []
    assert isinstance(found[4].runs[RECORDED], ConfigRun)


def test_a_config_that_fits_one_recording_may_not_fit_another(cache: ResultCache, config_file: Write) -> None:
    other = NamedConfig("a.toml", config_file("gauges", "a.toml").read_text())
    xela, gauges = evaluate([XELA, GAUGES], [other], cache)
    assert isinstance(gauges.runs["a.toml"], ConfigRun)
    assert isinstance(xela.runs["a.toml"], str)
    assert xela.faults[0].endswith("the config must have the link 'left.pad' of an event, got left.wrench (a.toml)")
    assert isinstance(xela.runs[RECORDED], ConfigRun)


@pytest.mark.parametrize(
    ("paths", "names"),
    [
        (["/a/x.mcap", "/b/y.mcap"], ["x.mcap", "y.mcap"]),
        (["/a/x.mcap", "/b/x.mcap"], ["a/x.mcap", "b/x.mcap"]),
        (["x.mcap", "b/x.mcap"], ["x.mcap", "b/x.mcap"]),
        (["/x", "a/x"], ["/x", "a/x"]),
        ([], []),
    ],
)
def test_names_are_as_short_as_they_differ(paths: list[str], names: list[str]) -> None:
    assert short_names([Path(path) for path in paths]) == names
