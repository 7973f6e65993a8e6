"""Receives the daemon's messages, and reports what did not arrive: gaps, restarts, silence."""

from __future__ import annotations

import abc
import math
import re
import time
from collections.abc import Callable, Iterator, Sequence

import zmq

from slipd_client.errors import CallError, MessageError, Silence, check_seconds
from slipd_client.keys import Keys
from slipd_client.lease_keeper import check_held, held_until
from slipd_client.link import Blocking, Link
from slipd_client.messages import STATUS_TOPIC
from slipd_client.messages.codec import RunOrder, read
from slipd_client.messages.topics import TOPICS, TOPICS_OF_FINGERS, Message
from slipd_client.paths import hint_for, publish_endpoint

__all__ = ["Message", "Subscriber", "SubscriberBase"]

SILENCE_S = 3.0
"""The daemon publishes ``status`` once a second: after so long without a message it is gone or cut off."""


IDLE_S = 0.1
"""Time between two looks at the messages while nobody needs every one, s."""

_DRAINED = 5000
"""Most messages that one call of `Subscriber.newest` takes, however fast they arrive."""


class SubscriberBase(abc.ABC):
    """What the blocking and the asyncio subscriber share: the connection and the order of the messages.

    ``status`` is always received, as the daemon's sign of life where all else is quiet, but returned only to a
    subscriber that asked for it.

    Args:
        endpoint: Where the daemon publishes; its default endpoint when None.
        topics: Beginnings of the topics to receive: ``slip`` is every finger's verdict, ``slip.left`` that of one, ""
            is everything, also what a newer daemon adds.
        keys: Keys of this client, for a daemon across a network; None on this machine.
        silence_s: Iteration raises Silence after so long without any message; None waits for ever. The daemon's
            ``status`` counts whatever the topics are, so that a quiet topic is not mistaken for a dead daemon. Within
            the block of a lease, iteration raises LeaseLost as soon as that lease may have ended.

    Attributes:
        bad: Messages dropped because they could not be read; the next readable one counts them as missed.
        bad_reason: Why the last of them could not be read; "" where all could be read.

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
        strings = isinstance(topics, Sequence) and all(isinstance(each, str) for each in topics)
        if not strings or isinstance(topics, str):
            raise CallError(f'topics must be a sequence of strings, e.g. ("slip",), got {topics!r:.60}')
        for each in topics:
            _check_beginning(each)
        if silence_s is not None:
            check_seconds("silence_s", silence_s, SILENCE_S)
        self.bad = 0
        self.bad_reason = ""
        self._silence_s = silence_s
        self._topics = tuple(topics)
        self._boot = ""
        self._order = RunOrder()
        self._last_s: float | None = None
        self._restart_pending = False
        self._since_s = time.monotonic()
        self._link = Link(zmq.SUB, publish_endpoint() if endpoint is None else endpoint, keys)
        for prefix in self._topics if STATUS_TOPIC.startswith(self._topics) else (*self._topics, STATUS_TOPIC):
            self._link.socket.setsockopt(zmq.SUBSCRIBE, prefix.encode())

    @property
    def endpoint(self) -> str:
        """Where the messages come from."""
        return self._link.endpoint

    @property
    def age_s(self) -> float | None:
        """Seconds since the last message, ``status`` included; None before the first."""
        return None if self._last_s is None else time.monotonic() - self._last_s

    @property
    def stale(self) -> bool:
        """No message for ``silence_s``, or none ever: what was received last no longer describes the present."""
        age_s = self.age_s
        return age_s is None or (self._silence_s is not None and age_s > self._silence_s)

    def check_silence(self) -> None:
        """Raise Silence where no message came for ``silence_s``."""
        if time.monotonic() < self._silent_at():
            return
        self._since_s = time.monotonic()
        unreadable = (
            f"; {self.bad} could not be read, the last: {self.bad_reason} (another version?)" if self.bad else ""
        )
        where = self.endpoint
        raise Silence(f"no message from {where} for {self._silence_s:g} s{unreadable}. {hint_for(where)}")

    def _silent_at(self) -> float:
        """Return when the silence will have lasted too long, on ``time.monotonic``; infinity: never."""
        return math.inf if self._silence_s is None else max(self._since_s, self._last_s or 0.0) + self._silence_s

    def _patient_until(self) -> float | None:
        """Return when an iteration must check whether it may go on, on ``time.monotonic``; None: never."""
        until = min(self._silent_at(), held_until())
        return None if until == math.inf else until

    @abc.abstractmethod
    async def _frames(self, until: float | None) -> list[bytes] | None:
        """Wait for the frames of a message; None where none came before ``until``."""

    async def _received(self, timeout_s: float | None) -> Message | None:
        """Return the next message; None when none came in time."""
        until = None if timeout_s is None else time.monotonic() + timeout_s
        while (frames := await self._frames(until)) is not None:
            if (message := self._accept(frames)) is not None:
                return message
            if until is not None and time.monotonic() > until:
                break
        return None

    async def _awaited(self) -> Message:
        """Return the next message of an iteration."""
        while True:
            check_held()
            frames = await self._frames(self._patient_until())
            if frames is not None and (message := self._accept(frames)) is not None:
                return message
            self.check_silence()

    def _accept(self, frames: list[bytes]) -> Message | None:
        """Return the message in these frames; None for one that is unreadable, a repeat, or not asked for."""
        try:
            topic, raw = read(frames)
            restarted = self._boot not in ("", raw["boot"])
            order = RunOrder() if restarted else self._order
            message = order.accept(topic, raw, restarted or self._restart_pending)
        except MessageError as error:
            self.bad += 1
            self.bad_reason = str(error)
            return None
        if message is None:
            return None
        self._boot, self._order = message.boot, order
        self._last_s = time.monotonic()
        wanted = topic.startswith(self._topics)
        self._restart_pending = message.restarted and not wanted
        return message if wanted else None


class Subscriber(Blocking, SubscriberBase):
    """Receives messages; blocking, for one thread, best used in a ``with`` statement. Arguments: `SubscriberBase`."""

    def receive(self, timeout_s: float | None = None) -> Message | None:
        """Wait for the next message; None when none came within ``timeout_s`` (None waits for ever)."""
        return self._run(self._received(timeout_s))

    def newest(self) -> list[Message]:
        """Return the newest message of each topic that has arrived and was not yet received; never waits.

        For a display: what it has no time to show is not decoded. The next message of its topic counts it as missed.
        """
        accepted = map(self._accept, self._link.newest(_DRAINED))
        return [message for message in accepted if message is not None]

    def follow(self, idle: Callable[[], bool] = lambda: False) -> Iterator[Message | Silence]:
        """Yield every message for ever, and a Silence each time that none came for ``silence_s``.

        Args:
            idle: Whether nobody needs every message now: then the newest of each topic is yielded, ten times a second,
                and most messages are never decoded.
        """
        while True:
            try:
                while idle():
                    time.sleep(IDLE_S)
                    self.check_silence()
                    yield from self.newest()
                for message in self:
                    yield message
                    if idle():
                        break
            except Silence as silence:
                yield silence

    def __iter__(self) -> Iterator[Message]:
        """Iterate over every message from now on.

        Raises:
            LeaseLost: This thread runs the block of a lease, and that lease is lost: at once, also without a message.
            Silence: No message arrived for ``silence_s``. A new iteration continues to receive.
        """
        while True:
            yield self._run(self._awaited())


def _check_beginning(beginning: str) -> None:
    """Do nothing for the beginning of a topic; the name of its finger is not checked.

    Raises:
        CallError: No topic begins like that, so that nothing would ever arrive.
    """
    word, dot, finger = beginning.partition(".")
    if dot:
        known = word in TOPICS_OF_FINGERS and re.fullmatch("[a-z0-9]{0,32}", finger) is not None
    else:
        known = any(topic.startswith(word) for topic in TOPICS)
    if not known:
        names = ", ".join(f"{topic}.FINGER" if topic in TOPICS_OF_FINGERS else topic for topic in TOPICS)
        raise CallError(f'topics must be beginnings of {names}, or "" for everything, got {beginning!r:.60}')
