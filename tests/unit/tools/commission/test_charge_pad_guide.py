"""The whole first step on a charge pad, whose image shows only once the force sensor is right."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from charge_rig import charge_rig
from emulated_engine import EmulatedEngine
from guided_engine import GuidedEngine

from slipd import config
from slipd.tools.commission import gripper_steps
from slipd.tools.commission.commission_guide import Commission
from slipd.tools.commission.dialogue import Ask, Event, Output, Refusal, follow
from slipd.tools.sim import touched_devices

TRUE = charge_rig(left={})
WRONG = charge_rig(left={"sign": -1, "flip_y": "true"})


@pytest.fixture(autouse=True)
def tared(monkeypatch: pytest.MonkeyPatch) -> None:
    """The force sensor has its zero: a charge pad shows nothing before its finger was seen free."""
    monkeypatch.setattr(touched_devices, "BIAS", np.zeros(6))
    monkeypatch.setattr(gripper_steps, "PAUSE_S", 1.0)


def guided(folder: Path, *, write: bool) -> GuidedEngine:
    engine = EmulatedEngine(TRUE, WRONG, folder)
    return GuidedEngine(engine, WRONG.text, answers={"touch_again": ("", "again")}, write=write)


def test_without_a_zero_the_presses_are_asked_for_again_once_the_daemon_shows_the_image(tmp_path: Path) -> None:
    host = guided(tmp_path, write=True)

    def respond(output: Output) -> Event:
        tare = isinstance(output, Ask) and output.method == "tare"
        return Refusal("it is pulled at") if tare and host.text == WRONG.text else host.respond(output)

    follow(Commission(WRONG, ["left"], 20.0).run(), respond)
    left = config.parse(host.text, "found").finger["left"]
    assert (left.wrench.sign, left.pad.flip_y) == (1, False)
    (again,) = [number for number, line in enumerate(host.printed) if "presses are needed once more" in line]
    touches = [line for line in host.printed[again:] if line.startswith("Press")]
    assert [line for line in touches if "push" in line] == []
    assert len(touches) >= 3
