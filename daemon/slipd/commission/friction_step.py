"""Step 3 of the guide: the friction between pads and an object, from a few pulls at a gripped sample."""

from __future__ import annotations

from collections.abc import Sequence

from slipd.commission.dialogue import SKIP, Choice, Prompt, Say, Skipped, Steps, choose
from slipd.commission.grip_step import CLOSE, IF_CLOSED, activate, close, release
from slipd.commission.readings import silence
from slipd_client.errors import FrictionNotMeasured
from slipd_client.friction_guide import result_lines
from slipd_client.friction_pull import PullSample
from slipd_client.friction_session import FrictionSession
from slipd_client.messages.schema.topics import Message, Slip

SAMPLES = 3
GRIPPED = "gripped already"
NOT_PRESSED = "Nothing presses on the pads yet."


def measure_friction(
    fingers: Sequence[str], force_n: float | None, patience_s: float
) -> Steps[dict[str, list[PullSample]]]:
    """Lead through the pulls; return the samples of each finger that has enough.

    Args:
        fingers: Names of the fingers.
        force_n: Force on one pad with which the gripper closes, N; None if it must not be moved.
        patience_s: How long to wait for a grip, and for each pull, s.

    Raises:
        Skipped: The person left the step out.
        SlipdError: The daemon fell silent.
    """
    closed = yield from _grip(force_n)
    if closed is None:
        return {}
    try:
        results = yield from _pulls(fingers, patience_s)
    except Skipped:
        if closed:
            yield from release()
        raise
    for finger, group in results.items():
        yield Say("\n".join(["", *result_lines(finger, group)]))
    if closed:
        yield from release()
    return results


def _grip(force_n: float | None) -> Steps[bool | None]:
    """Have the sample gripped; return whether the gripper was closed for it, or None if it refused."""
    text = f"Hold a sample of the object's material between the pads. {IF_CLOSED}"
    if force_n is None or not (yield from activate()):
        yield from choose(Prompt("sample", f"{text} Grip it.", choices=(GRIPPED, SKIP)))
        return False
    text += f" Then the gripper closes with {force_n:g} N on each pad: keep your fingers out."
    word = yield from choose(Prompt("sample", text, choices=(CLOSE, GRIPPED, SKIP)))
    if word != CLOSE:
        return False
    return True if (yield from close(force_n)) else None


def _pulls(fingers: Sequence[str], patience_s: float) -> Steps[dict[str, list[PullSample]]]:
    lines: list[str] = []
    session = FrictionSession(fingers, SAMPLES, patience_s, lines.append, NOT_PRESSED)
    try:
        while not session.done:
            event = yield None
            if event is None:
                raise silence()
            if isinstance(event, Choice) and event.word == SKIP:
                raise Skipped
            if isinstance(event, Message):
                session.advance(event if isinstance(event, Slip) else None, event.t_ns * 1e-9)
            for line in lines:
                yield Say(line)
            lines.clear()
    except FrictionNotMeasured as error:
        for line in lines:
            yield Say(line)
        yield Say(f"  not measured: {error}")
    return session.results
