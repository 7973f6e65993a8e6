"""PapillArray before a load shows its layout: the finger is unknown, and status says what to do."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from slipd.devices.papillarray import papillarray_frames as frames
from slipd.devices.papillarray.papillarray_layout import NAMES, NEITHER, UNDECIDED
from slipd.events import Bytes
from slipd.sim.emulated_papillarray import LAYOUTS, Controller
from slipd_client.messages import Health

RIG = """
[finger.left]
mu = 0.6
min_normal_n = 0.3
load_rule = "grey"

[finger.left.pad]
device = "papillarray"
port = "/dev/pts-controller"
sensor = "0"
rate_hz = 500.0
rows = 3
cols = 3
pitch_m = 0.007
electrode_m = 0.005
axis_scale = [1.0, -1.0, -1.0]
threshold = 0.05

[rates]
status_hz = 10.0
"""

FREE = np.zeros((9, 3))

GRIPPED = np.tile((0.02, 0.0, 0.5), (9, 1))

Run = Any


class Pads:
    """A controller on the line of an engine."""

    def __init__(self, run: Run, controller: Controller) -> None:
        self.run, self.controller = run, controller
        self._begin_ns = run.t_ns

    def go_on(self, ms: int, forces_n: np.ndarray) -> None:
        self.controller.press(forces_n)
        for _ in range(ms):
            self.run.wait(1)
            for frame in self.controller.advance(self.run.t_ns - self._begin_ns):
                self.run.feed(Bytes("left.pad", frame))
            self.run.tick()

    @property
    def level(self) -> str:
        return str(self.run.published("status")[-1]["fingers"]["left"]["level"])

    @property
    def stream(self) -> tuple[Health, str]:
        stream = self.run.published("status")[-1]["streams"]["left.pad"]
        return Health(stream["health"]), stream["message"]


@pytest.fixture(params=LAYOUTS)
def layout(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def pads(layout: str, make_run: Callable[[str], Run]) -> Pads:
    run = make_run(RIG)
    run.up()
    return Pads(run, Controller(1, layout=layout))


def test_finger_is_unknown_until_a_load_shows_the_layout(pads: Pads, layout: str) -> None:
    pads.go_on(1500, FREE)
    assert pads.level == "unknown"
    assert pads.stream == (Health.STALE, UNDECIDED)
    assert pads.run.published("tactile.left") == []
    pads.go_on(200, GRIPPED)
    assert pads.level == "stable"
    assert pads.run.published("slip.left")[-1]["normal_n"] == pytest.approx(4.5, abs=0.1)
    assert f"pillars hold {NAMES[LAYOUTS[layout]]}" in pads.stream[1]
    pads.go_on(200, FREE)
    assert pads.level == "no_contact"


def test_finger_is_unknown_where_pillars_contradict_the_sum_of_the_sensor(
    pads: Pads, monkeypatch: pytest.MonkeyPatch
) -> None:
    encode = frames.encode_totals
    monkeypatch.setattr(frames, "encode_totals", lambda totals: encode([2.0 * total for total in totals]))
    pads.go_on(1500, GRIPPED)
    assert pads.level == "unknown"
    assert pads.stream == (Health.STALE, NEITHER)
