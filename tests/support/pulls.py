"""Verdicts on a finger while somebody pulls an object out of its grip, as the daemon publishes them."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from slipd_client.messages.codec import typed_message
from slipd_client.messages.topics import Slip

HZ = 250


@dataclass
class Hand:
    """Pulls, and makes the verdicts on it at a steady rate.

    Attributes:
        finger: Name of the finger.
        mu_s: Static friction.
        mu_d: Dynamic friction.
        normal_n: The squeeze.
        noise: Standard deviation of the friction ratio.
        more: Fields that differ from those of a finger that is known and trusted.
    """

    finger: str = "left"
    mu_s: float = 0.6
    mu_d: float = 0.45
    normal_n: float = 10.0
    noise: float = 0.001
    more: dict[str, Any] = field(default_factory=dict)
    t_s: float = 100.0
    hz: float = HZ
    seed: int = 1

    def __post_init__(self) -> None:
        self._noise = random.Random(self.seed)

    def body(self, required: float, level: str = "stable", *, moves: bool = False) -> dict[str, Any]:
        """The next verdict."""
        self.t_s += 1.0 / self.hz
        required += self._noise.gauss(0.0, self.noise)
        evidence = ["load_drop"] if moves else []
        return {
            "v": 1, "seq": 1, "boot": "boot-1", "t_ns": round(self.t_s * 1e9), "finger": self.finger, "level": level,
            "reasons": ["slip_detected"] if moves else [], "evidence": evidence, "normal_n": self.normal_n,
            "spin_nm": 0.001, "friction_ratio": required, "friction_ratio_std": self.noise,
            "required_friction": required,
        } | self.more  # fmt: skip

    def rest(self, seconds: float = 0.5, required: float = 0.05) -> Iterator[dict[str, Any]]:
        """Nothing moves."""
        return (self.body(required) for _ in range(round(seconds * self.hz)))

    def pull(self, seconds: float = 0.8, slides_s: float = 0.4, late_s: float = 0.008) -> Iterator[dict[str, Any]]:
        """Pull until it slips; the slip is noticed ``late_s`` after it began."""
        count = round(seconds * self.hz)
        for k in range(count + 1):
            yield self.body(0.05 + (self.mu_s - 0.05) * k / count, "warning")
        late = round(late_s * self.hz)
        for k in range(round(slides_s * self.hz)):
            yield self.body(self.mu_d, "slipping" if k >= late else "warning", moves=k >= late)

    def once(self) -> Iterator[dict[str, Any]]:
        """Hold, pull until it slips, let go."""
        yield from self.rest()
        yield from self.pull()
        yield from self.rest()


def typed(body: dict[str, Any]) -> Slip:
    """A verdict as a client has it."""
    message = typed_message(f"slip.{body['finger']}", body)
    assert isinstance(message, Slip)
    return message
