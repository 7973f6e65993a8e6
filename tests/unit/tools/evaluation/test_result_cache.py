"""Results of earlier evaluations."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from slipd.tools.evaluation import evaluate
from slipd.tools.evaluation.config_run import RECORDED, ConfigRun, Largest, LevelSpan
from slipd.tools.evaluation.evaluate import ResultCache, cache_folder
from slipd.tools.evaluation.executors import Job, LastingFault, NamedConfig

RUN = ConfigRun(
    {"left": [LevelSpan("warning", ("rotation",), ("load_drop",), 0.0, 1.5)]}, Largest(0.9, "left", 1.0), 2.0
)

FAULT = LastingFault("a.mcap: not an MCAP file, and so not a recording of slipd")


def job(key: str, path: str = "a.mcap", config: str = RECORDED) -> Job:
    return Job(Path(path), NamedConfig(config, None), key)


@pytest.fixture
def cache(cache_home: Path) -> ResultCache:
    return ResultCache(cache_folder())


def test_a_result_is_found_again(cache: ResultCache, cache_home: Path) -> None:
    assert cache.get(job("a")) is None
    cache.put(job("a"), RUN)
    assert [cache.get(job(key)) for key in ("a", "b")] == [RUN, None]
    assert [path.name for path in (cache_home / "slipd" / "evaluate").iterdir()] == ["a.json"]


def test_a_fault_is_kept_for_the_recording_and_the_config_that_it_names(cache: ResultCache) -> None:
    cache.put(job("a"), FAULT)
    cut_off = ConfigRun({}, fault="b.mcap: was cut off")
    cache.put(job("a", "b.mcap"), cut_off)
    found = cache.get(job("a"))
    assert (found, type(found)) == (FAULT, LastingFault)
    others = (job("a", "b.mcap"), job("a", "c.mcap"), job("a", config="a.toml"), job("b"))
    assert [cache.get(each) for each in others] == [cut_off, None, None, None]


def test_a_key_changes_with_recording_config_and_code(
    cache: ResultCache, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, other = tmp_path / "one", tmp_path / "other"
    one.write_bytes(b"one")
    other.write_bytes(b"other")
    keys = {*cache.keys(one, [None, "mu = 1", "mu = 2"]), *cache.keys(other, [None])}
    assert len(keys) == 4
    assert cache.keys(one, ["mu = 1"])[0] in keys
    monkeypatch.setattr(evaluate, "own_stamp", lambda: "newer")
    assert cache.keys(one, [None])[0] not in keys


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", '{"spans": {"left": [{}]}, "largest": null}', "\x00"])
def test_a_damaged_result_is_none(cache: ResultCache, text: str) -> None:
    cache.put(job("a"), RUN)
    (cache_folder() / "a.json").write_text(text)
    assert cache.get(job("a")) is None


@pytest.mark.parametrize(
    ("most", "needed", "pruned", "left"),
    [(2, 0, True, "ab"), (1, 2, True, "ab"), (1, 0, False, "abc")],
    ids=["the newest", "those that are needed now", "all of a shared folder"],
)
def test_the_oldest_results_make_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, most: int, needed: int, pruned: bool, left: str
) -> None:
    monkeypatch.setattr(evaluate, "MOST_RESULTS", most)
    cache = ResultCache(tmp_path, pruned=pruned)
    for age, name in ((0, "a"), (9, "b"), (2, "c")):
        cache.put(job(name), RUN)
        os.utime(tmp_path / f"{name}.json", (1000.0 - age, 1000.0 - age))
    cache.get(job("b"))  # what is used counts as new
    (tmp_path / ".left.json.x1").write_text("of a run that was killed")
    cache.prune(needed)
    assert sorted(path.name[0] for path in tmp_path.glob("*.json")) == list(left)
    assert (tmp_path / ".left.json.x1").exists() == (not pruned)
