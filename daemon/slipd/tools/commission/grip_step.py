"""Motions of the gripper in the last two steps: it closes gently and opens again, each time after the person agreed.

Every motion is one request with its own lease, so the daemon applies its rules and limits to it. However the guide
ends, the gripper keeps its force.
"""

from __future__ import annotations

from typing import Any

from slipd.config import Gripper
from slipd.tools.commission.dialogue import AGAIN, SKIP, Prompt, Refusal, Say, Skipped, Steps, ask, choose
from slipd.tools.commission.readings import pause, read_status

GENTLE_N = 5.0
"""Force on one pad with which the guide grips, N, unless the gripper's least force is larger."""

MOST_TRIES = 20
"""How often a motion is asked for again before the step is left out."""

ACTIVE_S = 15.0
POLL_S = 0.5

IF_CLOSED = "If the pads are closed, open them first: slipctl grip open --drop."

CLOSE, OPEN, KEEP, ACTIVATE = "close", "open", "keep", "activate"
TRY = (AGAIN, SKIP)

LATCHED = "{fault} is latched: look at the gripper, then in another terminal: slipctl grip ack"


def gentle_force(gripper: Gripper | None) -> float | str:
    """Return the force with which the guide grips, N on one pad, or why it does not move the gripper."""
    if gripper is None:
        return "the config has no [gripper]"
    if gripper.max_force_n is None:
        return "[gripper] has no max_force_n, so nothing may be moved: state the largest force on one pad there"
    least = gripper.force_table[0][1] if gripper.force_table else 0.0
    force_n = max(GENTLE_N, least, gripper.min_force_n or 0.0)
    return float(min(force_n, gripper.max_force_n))


def activate() -> Steps[bool]:
    """Activate the gripper if it is not active, after the person agreed; return whether it is.

    The person confirms that nothing is gripped: a finger whose weight is not compensated may look pressed.

    Raises:
        Skipped: The person left the step out.
        SlipdError: The daemon fell silent.
    """
    if (yield from _is_active()):
        return True
    text = "The gripper is not active. To become active it may open and close fully: take everything out of it."
    yield from choose(Prompt("activate", text, choices=(ACTIVATE, SKIP)))
    text = "The gripper may open and close fully as soon as it can: keep your fingers out."
    yield from _insist(Prompt("activate_again", text, choices=TRY), "activated", "gripper_activate", drop=True)
    for _ in range(int(ACTIVE_S / POLL_S)):
        yield from pause(POLL_S)
        if (yield from _is_active()):
            return True
    yield Say(f"  not active after {ACTIVE_S:g} s; slipctl status says why")
    return False


def close(force_n: float) -> Steps[None]:
    """Close the gripper, which the person has agreed to.

    Raises:
        Skipped: The daemon refused, and the person left the step out.
    """
    text = f"The gripper closes with {force_n:g} N on each pad as soon as it can: keep your fingers out."
    yield from _insist(Prompt("close_again", text, choices=TRY), "closed", "gripper_close", force_n=force_n)
    yield Say(f"  closing with {force_n:g} N on each pad")


def release() -> Steps[None]:
    """Open the gripper once the person holds the object, or keep the grip.

    Raises:
        Skipped: The person left it out; the grip stays.
    """
    text = "Hold the object with your hand. Then the gripper opens."
    while (yield from choose(Prompt("release", text, choices=(OPEN, KEEP)))) == OPEN:
        if not (why := (yield from _send("gripper_open", drop=True))):
            return
        yield Say(f"  not opened: {why}")
    yield Say("  the gripper keeps its grip; later: slipctl grip open --drop")


def _insist(again: Prompt, done: str, method: str, **fields: Any) -> Steps[None]:
    """Send a request that moves the gripper, and again while it fails and the person agrees.

    Raises:
        Skipped: The person left it out, or it failed MOST_TRIES times.
    """
    for _ in range(MOST_TRIES):
        if not (why := (yield from _send(method, **fields))):
            return
        yield Say(f"  not {done}: {why}")
        yield from choose(again)
    yield Say(f"  given up after {MOST_TRIES} tries")
    raise Skipped


def _send(method: str, **fields: Any) -> Steps[str]:
    """Send a request that moves the gripper; return why it was not carried out, or ""."""
    answer = yield ask(method, lease=True, **fields)
    if isinstance(answer, Refusal):
        return answer.reason
    yield from pause(POLL_S)
    gripper = (yield from read_status()).gripper
    fault = "" if gripper is None else gripper.latched_fault
    return LATCHED.format(fault=fault) if fault else ""


def _is_active() -> Steps[bool]:
    gripper = (yield from read_status()).gripper
    return gripper is not None and gripper.active is True
