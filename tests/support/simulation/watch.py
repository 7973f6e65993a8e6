"""Invariants of every message under every fault, checked as the messages are published."""

from __future__ import annotations

import math
from typing import Any

from slipd.config import Config
from slipd.events import Publish
from slipd_client import messages
from slipd_client.messages.codec import MESSAGE_LIMITS

SAFE = ("no_contact", "stable")
STALE_NS = 20_000_000
"""A stream is stale after three of its periods, and not before this."""

SLACK_NS = 7_000_000
"""From a stream's going stale to the tick that notices it, and a step of the world."""

DECODED_EVERY = 8
"""One message in eight is packed and unpacked, and every warning; it takes as long as making them."""

OF_CONTACT = ("utilisation", "normal_n", "tangential_n", "spin_nm", "centroid_m", "torque_limit_nm", "pole_m")
"""Quantities that nobody knows while the force stream is stale."""


class Watch:
    """Looks at every message; what does not hold is added to `faults`.

    Args:
        config: The rig.

    Attributes:
        levels: Level of each finger as last told.
        reasons: Likewise.
        changes: Every change of level: time (CLOCK_MONOTONIC, ns), finger and level.
        status: The newest status message.
        gripper: The newest gripper message.
        slip: The newest slip message of each finger.
        faults: What did not hold, in words.
        lateness_ns: Time that the lines add and nobody can know, as long as no device's clock has been learned.
    """

    def __init__(self, config: Config) -> None:
        self.levels = dict.fromkeys(config.finger, "unknown")
        self.reasons: dict[str, list[str]] = {name: [] for name in config.finger}
        self.changes: list[tuple[int, str, str]] = []
        self.status: dict[str, Any] = {}
        self.gripper: dict[str, Any] = {}
        self.slip: dict[str, dict[str, Any]] = {}
        self.faults: list[str] = []
        self.messages = 0
        self.lateness_ns = 0
        self._woke_ns = 0
        self._seq: dict[str, int] = {}
        self._fresh: dict[str, int] = {}
        periods_ns = {name: 1e9 / stream.rate_hz for name, stream in config.streams().items()}
        self._limits = {name: max(3.0 * period_ns, STALE_NS) for name, period_ns in periods_ns.items()}

    def fresh(self, link: str, said_ns: int) -> None:
        """A true reading of a stream arrived that was acquired at ``said_ns``."""
        self._fresh[link] = max(said_ns, self._fresh.get(link, 0))

    def lost(self, link: str) -> None:
        """Nothing is known of a stream any more."""
        self._fresh.pop(link, None)

    def suspended(self, t_ns: int) -> None:
        """The host slept until ``t_ns``: from the next tick on, nothing from before is known."""
        self._woke_ns = t_ns

    def hear(self, message: Publish, t_ns: int) -> None:
        """One message, published at ``t_ns``."""
        topic, body = message.topic, message.body
        self.messages += 1
        if body["seq"] % DECODED_EVERY == 0 or topic == "warning":
            wire = messages.encode(body)
            if messages.encode(messages.decode(wire, MESSAGE_LIMITS)) != wire:
                self._blame(t_ns, f"{topic} does not survive the wire")
        elif not _finite(body):
            self._blame(t_ns, f"{topic} carries a number that is none")
        if body["seq"] != self._seq.get(topic, 0):
            self._blame(t_ns, f"{topic} has seq {body['seq']} behind {self._seq.get(topic, 0) - 1}")
        self._seq[topic] = body["seq"] + 1
        if topic == "status":
            self.status = body
        elif topic == "gripper":
            self.gripper = body
        elif topic == "warning" or topic.startswith("slip."):
            self._estimator(topic, body, t_ns)

    def tick(self, t_ns: int) -> None:
        """Time passed: what was last told must still hold."""
        self._fresh = {stream: said_ns for stream, said_ns in self._fresh.items() if said_ns >= self._woke_ns}
        for finger, level in self.levels.items():
            self._is_known(finger, level, t_ns, SLACK_NS)

    def _estimator(self, topic: str, body: dict[str, Any], t_ns: int) -> None:
        finger = body["finger"]
        if topic == "warning":
            if body["previous"] != self.levels[finger]:
                self._blame(t_ns, f"{finger} was {self.levels[finger]}, and is told as {body['previous']} before")
            self.levels[finger], self.reasons[finger] = body["level"], body["reasons"]
            self.changes.append((t_ns, finger, body["level"]))
        else:
            self.slip[finger] = body
            if body["level"] != self.levels[finger]:
                self._blame(t_ns, f"{finger} is told as {body['level']} without a warning of the change")
            told = [name for name in OF_CONTACT if "stale" in body["reasons"] and body[name] is not None]
            if told and body["level"] == "unknown":
                self._blame(t_ns, f"{finger} is stale, and tells {', '.join(told)}")
            self.reasons[finger] = body["reasons"]
        self._is_known(finger, body["level"], body["t_ns"], 0)

    def _is_known(self, finger: str, level: str, t_ns: int, slack_ns: int) -> None:
        """Safe is told only while the streams that decide it are fresh."""
        if level not in SAFE:
            return
        for kind in ("wrench", "pad") if level == "stable" else ("wrench",):
            stream = f"{finger}.{kind}"
            acquired_ns = self._fresh.get(stream, -math.inf)
            age_ns = t_ns - acquired_ns
            if age_ns > self._limits[stream] + slack_ns + self.lateness_ns:
                self._blame(t_ns, f"{finger} is told as {level}, and {stream} is {age_ns * 1e-6:.1f} ms old")

    def _blame(self, t_ns: int, what: str) -> None:
        if len(self.faults) < 20:
            self.faults.append(f"at {t_ns * 1e-9:.4f} s: {what}")


def _finite(body: dict[str, Any]) -> bool:
    """Whether no number of a message is NaN or infinite; lists and maps within are left to the decoder."""
    return all(value - value == 0.0 for value in body.values() if type(value) is float)
