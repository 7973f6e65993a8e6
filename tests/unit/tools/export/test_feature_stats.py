"""Statistics of episodes make those of the whole, and leave out what is not known."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from slipd.tools.export.lerobot_dataset import QUANTILES, FeatureStats


def episodes(sizes: list[int], missing: float) -> list[np.ndarray]:
    random = np.random.default_rng(7)
    found = [random.normal((1.0, -200.0, 1e-3), (2.0, 0.1, 1e-4), (size, 3)) for size in sizes]
    for block in found:
        block[random.random(block.shape) < missing] = np.nan
    return found


@pytest.mark.parametrize("missing", [0.0, 0.3])
def test_episodes_give_the_statistics_of_all_frames(missing: float) -> None:
    parts = episodes([5, 1, 400, 37], missing)
    every = np.concatenate(parts)
    alone = FeatureStats.of(every).summary()
    together = functools.reduce(lambda found, part: FeatureStats.of(part).with_others(found), parts, None).summary()
    for found in (alone, together):
        assert found["count"] == [443]
        for name, value in (("min", np.nanmin), ("max", np.nanmax), ("mean", np.nanmean), ("std", np.nanstd)):
            np.testing.assert_allclose(found[name], value(every, axis=0), rtol=1e-12)
    known = np.array([np.isfinite(part).sum(axis=0) for part in parts])
    for name, level in QUANTILES.items():
        np.testing.assert_allclose(alone[name], np.nanquantile(every, level, axis=0), rtol=1e-12)
        each = np.array([FeatureStats.of(part).summary()[name] for part in parts])
        np.testing.assert_allclose(together[name], (known * each).sum(axis=0) / known.sum(axis=0), rtol=1e-12)


def test_a_number_that_is_never_known_is_0_and_disturbs_no_other() -> None:
    found = FeatureStats.of(np.array([[np.nan, 1.0], [np.nan, 3.0]]))
    for stats in (found, found.with_others(found)):
        values = {name: numbers for name, numbers in stats.summary().items() if name != "count"}
        assert {name: numbers[0] for name, numbers in values.items()} == dict.fromkeys(values, 0.0)
        assert (values["mean"][1], values["std"][1], values["q50"][1]) == (2.0, 1.0, 2.0)
