"""Which keys of the config change for what was found of the fingers: sensors that change hands, and their noise."""

from __future__ import annotations

import numpy as np
import pytest
from commission_rig import TAXELS

from slipd.config import parse
from slipd.tools.commission.config_update import changes, fragment
from slipd.tools.commission.readings import FingerReadings, noise_at_rest
from slipd.tools.commission.touches import Findings, Mount, Noise
from slipd.tools.shipped_files import shipped_config

MOUNT = Mount(1, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
FORCE_STD_N, TORQUE_STD_NM, TAXEL_STD = 0.03, 0.0008, 2.0


def rest(images: int, rng: np.random.Generator, drift_n: float = 0.2, offset: float = 0.0) -> FingerReadings:
    """Readings that drift slowly, and the positive part of noisy images, whose zero may be off."""
    stds = [FORCE_STD_N] * 3 + [TORQUE_STD_NM] * 3
    wrenches = [rng.normal(0.0, stds) + np.array((0, 0, drift_n * k / 400, 0, 0, 0)) for k in range(400)]
    return FingerReadings(wrenches, [np.clip(rng.normal(offset, TAXEL_STD, 64), 0.0, None) for _ in range(images)])


@pytest.mark.parametrize(("offset", "most"), [(0.0, 1.0), (500.0, 1.7)])
def test_noise_is_that_of_the_sensors_without_their_drift_and_offset(offset: float, most: float) -> None:
    noise = noise_at_rest(rest(200, np.random.default_rng(1), offset=offset), MOUNT, MOUNT)
    assert noise.force_std_n == pytest.approx(FORCE_STD_N, rel=0.1)
    assert noise.torque_std_nm == pytest.approx(TORQUE_STD_NM, rel=0.1)
    assert noise.threshold == pytest.approx(10.0 * most * TAXEL_STD, rel=0.25)


@pytest.mark.parametrize(("stated", "written"), [("threshold = 0.0", True), ("threshold = 1.0", False)])
def test_a_threshold_is_found_only_where_none_hides_the_noise(stated: str, written: bool) -> None:
    text = shipped_config("gauges_pvdf.toml").read_text(encoding="utf-8").replace("MEASURE", "")
    rig = parse(text.replace("threshold = 0.005", stated), "rig")
    found = changes(rig, {"left": Findings(noise=Noise(0.01, 0.0001, 20.0))})
    assert found == ({("finger", "left", "pad", "threshold"): "20.0"} if written else {})


TWO = parse(
    "".join(TAXELS.format(name=name, number=k, flip_y="false") for k, name in enumerate(("left", "right"), 1)), "rig"
)


def result(other: str, axes: tuple[int, int, int] = (1, 1, -1)) -> Findings:
    """What was found of a finger whose sensors are in the tables of the other one."""
    return Findings(axes=axes, streams={"pad": other, "wrench": other})


def test_sensors_of_fingers_that_are_swapped_change_hands_once() -> None:
    both = changes(TWO, {"left": result("right"), "right": result("left")})
    assert fragment(both) == '[finger.left.pad]\nsensor = "2"\n[finger.right.pad]\nsensor = "1"'
    assert changes(TWO, {"left": result("right")}) == both, "the other finger follows"
