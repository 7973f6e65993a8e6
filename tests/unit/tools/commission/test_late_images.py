"""Images that are missing for a while after a question, as on a busy machine, are waited for."""

from __future__ import annotations

from pathlib import Path

from commission_person import TOUCHES
from commission_rig import FINGERS, PRESSES, commission_rig
from emulated_engine import EmulatedEngine
from guided_engine import GuidedEngine

from slipd.tools.commission.dialogue import Event, Output, Prompt, follow
from slipd.tools.commission.gripper_steps import take_zero
from slipd.tools.commission.readings import ReadingListener
from slipd.tools.commission.touch_guide import TouchGuide
from slipd_client.messages.schema.topics import Tactile

LOST = 50
"""Images after each question: a second of them."""


class LostImages(GuidedEngine):
    _left = 0

    def respond(self, output: Output) -> Event:
        if isinstance(output, Prompt):
            self._left = LOST
        event = super().respond(output)
        while self._left and isinstance(event, Tactile):
            self._left -= 1
            event = super().respond(None)
        return event


def test_a_touch_without_images_is_held_until_they_are_back(tmp_path: Path) -> None:
    read = commission_rig()
    host = LostImages(EmulatedEngine(read, read, tmp_path), read.text, TOUCHES | PRESSES)
    assert follow(take_zero("left", read.finger["left"]), host.respond)
    guide = TouchGuide(read, ReadingListener(FINGERS, read.config_id), 20.0)
    assert follow(guide.run("left"), host.respond).findings.problems == []
    assert any("hold it still" in line for line in host.printed)
