"""A person who follows the prompts of ``slipd commission`` on the pads of an emulated rig."""

from __future__ import annotations

import re
from collections.abc import Mapping

TOUCHES = {
    "Press the centre": "press {finger} 6 N at 0 0 mm",
    "Press the middle": "press {finger} 6 N at 16 0 mm",
    "Press the corner": "press {finger} 6 N at 16 7 mm",
    "push along +X": "press {finger} 6 N at 0 0 mm; push {finger} +x 2.5 N",
    "push along +Y": "press {finger} 6 N at 0 0 mm; push {finger} +y 2.5 N",
}
"""Words of a prompt and the touch that follows it."""


def touch_for(prompt: str, touches: Mapping[str, str] = TOUCHES) -> str | None:
    """Return the command of the emulation that follows a prompt; None if there is none.

    Args:
        prompt: A line of the guide.
        touches: As ``TOUCHES``; the last words that fit count.
    """
    if "Let go" in prompt:
        return "release"
    finger = re.search(r"the (\w+) pad", prompt)
    commands = [command for words, command in touches.items() if words in prompt]
    return commands[-1].format(finger=finger[1]) if finger is not None and commands else None
