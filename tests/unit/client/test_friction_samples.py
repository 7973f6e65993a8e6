"""Which pulls agree, what they say together, and the lines for the config."""

from __future__ import annotations

import math
import random
import statistics
import tomllib

import pytest

from slipd_client.friction_pull import PullSample
from slipd_client.friction_samples import agreeing, config_lines, disagreement, median_of, spread


def samples(*values: float) -> list[PullSample]:
    return [PullSample(value, 0.8 * value, 10.0) for value in values]


def test_samples_within_a_quarter_agree_and_the_largest_group_counts() -> None:
    assert agreeing([]) == []
    assert [each.mu_s for each in agreeing(samples(0.5, 0.8, 0.52, 0.55))] == [0.5, 0.52, 0.55]
    assert [each.mu_s for each in agreeing(samples(0.3, 0.31, 0.5, 0.6))] == [0.3, 0.31], "of two, the closer one"


def test_a_sample_that_is_left_out_says_how_far_it_is_off() -> None:
    group = agreeing(found := samples(0.5, 0.8, 0.52, 0.54))
    assert [disagreement(each, group) for each in found] == ["", "0.800 is 54% from the others, 0.520", "", ""]


def test_the_median_leaves_out_slides_without_dynamic_friction() -> None:
    group = [PullSample(0.5, None, 9.0), PullSample(0.52, 0.4, 10.0), PullSample(0.56, 0.44, 11.0)]
    assert median_of(group) == (0.52, pytest.approx(0.42), 10.0)
    assert median_of(group[:1]).mu_d is None


def test_the_spread_holds_what_the_next_grasp_shows() -> None:
    """One grasp in six is below the median less the spread: few samples do not make it too small."""
    rng = random.Random(7)
    below, trials = 0, 4000
    for _ in range(trials):
        *found, following = (rng.gauss(0.5, 0.02) for _ in range(4))
        group = sorted(samples(*found))
        wide = spread(group)
        assert wide is not None
        below += following < statistics.mean(found) * (1.0 - wide)
    assert below / trials == pytest.approx(0.159, abs=4 * math.sqrt(0.159 * 0.841 / trials) + 0.01)


def test_one_sample_shows_no_spread() -> None:
    assert spread(samples(0.5)) is None


def test_the_lines_for_the_config_are_toml() -> None:
    found = tomllib.loads("\n".join(config_lines("left", samples(0.5, 0.52, 0.54))))
    assert found["finger"]["left"] == {"mu": 0.52, "mu_spread": pytest.approx(0.059)}
    assert tomllib.loads("\n".join(config_lines("left", samples(0.5)))) == {"finger": {"left": {"mu": 0.5}}}
    assert tomllib.loads("\n".join(config_lines("left", samples(0.5, 0.5, 0.5))))["finger"]["left"]["mu_spread"] > 0
