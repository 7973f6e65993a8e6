"""A hand whose readings teach friction, with kernels that are compiled or not."""

from __future__ import annotations

import learning_hand
import pytest
from learning_hand import Hand
from plain_kernels import run_without_compilation

from slipd.friction import friction_estimate
from slipd.fusion import friction_learning


@pytest.fixture
def hand() -> Hand:
    """μ 0.5 by the config with a spread of a tenth, at most 1."""
    return Hand()


@pytest.fixture(params=["compiled", "plain"])
def both_ways(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run a test with the compiled kernels, and without compilation, which shows coverage their lines."""
    if request.param == "plain":
        run_without_compilation(monkeypatch, friction_learning, friction_estimate, learning_hand)
