"""Takes a device through its requests one by one until it sends readings, and again whenever it falls silent.

The part of a session that several devices share: it knows requests, answers and time, nothing of what they mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

ANSWER_NS = 500_000_000
"""An answer may wait behind readings already sent; it takes some milliseconds otherwise."""
ATTEMPTS = 3
"""A request unanswered so often means that the device is not in the state it is thought to be in."""
RETRY_PAUSE_NS = 1_000_000_000
"""Before a refused request is repeated, or an unanswered sequence begun anew."""
SILENCE_NS = 1_000_000_000
"""Four periods of the slowest rate that can be asked for (4 Hz): the device no longer sends."""


@dataclass(frozen=True, slots=True)
class Step:
    """One request.

    Attributes:
        name: What it is, for people.
        request: The bytes to write.
        answer: "required", "optional" (the device may not know the request) or "none" (it never answers this).
        pause_ns: Where no answer comes: time from this request to the next one.
    """

    name: str
    request: bytes
    answer: str = "required"
    pause_ns: int = 0


class Conversation:
    """Where the talk with a device stands.

    `state` is "closed", "waiting" (nothing came back so far, or what came fell silent), "configuring", "running", or
    names what is in the way, such as "no answer to rate"; everything is retried for ever.

    Args:
        steps: The requests in their order; behind the last one readings are expected.
    """

    def __init__(self, steps: Sequence[Step]) -> None:
        self.state = "closed"
        self.due_ns: int | None = None
        self._steps = steps
        self._at = 0
        self._attempt = 0
        self._silent = True  # since the last request

    @property
    def asked(self) -> str:
        """Name of the request that waits for its answer; "" where none does."""
        return self._steps[self._at].name if self._attempt else ""

    def start(self, now_ns: int) -> None:
        """Begin on a freshly opened link; the first request is due at once."""
        self.state = "waiting"
        self._go_to(0, now_ns)

    def stop(self) -> None:
        """End: nothing is due any more."""
        self.state = "closed"
        self.due_ns = None
        self._attempt = 0

    def on_time(self, now_ns: int) -> bytes:
        """Return the request that is due at ``now_ns``; empty when none is."""
        if self.due_ns is None or now_ns < self.due_ns:
            return b""
        if self._at == len(self._steps):
            self.state = f"no answer to {self._steps[-1].name}" if self._silent else "waiting"
            self._go_to(0, now_ns)
        elif self._attempt == ATTEMPTS:
            return self._give_up(now_ns)
        step = self._steps[self._at]
        if step.answer == "none":
            self._go_to(self._at + 1, now_ns + step.pause_ns)
        else:
            self._attempt += 1
            self.due_ns = now_ns + ANSWER_NS
        return step.request

    def answered(self, now_ns: int, refusal: str = "", *, skip: int = 0) -> None:
        """Take the answer to the request that waits for one.

        Args:
            now_ns: When it came.
            refusal: Why the device refuses, "" where it obeys.
            skip: Requests that the answer makes needless.
        """
        if refusal:
            self.state = f"refused {self.asked}: {refusal}"
            self._go_to(self._at, now_ns + RETRY_PAUSE_NS)
        else:
            self.state = "configuring"
            self._go_to(self._at + 1 + skip, now_ns)

    def has_reading(self, now_ns: int) -> None:
        """Take note that a reading came."""
        if self.due_ns is not None and self._at == len(self._steps):
            self.state = "running"
            self._silent = False
            self.due_ns = now_ns + SILENCE_NS

    def _give_up(self, now_ns: int) -> bytes:
        if self._steps[self._at].answer == "optional":
            self._go_to(self._at + 1, now_ns)
            return self.on_time(now_ns)
        self.state = f"no answer to {self.asked}"
        self._go_to(0, now_ns + RETRY_PAUSE_NS)
        return b""

    def _go_to(self, at: int, due_ns: int) -> None:
        self._at, self._attempt, self.due_ns = at, 0, due_ns
        if at == len(self._steps):
            self._silent = True
            self.due_ns = due_ns + SILENCE_NS
