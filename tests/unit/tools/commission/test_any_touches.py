"""Whatever was touched, the searches answer with findings or problems: a bad touch is no error of the program."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from slipd.tools.commission.mounting_search import find_mounting
from slipd.tools.commission.touches import CENTRE, CORNER, END, STEPS, Mount, Touch, find_three_axis
from slipd.tools.commission.weighing_search import Pose, find_weight

MOUNT = Mount(1, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
NUMBERS = st.sampled_from((0.0, 0.0, 1.0, -1.0, 5.0, -5.0, 1e-300, 1e6)) | st.floats(-1e3, 1e3)
VECTORS = st.tuples(NUMBERS, NUMBERS, NUMBERS).map(np.array)
PLACES = st.none() | st.tuples(*(st.sampled_from((0.0, 0.01, -0.02)),) * 2)
TOUCHES = st.dictionaries(st.sampled_from(STEPS), st.builds(Touch, VECTORS, VECTORS, PLACES))
FULL = st.fixed_dictionaries(dict.fromkeys(STEPS, st.builds(Touch, VECTORS, VECTORS, PLACES)))


@given(TOUCHES | FULL)
def test_any_touches_give_a_mounting_or_problems(touches: dict[str, Touch]) -> None:
    found = find_mounting(touches, MOUNT)
    assert (found.mount is None) <= bool(found.problems)
    found, signs = find_three_axis(touches)
    assert (signs is None) == bool(found.problems)


@given(st.lists(st.builds(Pose, VECTORS, VECTORS, VECTORS, st.none() | VECTORS), min_size=3, max_size=5))
def test_any_poses_give_a_weight_or_problems(poses: list[Pose]) -> None:
    findings = find_weight(poses, MOUNT)
    assert (findings.found is None) <= bool(findings.problems)


def test_a_press_along_the_pad_shows_no_signs() -> None:
    places = {CENTRE: (0.0, 0.0), END: (0.01, 0.0), CORNER: (0.01, 0.005)}
    along = np.array((1.0, 0.0, 0.1))
    found, signs = find_three_axis({step: Touch(along, along, places.get(step, (0.0, 0.0))) for step in STEPS})
    assert signs is None
    assert [text for text in map(str, found.problems) if "right angles" in text]
