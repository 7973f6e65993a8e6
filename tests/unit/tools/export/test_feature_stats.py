"""Statistics in blocks are those of the whole, and leave out what is not known."""

from __future__ import annotations

import numpy as np
import pytest

from slipd.tools.export.frames import QUANTILES, FeatureStats


def blocks(sizes: list[int], missing: float) -> list[np.ndarray]:
    random = np.random.default_rng(7)
    found = [random.normal((1.0, -200.0, 1e-3), (2.0, 0.1, 1e-4), (size, 3)) for size in sizes]
    for block in found:
        block[random.random(block.shape) < missing] = np.nan
    return found


@pytest.mark.parametrize("missing", [0.0, 0.3])
def test_blocks_give_the_statistics_of_all_frames(missing: float) -> None:
    parts = blocks([5, 1, 400, 37], missing)
    stats = FeatureStats(3)
    for part in parts:
        stats.add(part)
    every, found = np.concatenate(parts), stats.summary()
    assert found["count"] == [443]
    for name, value in (("min", np.nanmin), ("max", np.nanmax), ("mean", np.nanmean), ("std", np.nanstd)):
        np.testing.assert_allclose(found[name], value(every, axis=0), rtol=1e-12)
    for name, level in QUANTILES.items():
        np.testing.assert_allclose(found[name], np.nanquantile(every, level, axis=0), rtol=1e-12)


def test_a_number_that_is_never_known_is_0_and_disturbs_no_other() -> None:
    stats = FeatureStats(2)
    stats.add(np.array([[np.nan, 1.0], [np.nan, 3.0]]))
    found = stats.summary()
    assert {name: values[0] for name, values in found.items() if name != "count"} == dict.fromkeys(
        ("min", "max", "mean", "std", *QUANTILES), 0.0
    )
    assert (found["mean"][1], found["std"][1], found["q50"][1]) == (2.0, 1.0, 2.0)


def test_quantiles_of_long_runs_come_from_evenly_spaced_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("slipd.tools.export.frames.MOST_SAMPLES", 100)
    stats = FeatureStats(1)
    frames = np.arange(10_000.0)[:, None]
    for begin in range(0, 10_000, 77):
        stats.add(frames[begin : begin + 77])
    sample = stats._sample[:, 0]
    assert 50 <= len(sample) <= 100
    assert set(np.diff(sample)) == {stats._stride}
    assert stats.summary()["q50"][0] == pytest.approx(5000.0, rel=0.02)
    assert stats.summary()["mean"] == [pytest.approx(4999.5)]
