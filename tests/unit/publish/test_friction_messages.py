"""What a load requires of friction is published, also where no coefficient is known."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from finger_bench import read_force
from known_zeros import known_finger

from slipd.config import Config, Levels
from slipd.finger.finger import Finger
from slipd.publish.finger_messages import slip_body
from slipd.types.samples import TactileSample, WrenchSample

MS = 1_000_000
T0 = 100_000_000_000
FULL = np.full((4, 4), 100)


def held(finger: Finger, wrench: Callable[..., WrenchSample], image: Callable[..., TactileSample]) -> dict[str, Any]:
    """The verdict on a load of 3 N after one of 2 N was carried for 0.4 s, both at 10 N."""
    for k in range(41):
        t_ns = T0 + 10 * k * MS
        finger.update_image(image(t_ns, FULL))
        read_force(finger, wrench(t_ns, 10.0, (2.0 if k < 40 else 3.0, 0.001 * (k % 3))))
    return slip_body(finger, finger.state)


def test_without_a_coefficient_a_load_is_compared_with_what_was_carried(
    left: str,
    parse: Callable[[str], Config],
    wrench: Callable[..., WrenchSample],
    image: Callable[..., TactileSample],
) -> None:
    finger = known_finger("left", parse(left.replace("mu = 0.5\n", "")).finger["left"], Levels())
    body = held(finger, wrench, image)
    assert (body["mu"], body["mu_source"], body["utilisation"], body["reasons"]) == (None, "none", None, ["no_mu"])
    assert body["required_friction"] == pytest.approx(0.3, rel=1e-3)
    assert body["carried_friction"] == pytest.approx(0.2, rel=1e-2)
    assert body["relative_utilisation"] == pytest.approx(1.5, rel=1e-2)


def test_required_friction_is_the_utilisation_times_the_coefficient(
    left: str,
    parse: Callable[[str], Config],
    wrench: Callable[..., WrenchSample],
    image: Callable[..., TactileSample],
) -> None:
    body = held(known_finger("left", parse(left).finger["left"], Levels()), wrench, image)
    assert body["mu_source"] == "config"
    assert body["required_friction"] == pytest.approx(body["utilisation"] * body["mu"])
