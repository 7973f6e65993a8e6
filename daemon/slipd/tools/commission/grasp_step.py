"""Step 4 of the guide: the first grasp. The gripper closes gently, holds, shows the levels, and opens."""

from __future__ import annotations

from collections.abc import Sequence

from slipd.tools.commission.dialogue import SKIP, Choice, Prompt, Say, Skipped, Steps, choose
from slipd.tools.commission.grip_step import CLOSE, IF_CLOSED, activate, close, release
from slipd.tools.commission.readings import silence
from slipd_client.friction_session import ElapsedTime
from slipd_client.messages.names import SlipLevel
from slipd_client.messages.schema.topics import Message, Slip

SHOW_S = 1.0
HOLD_S = 5.0
SETTLE_S = 15.0
"""Extra time after HOLD_S for a finger that has no verdict just then, because a reading is stale."""

HOLDING = (SlipLevel.STABLE, SlipLevel.CAUTION)


def first_grasp(fingers: Sequence[str], force_n: float, patience_s: float) -> Steps[bool]:
    """Grip, show, release; return whether every finger held with a verdict.

    Args:
        fingers: Names of the fingers.
        force_n: Force on one pad, N.
        patience_s: How long to wait for the contact, s.

    Raises:
        Skipped: The person left the step out.
        SlipdError: The daemon fell silent.
    """
    if not (yield from activate()):
        return False
    text = (
        f"Put an object between the pads. {IF_CLOSED} Then keep your hands away: the gripper closes with {force_n:g} N "
        "on each pad."
    )
    yield from choose(Prompt("grasp", text, choices=(CLOSE, SKIP)))
    yield from close(force_n)
    try:
        last = yield from _watch(fingers, patience_s)
    except Skipped:
        yield from release()
        raise
    for name, verdict in last.items():
        if verdict.level not in HOLDING:
            why = ", ".join(verdict.reasons) or "see slipctl status"
            yield Say(f"  {name} is {verdict.level}: {why}; docs/health.md lists what to do")
    yield from release()
    return len(last) == len(fingers) and all(verdict.level in HOLDING for verdict in last.values())


def _watch(fingers: Sequence[str], patience_s: float) -> Steps[dict[str, Slip]]:
    """Show each finger once a second until all were pressed for some seconds; return the last verdicts."""
    newest: dict[str, Slip] = {}
    elapsed = ElapsedTime()
    held_s = shown_s = None
    while (event := (yield None)) is not None:
        if isinstance(event, Choice) and event.word == SKIP:
            raise Skipped
        if not isinstance(event, Message):
            continue
        now_s = elapsed.update(event.t_ns * 1e-9)
        if isinstance(event, Slip) and event.finger in fingers:
            newest[event.finger] = event
        if len(newest) == len(fingers):
            if shown_s is None or now_s - shown_s >= SHOW_S:
                shown_s = now_s
                yield Say("  " + "; ".join(_line(name, newest[name]) for name in fingers))
            levels = {verdict.level for verdict in newest.values()}
            begun_s = now_s if held_s is None else held_s
            held_s = None if SlipLevel.NO_CONTACT in levels else begun_s
            enough_s = HOLD_S if levels.issubset(HOLDING) else HOLD_S + SETTLE_S
            if held_s is not None and now_s - held_s >= enough_s:
                return newest
        if now_s > patience_s:
            return newest
    raise silence()


def _line(name: str, verdict: Slip) -> str:
    normal = "" if verdict.normal_n is None else f" {verdict.normal_n:.1f} N"
    used = "" if verdict.utilisation is None else f" λ {verdict.utilisation:.2f}"
    why = f" ({', '.join(verdict.reasons)})" if verdict.level == SlipLevel.UNKNOWN else ""
    return f"{name} {verdict.level}{why}{normal}{used}"
