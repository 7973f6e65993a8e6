"""``slipctl friction measure``: guides a person through measuring the friction between pads and an object.

It reads what the daemon publishes and asks for its status, no more: nothing is set, and nothing moves.
"""

from __future__ import annotations

import argparse
import functools
import json
import sys
import time
from collections.abc import Callable, Sequence
from typing import Optional

from slipd_client.errors import ClientError, FrictionNotMeasured, RequestRefused
from slipd_client.friction_pull import PullSample
from slipd_client.friction_session import OBSTACLE_S, FrictionSession, config_lines, low_estimate, median_of, spread
from slipd_client.grip import GripClient
from slipd_client.keys import Keys
from slipd_client.messages import Health, slip_topic
from slipd_client.messages.replies import StatusReply
from slipd_client.messages.topics import Slip
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
            obstacle: ClientError = FrictionNotMeasured("; ".join(faults))
        except RequestRefused as refusal:  # the machine stalled, and the request came too late
            obstacle = refusal
        if time.monotonic() > until_s:
            raise obstacle
        time.sleep(LISTEN_S)


def run(chosen: argparse.Namespace, keys: Keys | None) -> None:
    """Carry out the command; as JSON, the result is one document, and what to do is printed on standard error.

    Raises:
        FrictionNotMeasured: See `check` and `measure`.
        Silence: The daemon fell silent.
    """
    say = functools.partial(print, file=sys.stderr if chosen.json else sys.stdout, flush=True)
    with GripClient(chosen.requests, keys=keys) as client:
        fingers = check(client.status, chosen.finger)
    guided = FrictionSession(fingers, chosen.samples, chosen.patience, say)
    with Subscriber(chosen.publish, [slip_topic(finger) for finger in fingers], keys=keys) as subscriber:
        try:
            measure(guided, subscriber)
        finally:
            if chosen.json:
                print(json.dumps({finger: result_map(group) for finger, group in guided.results.items()}), flush=True)
            else:
                for finger, group in guided.results.items():
                    print("\n".join(["", *result_lines(finger, group)]), flush=True)


def measure(guided: FrictionSession, subscriber: Subscriber) -> None:
    """Pass on the verdicts until enough samples of every finger agree.

    Raises:
        FrictionNotMeasured: Nothing touched, nothing slipped, or the samples do not agree.
        Silence: The daemon fell silent.
    """
    while not guided.done:
        message = subscriber.receive(LISTEN_S)
        if message is None:
            subscriber.check_silence()
        guided.advance(message if isinstance(message, Slip) else None, time.monotonic())


def result_map(group: Sequence[PullSample]) -> dict[str, float | None]:
    """Return what was measured of a finger, for programs; ``mu`` and ``mu_spread`` are what the config wants."""
    found = median_of(group)
    return {
        "mu": low_estimate(group),
        "mu_spread": spread(group),
        "mu_s": found.mu_s,
        "mu_d": found.mu_d,
        "normal_n": found.normal_n,
    }


def result_lines(finger: str, group: Sequence[PullSample]) -> list[str]:
    """Return what was measured of a finger, for people, with the lines for its config."""
    found = median_of(group)
    lines = [f"static friction {found.mu_s:.3f} ± {spread(group):.1%}"]
    if found.mu_d is not None:
        lines.append(f"dynamic friction {found.mu_d:.3f}")
    return [f"{finger}: {', '.join(lines)}. For the config:", "", *config_lines(finger, group)]
