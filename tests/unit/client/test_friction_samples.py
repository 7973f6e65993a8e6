"""Which pulls agree, what they say together, and the lines for the config."""

from __future__ import annotations

import random
import statistics
import tomllib

import pytest

from slipd_client.friction_pull import PullSample
from slipd_client.friction_session import agreeing, config_lines, disagreement, median_of, spread


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


@pytest.mark.parametrize(("scatter", "most"), [(0.05, 0.16), (0.02, 0.02), (0.1, 0.25)])
def test_the_spread_holds_what_the_next_pull_shows(scatter: float, most: float) -> None:
    """At most one pull in six is below the mean less the spread where the scatter is usual."""
    rng = random.Random(7)
    below, trials = 0, 4000
    for _ in range(trials):
        *found, following = (rng.gauss(0.5, 0.5 * scatter) for _ in range(4))
        below += following < statistics.mean(found) * (1.0 - spread(sorted(samples(*found))))
    assert 0.75 * most - 0.02 < below / trials < most


def test_pulls_that_agree_by_chance_do_not_show_a_spread_of_nothing() -> None:
    assert spread(samples(0.5)) == pytest.approx(0.093, abs=0.001), "that of one pull is the usual one"
    assert 0.03 < spread(samples(0.5, 0.5, 0.5)) < spread(samples(0.48, 0.5, 0.52)) < spread(samples(0.45, 0.5, 0.55))


def test_the_lines_for_the_config_are_toml_with_a_low_estimate() -> None:
    found = tomllib.loads("\n".join(config_lines("left", samples(0.5, 0.52, 0.54))))
    assert found["finger"]["left"] == {"mu": pytest.approx(0.52 * 0.941, abs=1e-3), "mu_spread": 0.059}
    assert "of 1 pull," in config_lines("left", samples(0.5))[1]
