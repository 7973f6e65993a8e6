"""``slipctl friction``: guides a person through measuring the friction between pads and an object.

It reads what the daemon publishes and asks for its status, no more: nothing is set, and nothing moves.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Optional

from slipd_client.errors import FrictionNotMeasured, RequestRefused, Silence
from slipd_client.friction_pull import PullSample
from slipd_client.friction_samples import config_lines, median_of, spread
from slipd_client.friction_session import OBSTACLE_S, FrictionSession
from slipd_client.message_tracker import SILENCE_S
from slipd_client.messages import Health
from slipd_client.messages.schema.replies import StatusReply
from slipd_client.messages.schema.topics import Slip
from slipd_client.silence_hint import hint_for
from slipd_client.subscriber import Subscriber

LISTEN_S = 0.2


def check(ask_status: Callable[[], StatusReply], finger: Optional[str]) -> list[str]:
    """Return the fingers to measure, once their sensors have no fault.

    Args:
        ask_status: Returns the state of the daemon.
        finger: Name of one; None for all.

    Raises:
        FrictionNotMeasured: There is no such finger, or one of its sensors still has a fault after OBSTACLE_S.
        RequestRefused: The daemon still refuses after that time.
    """
    until_s = time.monotonic() + OBSTACLE_S
    while True:
        try:
            status = ask_status()
        except RequestRefused:  # the machine stalled, and the request came too late
            if time.monotonic() > until_s:
                raise
            time.sleep(LISTEN_S)
            continue
        if finger is not None and finger not in status.fingers:
            raise FrictionNotMeasured(f"finger must be one of {', '.join(status.fingers)}, got {finger!r:.40}")
        fingers = list(status.fingers) if finger is None else [finger]
        faults = [
            f"{name} is {stream.health.name}: {stream.message}"
            for name, stream in status.streams.items()
            if name.partition(".")[0] in fingers and stream.health >= Health.ERROR
        ]
        if not faults:
            return fingers
        if time.monotonic() > until_s:
            raise FrictionNotMeasured("; ".join(faults))
        time.sleep(LISTEN_S)


def session(fingers: Sequence[str], samples: int, patience_s: float) -> FrictionSession:
    """Return a session that prints its lines."""
    return FrictionSession(fingers, samples, patience_s, lambda text: print(text, flush=True))


def measure(guided: FrictionSession, subscriber: Subscriber) -> None:
    """Measure, and print the result: in the end, or of each finger with enough samples where it ends before.

    Raises:
        FrictionNotMeasured: Nothing touched, nothing slipped, or the samples do not agree.
        Silence: The daemon fell silent.
    """
    begin_s = time.monotonic()
    try:
        while not guided.done:
            message = subscriber.receive(LISTEN_S)
            if message is None and subscriber.stale and time.monotonic() - begin_s > SILENCE_S:
                where = subscriber.endpoint
                raise Silence(f"no message from {where} for {SILENCE_S:g} s. {hint_for(where)}")
            guided.advance(message if isinstance(message, Slip) else None, time.monotonic())
    finally:
        for finger, group in guided.results.items():
            print("\n".join(["", *result_lines(finger, group)]), flush=True)


def result_lines(finger: str, group: Sequence[PullSample]) -> list[str]:
    """Return what was measured of a finger, for people, with the lines for its config."""
    found = median_of(group)
    lines = [f"static friction {found.mu_s:.3f} ± {spread(group):.1%}"]
    if found.mu_d is not None:
        lines.append(f"dynamic friction {found.mu_d:.3f}")
    return [f"{finger}: {', '.join(lines)}. For the config:", "", *config_lines(finger, group)]
