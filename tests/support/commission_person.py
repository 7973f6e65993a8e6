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


ANSWERS = {
    "tips_down": ("tilt 1 0 0", "ready"),
    "pad_up": ("tilt 0 0 -1", "ready"),
    "pad_down": ("tilt 0 0 1", "ready"),
    "side_down": ("tilt 0 1 0", "ready"),
    "activate": ("object 0 mm", "activate"),
    "sample": ("object 40 mm", "close"),
    "grasp": ("object 40 mm", "close"),
    "release": ("pull +x 0 N", "open"),
}
"""Step of a prompt, what the person does with a rig of one finger, and what the person then chooses."""

POSES_OF_TWO = {
    "tips_down": ("tilt 1 0 0", "ready"),
    "pad_up": ("tilt left 0 0 -1; tilt right 0 0 1", "ready"),
    "pad_down": ("tilt left 0 0 1; tilt right 0 0 -1", "ready"),
    "side_down": ("tilt left 0 1 0; tilt right 0 -1 0", "ready"),
}
"""The same poses with a rig of two."""

PULLS = {"Pull slowly": "pull +x 60 N in 3 s", "Let go of it": "pull +x 0 N"}
"""Beginning of a line, and what the person does."""


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
