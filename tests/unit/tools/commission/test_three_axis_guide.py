"""The guide on a finger whose only sensor is a pad of three-axis taxels, emulated behind the real engine."""

from __future__ import annotations

from pathlib import Path

from commission_person import TOUCHES
from commission_rig import PRESSES, TAXELS
from emulated_engine import EmulatedEngine
from guided_engine import GuidedEngine

from slipd import config
from slipd.tools.commission.commission_guide import Commission
from slipd.tools.commission.dialogue import follow

TRUE = "# A rig.\n[finger.left]\nmu = 0.5\nmin_normal_n = 0.3\n" + TAXELS.format(name="left", number=1, flip_y="false")


def test_orientation_and_signs_of_the_axes_are_found_and_there_is_no_weight_to_find(tmp_path: Path) -> None:
    wrong = TRUE.replace("flip_y = false", "flip_y = true").replace("[0.001, 0.001, -0.001]", "[-0.001, 0.001, -0.001]")
    true, read = config.parse(TRUE, "rig"), config.parse(wrong, "rig")
    host = GuidedEngine(EmulatedEngine(true, read, tmp_path), read.text, TOUCHES | PRESSES, answers={})
    assert not follow(Commission(read, ["left"], 20.0).run(), host.respond), "friction and grasp are left out"
    found, wanted = config.parse(host.text, "found").finger["left"].pad, true.finger["left"].pad
    assert found is not None
    assert wanted is not None
    assert (found.axis_scale, found.swap_xy, found.flip_x, found.flip_y) == (
        wanted.axis_scale,
        wanted.swap_xy,
        wanted.flip_x,
        wanted.flip_y,
    )
    assert "  no finger has a force sensor, so none has a weight to subtract" in host.printed
