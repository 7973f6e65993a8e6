"""Fingers: exact or noisy, and a press at a time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from finger_bench import FULL, NoisyFinger, Press, make_finger, read_force
from fixture_types import Parse, Wrench
from nanoseconds import MS, T0

from slipd.finger.finger import Finger
from slipd.finger.finger_state import FingerState
from slipd.finger.freshness import PROMPT, Arrival
from slipd.types.samples import TactileSample


@pytest.fixture
def finger(left: str, parse: Parse) -> Finger:
    """μ 0.5, contact from 0.5 N, 4×4 taxels at 4 mm, force at 1000 Hz, images at 100 Hz."""
    return make_finger(left, parse)


@pytest.fixture
def untared(left: str, parse: Parse) -> Finger:
    """The same finger, whose zeros are not known."""
    return make_finger(left, parse, zeros=False)


@pytest.fixture
def make_press(wrench: Wrench) -> Callable[[Finger], Press]:
    """A reading on a fresh image, ``ms`` after the one before: ``press(normal, tangential, spin, centroid)``."""

    def make(finger: Finger) -> Press:
        now = [T0]

        def press(
            *contact: float, ms: float = 10.0, counts: np.ndarray | None = FULL, image_status: tuple[str, ...] = (),
            arrival: Arrival = PROMPT, **more: object,
        ) -> FingerState:  # fmt: skip
            now[0] += round(ms * MS)
            if counts is not None:
                finger.update_image(TactileSample(now[0], None, np.asarray(counts, dtype=float).ravel(), image_status))
            return read_force(finger, wrench(now[0], *contact, **more), arrival=arrival)

        return press

    return make


@pytest.fixture
def press(finger: Finger, make_press: Callable[[Finger], Press]) -> Press:
    """Presses that finger."""
    return make_press(finger)


@pytest.fixture
def make_noisy(left: str, parse: Parse) -> Callable[..., NoisyFinger]:
    """A noisy finger; the arguments are further lines of its force sensor and of its pad."""

    def make(wrench: str = "", pad: str = "") -> NoisyFinger:
        text = left.replace("stuck_after = 0", wrench) + pad
        return NoisyFinger(make_finger(text.replace("rate_hz = 100.0", "rate_hz = 50.0"), parse))

    return make


@pytest.fixture
def noisy(make_noisy: Callable[..., NoisyFinger]) -> NoisyFinger:
    return make_noisy()
