"""What moves or tares in the last steps: zeros, gentle closing and opening, and the first grasp.

Every motion is one request with its own lease, after the person agreed, so the daemon applies its rules and limits to
it. However the guide ends, the gripper keeps its force.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

from slipd.config import Finger, Gripper
from slipd.fusion.assess import SPIN_ARM_M
from slipd.tools.commission.dialogue import AGAIN, SKIP, Ask, Prompt, Refusal, Say, Skipped, Steps, choose
from slipd.tools.commission.readings import next_message, pause, read_status
from slipd_client.friction_session import ElapsedTime
from slipd_client.messages.names import SlipLevel
from slipd_client.messages.topics import Slip

TARE_S = 0.5
ATTEMPTS = 3
PAUSE_S = 2.0
"""Time for the person to let go, or for a sensor to settle, s."""

NAMES = {"wrench": "force sensor", "pad": "pad"}


def take_zero(finger: str, settings: Finger) -> Steps[bool]:
    """Take the zero of the force sensor and of the pad of a finger; return whether all were taken.

    The pad comes first, because one that was never tared may read a load, and so a contact. A charge pad is left out:
    it measures changes, and the daemon finds its zero whenever the finger is free.

    Raises:
        Skipped: The person chose it.
        SlipdError: The daemon fell silent.
    """
    streams = ["pad"] if settings.pad is not None and settings.pad.charge_tau_s is None else []
    streams += [] if settings.wrench is None else ["wrench"]
    taken = True
    for stream in streams:
        taken = (yield from _take(finger, stream)) and taken
    return taken


def _take(finger: str, stream: str) -> Steps[bool]:
    yield Say(f"Touch nothing: the zero of the {NAMES[stream]} of finger {finger} is taken.")
    for attempt in range(ATTEMPTS):
        answer = yield Ask("tare", {"finger": finger, "seconds": TARE_S, "stream": stream, "unloaded": True})
        if not isinstance(answer, Refusal):
            return True
        yield Say(f"  not taken: {answer.reason}")
        if attempt < ATTEMPTS - 1:
            yield Say("  it is tried again")
            yield from pause(PAUSE_S)
    yield Say(
        f"  the zero is left out, and the readings count from the present one. Later: slipctl tare take {finger} "
        f"{stream}; slipctl status says what is wrong"
    )
    return False


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


def gentle_force(gripper: Gripper | None, least_n: float = GENTLE_N) -> float | str:
    """Return the force with which the guide grips, N on one pad, or why it does not move the gripper.

    Args:
        gripper: Config of the gripper; None without one.
        least_n: Force that the step needs, N.
    """
    if gripper is None:
        return "the config has no [gripper]"
    if gripper.max_force_n is None:
        return "[gripper] has no max_force_n, so nothing may be moved: state the largest force on one pad there"
    least = gripper.force_table[0][1] if gripper.force_table else 0.0
    force_n = max(GENTLE_N, least_n, least, gripper.min_force_n or 0.0)
    return float(min(force_n, gripper.max_force_n))


NOISE_RATIO = 0.014
"""Largest noise of the required friction with which slipd still sees a load fall from static to dynamic friction by a
quarter, at the 100 readings per second of the slowest force sensors (`slipd.fusion.load_drop`)."""


def pulling_force(fingers: Iterable[Finger]) -> float:
    """Return the least force on one pad at which slipd sees a pulled object slip, N; noise hides it below.

    Args:
        fingers: Config of the fingers, with the noise of their force sensors.
    """
    noises_n = [
        math.hypot(sensor.force_std_n * math.sqrt(2.0), sensor.torque_std_nm / SPIN_ARM_M)
        for finger in fingers
        if (sensor := finger.wrench) is not None
    ]
    return math.ceil(max(noises_n, default=0.0) / NOISE_RATIO)


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
    answer = yield Ask(method, fields, lease=True)
    if isinstance(answer, Refusal):
        return answer.reason
    yield from pause(POLL_S)
    gripper = (yield from read_status()).gripper
    fault = "" if gripper is None else gripper.latched_fault
    return LATCHED.format(fault=fault) if fault else ""


def _is_active() -> Steps[bool]:
    gripper = (yield from read_status()).gripper
    return gripper is not None and gripper.active is True


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
    while True:
        message = yield from next_message()
        now_s = elapsed.update(message.t_ns * 1e-9)
        if isinstance(message, Slip) and message.finger in fingers:
            newest[message.finger] = message
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


def _line(name: str, verdict: Slip) -> str:
    normal = "" if verdict.normal_n is None else f" {verdict.normal_n:.1f} N"
    used = "" if verdict.utilisation is None else f" λ {verdict.utilisation:.2f}"
    why = f" ({', '.join(verdict.reasons)})" if verdict.level == SlipLevel.UNKNOWN else ""
    return f"{name} {verdict.level}{why}{normal}{used}"
