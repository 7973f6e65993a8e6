"""Images that lag behind the force, as on a busy machine, are not taken for those of the touch."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from pathlib import Path

import numpy as np
from commission_person import TOUCHES
from commission_rig import FINGERS, PRESSES, commission_rig
from emulated_engine import EmulatedEngine
from guided_engine import GuidedEngine

from slipd import config
from slipd.tools.commission.dialogue import Event, Output, Prompt, Say, follow
from slipd.tools.commission.gripper_steps import take_zero
from slipd.tools.commission.readings import ReadingListener
from slipd.tools.commission.touch_guide import FingerOutcome, TouchGuide
from slipd.types.arrays import Array
from slipd_client.messages.schema.topics import Tactile

LAG = 25
"""Images by which they are late: half a second."""


class LateImages(GuidedEngine):
    """Delivers old images with the time of the present, or none for a while after each question."""

    lags = lost = keeps = False
    _asked = 0
    _kept = np.zeros(1)
    _late: deque[Tactile]
    _newest: Array

    def respond(self, output: Output) -> Event:
        if isinstance(output, Prompt):
            self._asked = 2 * LAG
        if isinstance(output, Say) and "Let go" in output.text and self.keeps:
            self._kept = 0.4 * self._newest
        event = super().respond(output)
        while self.lost and self._asked and isinstance(event, Tactile):
            self._asked -= 1
            event = super().respond(None)
        if isinstance(event, Tactile) and event.finger == "left" and event.loads_n is not None:
            self._newest = np.array(event.loads_n)
            event = replace(event, loads_n=tuple(self._newest + self._kept))
        if not self.lags or not isinstance(event, Tactile):
            return event
        self._late.append(event)
        old = self._late.popleft() if len(self._late) > LAG else self._late[0]
        return replace(event, loads_n=old.loads_n)


def found(folder: Path, **disturbance: bool) -> tuple[FingerOutcome, list[str]]:
    """Return what the touches show, and the lines that say what disturbs."""
    read = config.parse(commission_rig().text, "rig")
    host = LateImages(EmulatedEngine(read, read, folder), read.text, TOUCHES | PRESSES)
    host._late = deque()
    assert follow(take_zero("left", read.finger["left"]), host.respond)
    for name, on in disturbance.items():
        setattr(host, name, on)
    guide = TouchGuide(read, ReadingListener(FINGERS, read.config_id), 20.0)
    outcome = follow(guide.run("left"), host.respond)
    return outcome, [line for line in host.printed if "hold it still" in line]


def test_a_touch_without_images_is_held_until_they_are_back(tmp_path: Path) -> None:
    outcome, waits = found(tmp_path, lost=True)
    assert outcome.findings.problems == []
    assert waits
