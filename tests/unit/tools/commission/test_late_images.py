"""Images that lag behind the force, as on a busy machine, are not taken for those of the touch."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from pathlib import Path

from commission_person import TOUCHES
from commission_rig import FINGERS, PRESSES, commission_rig
from emulated_engine import EmulatedEngine
from guided_engine import GuidedEngine

from slipd import config
from slipd.tools.commission.dialogue import Event, Output, Prompt, follow
from slipd.tools.commission.readings import ReadingListener
from slipd.tools.commission.touch_guide import TouchGuide
from slipd.tools.commission.zero_step import take_zero
from slipd_client.messages.schema.topics import Tactile

LAG = 25
"""Images by which they are late: half a second."""


class LateImages(GuidedEngine):
    """Delivers old images with the time of the present, or none for a while after each question."""

    lags = lost = False
    _asked = 0
    _late: deque[Tactile]

    def respond(self, output: Output) -> Event:
        if isinstance(output, Prompt):
            self._asked = 2 * LAG
        event = super().respond(output)
        while self.lost and self._asked and isinstance(event, Tactile):
            self._asked -= 1
            event = super().respond(None)
        if not self.lags or not isinstance(event, Tactile):
            return event
        self._late.append(event)
        old = self._late.popleft() if len(self._late) > LAG else self._late[0]
        return replace(event, loads_n=old.loads_n)


def found(folder: Path, *, lags: bool = False, lost: bool = False) -> tuple[list[str], list[str]]:
    """Return the problems of the touches, and the lines that say what disturbs."""
    read = config.parse(commission_rig().text, "rig")
    host = LateImages(EmulatedEngine(read, read, folder), read.text, TOUCHES | PRESSES)
    host._late = deque()
    assert follow(take_zero("left", read.finger["left"]), host.respond)
    host.lags, host.lost = lags, lost
    guide = TouchGuide(read, ReadingListener(FINGERS, read.config_id), 20.0)
    outcome = follow(guide.run("left"), host.respond)
    return outcome.findings.problems, [line for line in host.printed if "hold it still" in line]


def test_an_image_that_lags_behind_the_force_is_waited_for(tmp_path: Path) -> None:
    problems, waits = found(tmp_path, lags=True)
    assert problems == []
    assert waits
    assert set(waits) == {"  the image of finger left changed: hold it still"}


def test_a_touch_without_images_is_held_until_they_are_back(tmp_path: Path) -> None:
    problems, waits = found(tmp_path, lost=True)
    assert problems == []
    assert waits
