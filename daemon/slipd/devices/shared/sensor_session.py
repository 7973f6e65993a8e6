"""Sessions with sensors: the requests that bring a device to sending readings, again when it falls silent, and polls.

`StartupSequence` sends the requests, each a `Step`, and repeats what is not answered. `SensorSession` adds the decoder,
and passes the answers that it finds to their steps. `PolledSession` is for devices that answer each request with one
reading.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from slipd.devices.shared.device_interface import Decoder
from slipd.devices.shared.frame_scanner import FrameDecoder
from slipd.types.samples import Sample

ANSWER_NS = 500_000_000
"""Time for an answer: some milliseconds, unless readings already on the line delay it."""
ATTEMPTS = 3
"""Unanswered attempts after which the device is not in the expected state."""
RETRY_PAUSE_NS = 1_000_000_000
"""Pause before a refused request is repeated, or an unanswered sequence starts again."""
SILENCE_NS = 1_000_000_000
"""Silence after which the device no longer sends: four periods of the slowest configurable rate (4 Hz)."""


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """One request.

    Attributes:
        name: Name of the request, for people.
        request: Bytes to send.
        answer: "required", "optional" (the device may not know the request) or "none" (it never answers this one).
        pause_ns: Time to the next request if no answer comes. 0 means `ANSWER_NS`, or no pause after a request that is
            never answered.
        attempts: Number of times the request is sent without an answer.
        reply: What its answer begins with in the ``replies`` of the decoder, such as the number of the command.
        handle: ``handle(content)`` uses the answer, and returns what is wrong with it, "" or None if the device obeys.
    """

    name: str
    request: bytes
    answer: str = "required"
    pause_ns: int = 0
    attempts: int = ATTEMPTS
    reply: object = None
    handle: Callable[[bytes], str | None] = lambda _: None


class StartupSequence:
    """Send the requests one by one, then watch the readings.

    `state` is "closed", "waiting" (nothing was received yet, or the device fell silent), "configuring",
    `answered_state` once the last request was answered, "running", or the problem, such as "no answer to rate"; the
    sequence retries forever.

    Args:
        steps: The requests, in order; readings are expected after the last one. Steps after the one that is being
            answered may be replaced.
        last_request: Bytes to send at the end.
        rest_ns: Pause before an unanswered sequence starts again.
        silence_ns: Time without readings after which the device no longer sends.

    Attributes:
        state: As above.
        awaited: The request whose answer is awaited; None while none is.
    """

    answered_state = "configuring"

    def __init__(
        self,
        steps: list[Step],
        last_request: bytes = b"",
        *,
        rest_ns: int = RETRY_PAUSE_NS,
        silence_ns: int = SILENCE_NS,
    ) -> None:
        self.state = "closed"
        self.awaited: Step | None = None
        self._due_ns: int | None = None
        self._steps = steps
        self._last_request = last_request
        self._rest_ns = rest_ns
        self._silence_ns = silence_ns
        self._at = 0
        self._attempt = 0
        self._silent = True  # since the last request

    def start(self, now_ns: int) -> bytes:
        """Begin on a freshly opened link; return the first request."""
        self.begin(now_ns)
        return self.on_time(now_ns)

    def begin(self, now_ns: int) -> None:
        """Make the first request due at ``now_ns``."""
        self.state = "waiting"
        self._go_to(0, now_ns)

    def next_deadline(self) -> int | None:
        """Return when `on_time` is due, ns; None while closed."""
        return self._due_ns

    def stop(self) -> bytes:
        """End; return the last request."""
        self.state = "closed"
        self.awaited = self._due_ns = None
        return self._last_request

    def on_time(self, now_ns: int) -> bytes:
        """Return the request that is due at ``now_ns``; empty if none is."""
        if self._due_ns is None or now_ns < self._due_ns:
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
            self.awaited = step
            self._due_ns = now_ns + (step.pause_ns or ANSWER_NS)
        return step.request

    def handle_answer(self, now_ns: int, error: str | None = None) -> None:
        """Handle the answer to the awaited request.

        Args:
            now_ns: Time of receipt.
            error: What is wrong with the answer, for people, so that the request is repeated; "" or None if the device
                obeys.
        """
        if error:
            self.state = error
            self._go_to(self._at, now_ns + RETRY_PAUSE_NS)
        else:
            # After a repeated request the answer may belong to either attempt: let a second answer pass first.
            self.resume(self._at + 1, now_ns if self._attempt == 1 else now_ns + ANSWER_NS)

    def skip_next(self) -> None:
        """Leave out the request after the awaited one, because the answer makes it unnecessary."""
        self._at += 1

    def resume(self, index: int, due_ns: int) -> None:
        """Continue with request ``index`` at ``due_ns``; until then nothing received counts as an answer."""
        self._go_to(index, due_ns)
        self.state = "configuring" if index < len(self._steps) else self.answered_state

    def reading_received(self, now_ns: int) -> None:
        """Record that a reading arrived."""
        if self._due_ns is not None and self._at == len(self._steps):
            self.state = "running"
            self._silent = False
            self._due_ns = now_ns + self._silence_ns

    def _give_up(self, step: Step, now_ns: int) -> None:
        if step.answer == "optional":
            self._go_to(self._at + 1, now_ns)
        else:
            self.state = f"no answer to {step.name}"
            self._go_to(0, now_ns + self._rest_ns)

    def _go_to(self, index: int, due_ns: int) -> None:
        self._at, self._attempt, self._due_ns, self.awaited = index, 0, due_ns, None
        if index == len(self._steps):
            self._silent = True
            self._due_ns = due_ns + self._silence_ns


D = TypeVar("D", bound=FrameDecoder)


class SensorSession(StartupSequence, Generic[D]):
    """Run a startup sequence and return readings, in every state.

    Args:
        decoder: Decoder of readings and answers.
        steps: The requests that start the readings.
        last_request: Bytes to send when the session ends.
        times: See `StartupSequence`.
    """

    def __init__(self, decoder: D, steps: list[Step], last_request: bytes = b"", **times: int) -> None:
        super().__init__(steps, last_request, **times)
        self.decoder = decoder
        self.health = decoder.health
        self.identity = ""

    def start(self, now_ns: int) -> bytes:
        """Begin on a freshly opened link; return the first request."""
        self.decoder.forget()
        self.identity = ""
        return super().start(now_ns)

    def receive(self, data: bytes, now_ns: int) -> Sequence[Sample]:
        """Decode bytes received at ``now_ns``; return the readings they complete."""
        samples = self.decoder.receive(data, now_ns)
        if self.awaited:
            self._handle_answers(now_ns)
        if samples:
            self.reading_received(now_ns)
        return samples

    def _handle_answers(self, now_ns: int) -> None:
        """Look for the awaited answer among the bytes that the decoder received last."""
        for reply, content in self.decoder.replies:
            step = self.awaited
            if step is not None and reply == step.reply:
                self.handle_answer(now_ns, step.handle(content))


P = TypeVar("P", bound=Decoder)


class PolledSession(Generic[P]):
    """Keep one poll outstanding. `state` is "closed", "waiting" or "running".

    Args:
        decoder: Decoder of the replies.
        request: What to send for one reading.
        timeout_ns: Time after which a poll without a reading was lost.
        period_ns: Least time between two polls; a late one delays none of the next. 0: each reading makes one due.
    """

    identity = ""

    def __init__(self, decoder: P, request: bytes, timeout_ns: int, period_ns: int = 0) -> None:
        self.decoder = decoder
        self.health = decoder.health
        self.state = "closed"
        self._request, self._timeout_ns, self._period_ns = request, timeout_ns, period_ns
        self._next_ns = 0
        self._due_ns: int | None = None

    def start(self, now_ns: int) -> bytes:
        """Begin on a freshly opened link; return the first poll."""
        self.state, self._due_ns = "waiting", now_ns
        return self.on_time(now_ns)

    def receive(self, data: bytes, now_ns: int) -> Sequence[Sample]:
        """Return the readings that bytes received at ``now_ns`` complete; a reading makes the next poll due."""
        samples = self.decoder.receive(data, now_ns)
        if samples and self._due_ns is not None:
            self.state = "running"
            self._due_ns = max(self._next_ns, now_ns)
        return samples

    def next_deadline(self) -> int | None:
        """Return when `on_time` is due, ns; None while closed."""
        return self._due_ns

    def on_time(self, now_ns: int) -> bytes:
        """Return the poll that is due at ``now_ns``; empty if none is."""
        if self._due_ns is None or now_ns < self._due_ns:
            return b""
        self.decoder.forget()  # the rest of an earlier reply will not come
        late = now_ns >= self._next_ns + self._period_ns
        self._next_ns = (now_ns if late else self._next_ns) + self._period_ns
        self._due_ns = now_ns + self._timeout_ns
        return self._request

    def stop(self) -> bytes:
        """End; the device needs no request for that."""
        self.state, self._due_ns = "closed", None
        return b""


def strip_padding(data: bytes) -> str:
    """Return the text without padding spaces and zeros; "" if it is not printable ASCII."""
    text = data.decode("latin-1").strip(" \0")
    return text if text.isascii() and text.isprintable() else ""
