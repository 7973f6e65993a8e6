"""Takes the zero of the sensors of a finger; a refusal is tried again, and left out in the end."""

from __future__ import annotations

from slipd.config import Finger
from slipd.tools.commission.dialogue import Refusal, Say, Steps, ask
from slipd.tools.commission.readings import pause

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
        answer = yield ask("tare", finger=finger, seconds=TARE_S, stream=stream, unloaded=True)
        if not isinstance(answer, Refusal):
            return True
        yield Say(f"  not taken: {answer.reason}")
        if attempt < ATTEMPTS - 1:
            yield Say("  it is tried again")
            yield from pause(PAUSE_S)
    yield Say(
        f"  the zero is left out, and the readings count from the present one. Later: slipctl tare take {finger} "
        f"--stream {stream}; slipctl status says what is wrong"
    )
    return False
