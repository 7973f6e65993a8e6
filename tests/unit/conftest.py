"""Fixtures of the unit tests: config texts, an engine on a rig, and single samples."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from device_links import links  # noqa: F401 - a fixture
from engine_rig import FULL_IMAGE, GRIPPER, LEFT, RIG, RIGHT, Run, wrench_of
from run_courses import play

from slipd import config
from slipd.config import Config
from slipd.types.samples import TactileSample, WrenchSample


@pytest.fixture
def left() -> str:
    """Config text of a finger with a force sensor and a scanned pad."""
    return LEFT


@pytest.fixture
def right() -> str:
    """Config text of a finger with only a three-axis pad."""
    return RIGHT


@pytest.fixture
def gripper() -> str:
    """Config text of a gripper."""
    return GRIPPER


@pytest.fixture
def rig() -> str:
    """Config text of both fingers and the gripper; ends in the gripper's table."""
    return RIG


@pytest.fixture
def run() -> Run:
    """Two fingers and a gripper, all links up."""
    return play(RIG)


@pytest.fixture
def parse() -> Callable[[str], Config]:
    """Parse a config text."""
    return lambda text: config.parse(text, "rig.toml")


@pytest.fixture
def wrench() -> Callable[..., WrenchSample]:
    """Make a force reading: ``wrench(t_ns, normal, tangential, spin, centroid, status=…)``."""

    def make(t_ns: int, *contact: Any, status: tuple[str, ...] = (), **more: Any) -> WrenchSample:
        return WrenchSample(t_ns, None, *wrench_of(*contact, **more), status)

    return make


@pytest.fixture
def image() -> Callable[..., TactileSample]:
    """Make an image of the left pad: ``image(t_ns, counts)``."""
    return lambda t_ns, counts=FULL_IMAGE: TactileSample(t_ns, None, np.asarray(counts, dtype=float).ravel())
