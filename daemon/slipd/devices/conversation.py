"""Takes a device through its requests one by one until it sends readings, and again whenever it falls silent.

The part of a session that several devices share: it knows requests, answers and time, nothing of what they mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from slipd.devices.health import DecoderHealth
from slipd.samples import Sample

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
        pause_ns: Where no answer comes: time from this request to the next one; 0 for `ANSWER_NS`, or for none behind
            a request that is never answered.
        attempts: How often it is asked in vain.
    """

    name: str
    request: bytes
    answer: str = "required"
    pause_ns: int = 0
    attempts: int = ATTEMPTS


class Conversation:
    """Where the talk with a device stands.

    `state` is "closed", "waiting" (nothing came back so far, or what came fell silent), "configuring", "running", or
    names what is in the way, such as "no answer to rate"; everything is retried for ever.

    Args:
        steps: The requests in their order; behind the last one readings are expected. Those behind the one that is
            being answered may be replaced.
        rest_ns: Time after which an unanswered sequence is begun anew.
        silence_ns: Time after which a device that sent readings no longer does.
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

    def answered(self, now_ns: int, wrong: str = "", *, skip: int = 0) -> None:
        """Take the answer to the request that waits for one.

        Args:
            now_ns: When it came.
            wrong: What is wrong with it, for people; "" where the device obeys. It is asked again.
            skip: Requests that the answer makes needless.
        """
        if wrong:
            self.state = wrong
            self._go_to(self._at, now_ns + RETRY_PAUSE_NS)
        else:
            # Which of two like requests it is for it does not say: the second answer is let pass first.
            self.resume(self._at + 1 + skip, now_ns if self._attempt == 1 else now_ns + ANSWER_NS)

    def resume(self, at: int, due_ns: int) -> None:
        """Go on with the request of that index at ``due_ns``; until then nothing that comes is an answer."""
        self.state = "configuring"
        self._go_to(at, due_ns)

    def has_reading(self, now_ns: int) -> None:
        """Take note that a reading came."""
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

    def _go_to(self, at: int, due_ns: int) -> None:
        self._at, self._attempt, self.due_ns = at, 0, due_ns
        if at == len(self._steps):
            self._silent = True
            self.due_ns = due_ns + self._silence_ns


S = TypeVar("S", bound=Sample)


class _Decoder(Protocol[S]):
    health: DecoderHealth

    def receive(self, data: bytes, t_ns: int) -> list[S]: ...

    def forget(self) -> None: ...


class TalkingSession(Generic[S]):
    """A session that leaves the talk to a `Conversation`; what the answers mean is the device's own.

    Args:
        decoder: Of readings and answers.
        talk: The conversation that starts the readings.
        farewell: What is written last.
    """

    def __init__(self, decoder: _Decoder[S], talk: Conversation, farewell: bytes = b"") -> None:
        self.decoder = decoder
        self.health = decoder.health
        self.identity = ""
        self._talk = talk
        self._farewell = farewell

    @property
    def state(self) -> str:
        """A short word for people."""
        return self._talk.state

    def start(self, now_ns: int) -> bytes:
        """Begin on a freshly opened link; return the first request, if one is due at once."""
        self.decoder.forget()
        self.identity = ""
        self._talk.start(now_ns)
        return self._talk.on_time(now_ns)

    def receive(self, data: bytes, now_ns: int) -> list[S]:
        """Take bytes received at ``now_ns`` and return the readings they complete, whatever the state."""
        samples = self.decoder.receive(data, now_ns)
        if self._talk.asked:
            self._hear(now_ns)
        if samples:
            self._talk.has_reading(now_ns)
        return samples

    def next_deadline(self) -> int | None:
        """Return when `on_time` is due, ns; None while closed."""
        return self._talk.due_ns

    def on_time(self, now_ns: int) -> bytes:
        """Return the request that is due at ``now_ns``; empty when none is."""
        return self._talk.on_time(now_ns)

    def stop(self) -> bytes:
        """End, and return what stops the readings."""
        self._talk.stop()
        return self._farewell

    def _hear(self, now_ns: int) -> None:
        """Look among what the decoder found last for the answer that is waited for."""
