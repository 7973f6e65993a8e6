"""The grasps of the measurement: an object at rest weighs m g, and a carried one slides where it is meant to."""

from __future__ import annotations

import numpy as np
import pytest
from carry.__main__ import motion_s
from carry.scenes import carried
from carry.weigh import END_S, LIFT_S, Carry
from evaluate import playing


def test_object_at_rest_loads_the_fingers_by_its_weight_at_its_centre_of_mass() -> None:
    carry = Carry(np.random.default_rng(1), 0.5)
    load, gravity = carry.load(np.array((END_S,)))[0], carry.felt(np.array((END_S,)))[0][0]
    assert np.linalg.norm(load[:3]) == pytest.approx(0.5 * 9.81, rel=0.01)
    assert load[3:] == pytest.approx(0.5 * np.cross(carry.com_m, gravity), abs=1e-3)
    assert motion_s(carry, LIFT_S) == 0.0 < motion_s(carry, END_S)


@pytest.mark.parametrize(("kind", "slides"), [("safe", False), ("slips", True)])
def test_carried_object_slides_where_it_is_meant_to(kind: str, slides: bool) -> None:
    scene, _ = carried(2, kind)  # type: ignore[arg-type]
    trace = playing.play(scene)
    assert bool(playing.truth_of(scene, trace, needs=False).episodes()) is slides
