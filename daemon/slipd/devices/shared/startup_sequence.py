"""Sequence of requests that brings a device to sending readings, and starts again when it falls silent.

Several sessions share it. It handles requests, answers and time, but does not know what they mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

ANSWER_NS = 500_000_000
"""Time for an answer: some milliseconds, unless readings already on the line delay it."""
ATTEMPTS = 3
"""Unanswered attempts after which the device is not in the expected state."""
RETRY_PAUSE_NS = 1_000_000_000
"""Pause before a refused request is repeated, or an unanswered sequence starts again."""
SILENCE_NS = 1_000_000_000
"""Silence after which the device no longer sends: four periods of the slowest configurable rate (4 Hz)."""


@dataclass(frozen=True, slots=True)
class Step:
    """One request.

    Attributes:
        name: Name of the request, for people.
        request: Bytes to send.
        answer: "required", "optional" (the device may not know the request) or "none" (it never answers this one).
        pause_ns: Time to the next request if no answer comes. 0 means `ANSWER_NS`, or no pause after a request that is
            never answered.
        attempts: Number of times the request is sent without an answer.
    """

    name: str
    request: bytes
    answer: str = "required"
    pause_ns: int = 0
    attempts: int = ATTEMPTS


class StartupSequence:
    """Send the requests one by one, then watch the readings.

    `state` is "closed", "waiting" (nothing was received yet, or the device fell silent), "configuring", "running", or
    the problem, such as "no answer to rate"; the sequence retries forever.

    Args:
        steps: The requests, in order; readings are expected after the last one. Steps after the one that is being
            answered may be replaced.
        rest_ns: Pause before an unanswered sequence starts again.
        silence_ns: Time without readings after which the device no longer sends.
    """

    def __init__(self, steps: Sequence[Step], *, rest_ns: int = RETRY_PAUSE_NS, silence_ns: int = SILENCE_NS) -> None:
        self.state = "closed"
        self.due_ns: int | None = None
        self._steps = steps
        self._rest_ns = rest_ns
        self._silence_ns = silence_ns
        self._at = 0
        self._attempt = 0
        self._silent = True  # since the last request

    @property
    def awaited(self) -> str:
        """Name of the request whose answer is awaited; "" if there is none."""
        return self._steps[self._at].name if self._attempt else ""

    def start(self, now_ns: int) -> None:
        """Begin on a freshly opened link; the first request is due at once."""
        self.state = "waiting"
        self._go_to(0, now_ns)

    def stop(self) -> None:
        """End; nothing is due any more."""
        self.state = "closed"
        self.due_ns = None
        self._attempt = 0

    def on_time(self, now_ns: int) -> bytes:
        """Return the request that is due at ``now_ns``; empty if none is."""
        if self.due_ns is None or now_ns < self.due_ns:
            return b""
        if self._at == len(self._steps):
            self.state = f"no answer to {self._steps[-1].name}" if self._silent else "waiting"
            self._go_to(0, now_ns)
        step = self._steps[self._at]
        if self._attempt == step.attempts:
            self._give_up(step, now_ns)
            return self.on_time(now_ns)
        if step.answer == "none":
            self._go_to(self._at + 1, now_ns + step.pause_ns)
        else:
            self._attempt += 1
            self.due_ns = now_ns + (step.pause_ns or ANSWER_NS)
        return step.request

    def handle_answer(self, now_ns: int, error: str = "", *, skip: int = 0) -> None:
        """Handle the answer to the awaited request.

        Args:
            now_ns: Time of receipt.
            error: What is wrong with the answer, for people; "" if the device obeys. The request is then repeated.
            skip: Number of following requests that the answer makes unnecessary.
        """
        if error:
            self.state = error
            self._go_to(self._at, now_ns + RETRY_PAUSE_NS)
        else:
            # After a repeated request the answer may belong to either attempt: let a second answer pass first.
            self.resume(self._at + 1 + skip, now_ns if self._attempt == 1 else now_ns + ANSWER_NS)

    def resume(self, index: int, due_ns: int) -> None:
        """Continue with request ``index`` at ``due_ns``; until then nothing received counts as an answer."""
        self.state = "configuring"
        self._go_to(index, due_ns)

    def reading_received(self, now_ns: int) -> None:
        """Record that a reading arrived."""
        if self.due_ns is not None and self._at == len(self._steps):
            self.state = "running"
            self._silent = False
            self.due_ns = now_ns + self._silence_ns

    def _give_up(self, step: Step, now_ns: int) -> None:
        if step.answer == "optional":
            self._go_to(self._at + 1, now_ns)
        else:
            self.state = f"no answer to {step.name}"
            self._go_to(0, now_ns + self._rest_ns)

    def _go_to(self, index: int, due_ns: int) -> None:
        self._at, self._attempt, self.due_ns = index, 0, due_ns
        if index == len(self._steps):
            self._silent = True
            self.due_ns = due_ns + self._silence_ns
