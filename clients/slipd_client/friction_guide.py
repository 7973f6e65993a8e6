"""``slipctl friction``: guides a person through measuring the friction between pads and an object.

It reads what the daemon publishes and asks for its status, no more: nothing is set, and nothing moves.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from slipd_client.errors import FrictionNotMeasured, RequestRefused, Silence, hint_for
from slipd_client.friction_pull import NO_CONTACT, PullRejected, PullSample, PullWatch
from slipd_client.friction_samples import agreeing, config_lines, disagreement, median_of, spread
from slipd_client.message_tracker import SILENCE_S
from slipd_client.messages import Health, slip_topic
from slipd_client.messages.schema.replies import StatusReply
from slipd_client.messages.schema.topics import Slip
from slipd_client.subscriber import Subscriber

OBSTACLE_S = 3.0
"""An obstacle that lasts so long is not going to vanish by itself."""

MOST_PULLS = 4
"""Pulls for each sample that is wanted: beyond it the samples do not agree, and something else is wrong."""

LISTEN_S = 0.2


def check(ask_status: Callable[[], StatusReply], finger: str | None) -> list[str]:
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


class FrictionGuide:
    """Asks for pulls until enough of them agree, and prints what they show.

    Args:
        fingers: Names of the fingers to measure.
        samples: Samples that must agree.
        patience_s: How long to wait for a grip, and for each pull, s.
    """

    def __init__(self, fingers: Sequence[str], samples: int, patience_s: float) -> None:
        self._wanted = samples
        self._patience_s = patience_s
        self._watches = {finger: PullWatch() for finger in fingers}
        self._samples: dict[str, list[PullSample]] = {finger: [] for finger in fingers}
        self._asked = ""
        self._since_s = self._clear_s = time.monotonic()

    @property
    def topics(self) -> list[str]:
        """Topics to subscribe to."""
        return [slip_topic(finger) for finger in self._watches]

    def run(self, subscriber: Subscriber) -> None:
        """Measure, and print the result: in the end, or of each finger with enough samples where it ends before.

        Raises:
            FrictionNotMeasured: Nothing touched, nothing slipped, or the samples do not agree.
            Silence: The daemon fell silent.
        """
        try:
            self._follow(subscriber)
        finally:
            self._print_results()

    def _follow(self, subscriber: Subscriber) -> None:
        """Ask for pulls and add up what they show, until there is enough."""
        begin_s = time.monotonic()
        while not self._done():
            message = subscriber.receive(LISTEN_S)
            if isinstance(message, Slip) and message.finger in self._watches:
                self._add(message)
            elif subscriber.stale and time.monotonic() - begin_s > SILENCE_S:
                where = subscriber.endpoint
                raise Silence(f"no message from {where} for {SILENCE_S:g} s. {hint_for(where)}")
            self._ask()
            self._check_patience()

    def _done(self) -> bool:
        return all(len(agreeing(samples)) >= self._wanted for samples in self._samples.values())

    def _add(self, message: Slip) -> None:
        finger, found = message.finger, self._watches[message.finger].add(message)
        if found is None:
            return
        self._since_s = time.monotonic()
        if isinstance(found, PullRejected):
            print(f"  {finger}: not counted, {found.reason}", flush=True)
            return
        samples = self._samples[finger]
        samples.append(found)
        dynamic = "no even slide" if found.mu_d is None else f"{found.mu_d:.3f} while it slides"
        print(f"  {finger}: slips at {found.mu_s:.3f}, {dynamic}, {found.normal_n:.1f} N", flush=True)
        for sample in samples:
            if why := disagreement(sample, agreeing(samples)):
                print(f"  {finger}: not counted, {why}", flush=True)
        if len(samples) >= MOST_PULLS * self._wanted and not self._done():
            seen = ", ".join(f"{sample.mu_s:.3f}" for sample in samples)
            raise FrictionNotMeasured(f"the samples of finger {finger} do not agree: {seen}")

    def _ask(self) -> None:
        """Say what to do next, once."""
        phases = {watch.phase for watch in self._watches.values()}
        if phases == {"pull"}:
            forces = ", ".join(f"{finger} {watch.normal_n:.1f} N" for finger, watch in self._watches.items())
            number = min(len(agreeing(samples)) for samples in self._samples.values()) + 1
            self._say(f"Pull slowly along the pads until it slips, {number} of {self._wanted} ({forces}).")
        elif all(watch.obstacle == NO_CONTACT for watch in self._watches.values()):
            self._say("Grip a sample of the object, for example with: slipctl grip close 10")
        elif "release" in phases:
            self._say("Let go of it.")

    def _say(self, text: str) -> None:
        what = text.partition("(")[0]
        if what != self._asked:
            self._asked, self._since_s = what, time.monotonic()
            print(text, flush=True)

    def _check_patience(self) -> None:
        """Give up where nothing happens any more."""
        now_s = time.monotonic()
        obstacles = {finger: watch.obstacle for finger, watch in self._watches.items() if watch.obstacle}
        real = {finger: why for finger, why in obstacles.items() if why != NO_CONTACT}
        if not real:
            self._clear_s = now_s
        elif now_s - self._clear_s > OBSTACLE_S:
            finger, why = next(iter(real.items()))
            raise FrictionNotMeasured(f"finger {finger}: {why}")
        if now_s - self._since_s > self._patience_s:
            why = "; ".join(f"finger {finger}: {each}" for finger, each in obstacles.items()) or "it did not slip"
            raise FrictionNotMeasured(f"nothing more was measured for {self._patience_s:g} s: {why}")

    def _print_results(self) -> None:
        """Print what is known of each finger with enough samples."""
        for finger, samples in self._samples.items():
            if len(group := agreeing(samples)) >= self._wanted:
                _print_result(finger, group)


def _print_result(finger: str, group: list[PullSample]) -> None:
    found = median_of(group)
    lines = [f"static friction {found.mu_s:.3f} ± {spread(group):.1%}"]
    if found.mu_d is not None:
        lines.append(f"dynamic friction {found.mu_d:.3f}")
    print(f"\n{finger}: {', '.join(lines)}. For the config:\n", flush=True)
    print("\n".join(config_lines(finger, group)), flush=True)
