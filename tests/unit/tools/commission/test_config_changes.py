"""Which keys of the config change for what was found of the fingers."""

from __future__ import annotations

from commission_rig import TAXELS

from slipd import config
from slipd.tools.commission.config_update import FingerResult, changes, fragment

RIG = config.parse(
    "".join(TAXELS.format(name=name, number=k, flip_y="false") for k, name in enumerate(("left", "right"), 1)), "rig"
)


def result(other: str, axes: tuple[int, int, int] = (1, 1, -1)) -> FingerResult:
    """What was found of a finger whose sensors are in the tables of the other one."""
    return FingerResult(None, None, axes, {"pad": other, "wrench": other})


def test_sensors_of_fingers_that_are_swapped_change_hands_once() -> None:
    both = changes(RIG, {"left": result("right"), "right": result("left")})
    assert fragment(both) == '[finger.left.pad]\nsensor = "2"\n[finger.right.pad]\nsensor = "1"'
    assert changes(RIG, {"left": result("right")}) == both, "the other finger follows"
