"""Step 3 of the guide: the friction between pads and an object, from a few pulls at a gripped sample."""

from __future__ import annotations

from collections.abc import Sequence

from slipd.tools.commission.dialogue import AGAIN, SKIP, Prompt, Say, Skipped, Steps, choose
from slipd.tools.commission.gripper_steps import CLOSE, IF_CLOSED, activate, close, release
from slipd.tools.commission.readings import next_message
from slipd_client.errors import FrictionNotMeasured
from slipd_client.friction_guide import result_lines
from slipd_client.friction_pull import PullSample
from slipd_client.friction_session import FrictionSession
from slipd_client.messages.topics import Slip

SAMPLES = 3
MOST_TRIES = 10
"""How often in a row nothing may be measured before the step is left out."""

GRIPPED = "gripped already"
NOT_PRESSED = "Nothing presses on the pads yet."
ON = "Let go of the sample, and see to the cause. What was measured so far counts."


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
    try:
        results = yield from _pulls(fingers, patience_s, force_n if closed else None)
    except Skipped:
        if closed:
            yield from release()
        raise
    yield from (Say("\n".join(["", *result_lines(finger, group)])) for finger, group in results.items())
    if closed:
        yield from release()
    return results


def _grip(force_n: float | None) -> Steps[bool]:
    """Have the sample gripped; return whether the gripper was closed for it."""
    text = f"Hold a sample of the object's material between the pads. {IF_CLOSED}"
    if force_n is None or not (yield from activate()):
        yield from choose(Prompt("sample", f"{text} Grip it.", choices=(GRIPPED, SKIP)))
        return False
    text += f" Then the gripper closes with {force_n:g} N on each pad: keep your fingers out."
    word = yield from choose(Prompt("sample", text, choices=(CLOSE, GRIPPED, SKIP)))
    if word != CLOSE:
        return False
    yield from close(force_n)
    return True


def _pulls(fingers: Sequence[str], patience_s: float, force_n: float | None) -> Steps[dict[str, list[PullSample]]]:
    """Lead through the pulls; where nothing more is measured, the person sees to the cause and goes on."""
    choices = (AGAIN, SKIP) if force_n is None else (AGAIN, CLOSE, SKIP)
    text = (
        ON if force_n is None else f"{ON} To grip it again with {force_n:g} N, keep your fingers out and choose close."
    )
    lines: list[str] = []
    session = FrictionSession(fingers, SAMPLES, patience_s, lines.append, NOT_PRESSED)
    tries = 0
    while not session.done:
        before = session.counted
        try:
            yield from _follow(session, lines)
        except FrictionNotMeasured as error:
            yield from _show(lines)
            yield Say(f"  not measured: {error}")
            tries = tries + 1 if session.counted == before else 1
            try:
                yield from _check_tries(tries)
                word = yield from choose(Prompt("friction_again", text, choices=choices))
                if force_n is not None and word == CLOSE and (yield from activate()):
                    yield from close(force_n)
            except Skipped:
                if not session.results:
                    raise
                break
            session.resume()
    return session.results


def _check_tries(tries: int) -> Steps[None]:
    """Leave the step out after too many tries without a sample."""
    if tries >= MOST_TRIES:
        yield Say(f"  given up: {tries} times in a row nothing was measured")
        raise Skipped


def _follow(session: FrictionSession, lines: list[str]) -> Steps[None]:
    """Pass on verdicts until the session is done, and show its lines.

    Raises:
        FrictionNotMeasured: Nothing touched, nothing slipped, or the samples do not agree.
        Skipped: The person left the step out.
        SlipdError: The daemon fell silent.
    """
    while not session.done:
        message = yield from next_message()
        session.advance(message if isinstance(message, Slip) else None, message.t_ns * 1e-9)
        yield from _show(lines)


def _show(lines: list[str]) -> Steps[None]:
    """Show what the session said: what to do now, and indented what was measured."""
    for line in lines:
        yield Say(line) if line.startswith(" ") else Prompt("pull", line)
    lines.clear()
