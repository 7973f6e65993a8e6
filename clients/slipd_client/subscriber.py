"""Receives the daemon's messages, and reports what did not arrive: gaps, restarts, silence."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from types import TracebackType
from typing import TYPE_CHECKING

import zmq

from slipd_client.lease_keeper import check_held, held_until
from slipd_client.link import Link
from slipd_client.message_tracker import SILENCE_S, MessageTracker
from slipd_client.messages.schema.topics import Message
from slipd_client.paths import publish_endpoint

if TYPE_CHECKING:
    from slipd_client.keys import Keys

__all__ = ["Message", "Subscriber", "SubscriberBase"]

_DRAINED = 5000
"""Most messages that one call of `Subscriber.newest` takes, however fast they arrive."""


class SubscriberBase:
    """What the blocking and the asyncio subscriber share: the connection and the order of the messages.

    Args:
        endpoint: Where the daemon publishes; its default endpoint when None.
        topics: Beginnings of the topics to receive: ``slip`` is every finger's verdict, ``slip.left`` that of one, ""
            is everything, also what a newer daemon adds.
        keys: Keys of this client, for a daemon across a network; None on this machine.
        silence_s: Iteration raises Silence after so long without any message; None waits for ever. The daemon's
            ``status`` counts whatever the topics are, so that a quiet topic is not mistaken for a dead daemon. Within
            the block of a lease, iteration raises LeaseLost as soon as that lease may have ended.

    Raises:
        CallError: ``endpoint`` is not a ZeroMQ endpoint, another user could listen there, ``topics`` is not a sequence
            of strings, one of them begins no topic that this client knows, or ``silence_s`` is not a positive time.
    """

    def __init__(
        self,
        endpoint: str | None = None,
        topics: Sequence[str] = ("slip",),
        *,
        keys: Keys | None = None,
        silence_s: float | None = SILENCE_S,
    ) -> None:
        self._tracker = MessageTracker(topics, silence_s)
        self._link = Link(zmq.SUB, publish_endpoint() if endpoint is None else endpoint, keys)
        for prefix in self._tracker.prefixes:
            self._link.socket.setsockopt(zmq.SUBSCRIBE, prefix.encode())

    @property
    def endpoint(self) -> str:
        """Where the messages come from."""
        return self._link.endpoint

    @property
    def age_s(self) -> float | None:
        """Seconds since the last message, ``status`` included; None before the first."""
        return self._tracker.age_s

    @property
    def stale(self) -> bool:
        """No message for ``silence_s``, or none ever: what was received last no longer describes the present."""
        return self._tracker.stale

    def _patient_until(self) -> float | None:
        """Return when an iteration must check whether it may go on, on ``time.monotonic``; None: never."""
        until = min(self._tracker.silent_at, held_until())
        return None if until == math.inf else until

    def _check_silence(self) -> None:
        if time.monotonic() >= self._tracker.silent_at:
            raise self._tracker.silence(self.endpoint)

    @property
    def bad(self) -> int:
        """Messages dropped because they could not be read; the next readable one counts them as missed."""
        return self._tracker.bad

    @property
    def bad_reason(self) -> str:
        """Why the last of them could not be read; "" where all could be read."""
        return self._tracker.bad_reason


class Subscriber(SubscriberBase):
    """Receives messages; blocking, for one thread, best used in a ``with`` statement. Arguments: `SubscriberBase`."""

    def receive(self, timeout_s: float | None = None) -> Message | None:
        """Wait for the next message; None when none came within ``timeout_s`` (None waits for ever)."""
        return self._receive(None if timeout_s is None else time.monotonic() + timeout_s)

    def newest(self) -> list[Message]:
        """Return the newest message of each topic that has arrived and was not yet received; never waits.

        For a display: what it has no time to show is not decoded. The next message of its topic counts it as missed.
        """
        accepted = map(self._tracker.accept, self._link.newest(_DRAINED))
        return [message for message in accepted if message is not None]

    def __iter__(self) -> Iterator[Message]:
        """Iterate over every message from now on.

        Raises:
            LeaseLost: This thread runs the block of a lease, and that lease is lost: at once, also without a message.
            Silence: No message arrived for ``silence_s``. A new iteration continues to receive.
        """
        while True:
            check_held()
            message = self._receive(self._patient_until(), by_silence=True)
            if message is None:
                self._check_silence()
            else:
                yield message

    def _receive(self, until: float | None, by_silence: bool = False) -> Message | None:
        """Return the next message before ``until``; ``by_silence``: any message moves ``until`` on."""
        while (frames := self._link.receive(until)) is not None:
            message = self._tracker.accept(frames)
            if message is not None:
                return message
            if by_silence:
                until = self._patient_until()
            if until is not None and time.monotonic() > until:
                break
        return None

    def close(self) -> None:
        """Close the connection; a second call does nothing."""
        self._link.close()

    def __enter__(self) -> Subscriber:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
