"""Hears the daemon's messages, and tells what was not heard: gaps, restarts, silence."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from types import TracebackType
from typing import TYPE_CHECKING

import zmq

from slipd_client.hearing import SILENCE_S, Hearing
from slipd_client.link import Link
from slipd_client.messages.typed import Message
from slipd_client.paths import publish_endpoint

if TYPE_CHECKING:
    from slipd_client.keys import Keys

__all__ = ["Message", "Subscriber", "SubscriberBase"]


class SubscriberBase:
    """What the blocking and the asyncio subscriber share: the connection, and what is known of the messages.

    Args:
        endpoint: Where the daemon publishes; its default endpoint when None.
        topics: Beginnings of the topics to hear: ``slip`` is every finger's verdict, "" is everything.
        keys: Who this client is, for a daemon across a network; None on this machine.
        silence_s: How long nothing at all may be heard before iteration raises Silence; None waits for ever. The
            daemon's ``status`` counts whatever the topics are, so that a quiet topic is not taken for a dead daemon.

    Raises:
        ValueError: The endpoint is none.
    """

    def __init__(
        self,
        endpoint: str | None = None,
        topics: Sequence[str] = ("slip",),
        *,
        keys: Keys | None = None,
        silence_s: float | None = SILENCE_S,
    ) -> None:
        self._hearing = Hearing(topics, silence_s)
        self._link = Link(zmq.SUB, publish_endpoint() if endpoint is None else endpoint, keys)
        for prefix in self._hearing.prefixes:
            self._link.socket.setsockopt(zmq.SUBSCRIBE, prefix.encode())

    @property
    def endpoint(self) -> str:
        """Where the messages come from."""
        return self._link.endpoint

    @property
    def age_s(self) -> float | None:
        """Seconds since a message was last heard, ``status`` included; None before the first."""
        return self._hearing.age_s

    @property
    def stale(self) -> bool:
        """Nothing has been heard for ``silence_s``, or ever: what was last heard says nothing of now."""
        return self._hearing.stale

    @property
    def bad(self) -> int:
        """Messages dropped because they could not be read; the next readable one counts them as missed."""
        return self._hearing.bad

    @property
    def bad_reason(self) -> str:
        """Why the last of them could not be read; "" where all could."""
        return self._hearing.bad_reason


class Subscriber(SubscriberBase):
    """Receives messages; blocking, for one thread, best used in a ``with`` statement. Arguments: `SubscriberBase`."""

    def receive(self, timeout_s: float | None = None) -> Message | None:
        """Wait for the next message; None when none came within ``timeout_s`` (None waits for ever)."""
        return self._receive(None if timeout_s is None else time.monotonic() + timeout_s)

    def __iter__(self) -> Iterator[Message]:
        """Every message from now on.

        Raises:
            Silence: Nothing was heard for ``silence_s``. Iterating anew goes on listening.
        """
        while True:
            message = self._receive(self._hearing.silent_at, by_silence=True)
            if message is None:
                raise self._hearing.silence(self.endpoint)
            yield message

    def _receive(self, until: float | None, by_silence: bool = False) -> Message | None:
        """The next message before ``until``, which moves on with what is heard where it is the end of silence."""
        while (frames := self._link.receive(until)) is not None:
            message = self._hearing.take(frames)
            if message is not None:
                return message
            if by_silence:
                until = self._hearing.silent_at
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
