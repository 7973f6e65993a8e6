"""Hears the daemon's messages, and tells what was not heard: gaps, restarts, silence."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any

import zmq

from slipd_client.errors import Silence
from slipd_client.link import Link
from slipd_client.messages import MESSAGE_LIMITS, PROTOCOL_VERSION, MessageError, decode
from slipd_client.paths import publish_endpoint

STALE_AFTER_S = 0.5
"""Slip verdicts come at 250 Hz while a finger's sensor speaks; half a second without one is no hiccup."""

HEADER = {"seq": int, "boot": str, "t_ns": int}
"""What this file needs of every message to order it."""


@dataclass(frozen=True)
class Message:
    """One message of the daemon.

    Attributes:
        topic: E.g. ``slip.left``.
        body: The map, with fields as in ``docs/protocol.md``; a quantity that is not known is None.
        missed: Messages of this topic that were published just before this one and did not arrive.
        restarted: The daemon was started anew since the message before, of whatever topic.
    """

    topic: str
    body: dict[str, Any]
    missed: int = 0
    restarted: bool = False

    @property
    def age_s(self) -> float:
        """Seconds since the reading behind this message was taken; only on the daemon's own machine.

        A program that reads more slowly than the daemon publishes gets old messages, and sees it here.
        """
        return (time.monotonic_ns() - int(self.body["t_ns"])) * 1e-9


class Subscriber:
    """Receives messages; blocking, for one thread, best used in a ``with`` statement.

    Args:
        endpoint: Where the daemon publishes; its default endpoint when None.
        topics: Beginnings of the topics to hear: ``slip`` is every finger's verdict, "" is everything.
        timeout_s: How long iteration waits for a message before it raises Silence; None waits for ever.
        stale_after_s: Age of the last message from which ``stale`` is true.

    Attributes:
        bad: Messages dropped because they could not be read.
        bad_reason: Why the last of them could not be read.

    Raises:
        ValueError: The endpoint is none.
    """

    def __init__(
        self,
        endpoint: str | None = None,
        topics: Sequence[str] = ("slip",),
        *,
        timeout_s: float | None = None,
        stale_after_s: float = STALE_AFTER_S,
    ) -> None:
        if isinstance(topics, str):
            raise ValueError(f'topics is a sequence of beginnings, e.g. ("{topics}",)')  # noqa: TRY004
        self.timeout_s = timeout_s
        self.stale_after_s = stale_after_s
        self.bad = 0
        self.bad_reason = ""
        self._boot = ""
        self._seq: dict[str, int] = {}
        self._heard_s: float | None = None
        self._link = Link(zmq.SUB, publish_endpoint() if endpoint is None else endpoint, {})
        for topic in topics:
            self._link.socket.setsockopt(zmq.SUBSCRIBE, topic.encode())

    @property
    def endpoint(self) -> str:
        """Where the messages come from."""
        return self._link.endpoint

    @property
    def age_s(self) -> float | None:
        """Seconds since a message was last received; None before the first."""
        return None if self._heard_s is None else time.monotonic() - self._heard_s

    @property
    def stale(self) -> bool:
        """Nothing has been received for ``stale_after_s``: what was last heard says nothing of now."""
        age_s = self.age_s
        return age_s is None or age_s > self.stale_after_s

    def receive(self, timeout_s: float | None = None) -> Message | None:
        """Wait for the next message; None when none came within ``timeout_s`` (None waits for ever)."""
        until = None if timeout_s is None else time.monotonic() + timeout_s
        while self._link.wait(zmq.POLLIN, until):
            message = self._accept(self._link.socket.recv_multipart(zmq.NOBLOCK))
            if message is not None:
                return message
            if until is not None and time.monotonic() > until:
                break
        return None

    def __iter__(self) -> Iterator[Message]:
        """Every message from now on.

        Raises:
            Silence: None came for ``timeout_s``.
        """
        while True:
            message = self.receive(self.timeout_s)
            if message is None:
                raise Silence(f"no message from {self.endpoint} for {self.timeout_s} s")
            yield message

    def _accept(self, frames: list[bytes]) -> Message | None:
        """Place a message among those before it; None for one that is unreadable or heard already."""
        try:
            topic, body = _parse(frames)
        except MessageError as error:
            self.bad += 1
            self.bad_reason = str(error)
            return None
        restarted = self._boot not in ("", body["boot"])
        if restarted:
            self._seq.clear()
        last = self._seq.get(topic, body["seq"] - 1)
        if body["seq"] <= last:  # after a reconnection the daemon sends the last message of each topic again
            return None
        self._boot = body["boot"]
        self._seq[topic] = body["seq"]
        self._heard_s = time.monotonic()
        return Message(topic, body, missed=body["seq"] - last - 1, restarted=restarted)

    def close(self) -> None:
        """Close the connection; a second call does nothing."""
        self._link.close()

    def __enter__(self) -> Subscriber:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _parse(frames: list[bytes]) -> tuple[str, dict[str, Any]]:
    if len(frames) != 2:
        raise MessageError("malformed", f"two frames are expected, these are {len(frames)}")
    try:
        topic = frames[0].decode()
    except UnicodeDecodeError as error:
        raise MessageError("malformed", f"the topic is no text: {error}") from error
    body = decode(frames[1], MESSAGE_LIMITS)
    if body.get("v") != PROTOCOL_VERSION:
        raise MessageError("unsupported_version", f"{body.get('v')!r}; this client reads {PROTOCOL_VERSION}", "v")
    for field, kind in HEADER.items():
        if type(body.get(field)) is not kind:
            raise MessageError("bad_type", f"{kind.__name__} expected, this is {body.get(field)!r}", field)
    return topic, body
