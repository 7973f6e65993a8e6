"""Base class of the sessions with sensors: a decoder, a startup sequence, and a last request."""

from __future__ import annotations

from typing import Generic, Protocol, TypeVar

from slipd.devices.shared.decoder_health import DecoderHealth
from slipd.devices.shared.startup_sequence import StartupSequence
from slipd.types.samples import Sample

S = TypeVar("S", bound=Sample)


class _Decoder(Protocol[S]):
    health: DecoderHealth

    def receive(self, data: bytes, t_ns: int) -> list[S]: ...

    def forget(self) -> None: ...


class SensorSession(Generic[S]):
    """Run a startup sequence and return readings; the subclass interprets the answers.

    Args:
        decoder: Decoder of readings and answers.
        startup: The requests that start the readings.
        last_request: Bytes to send when the session ends.
    """

    def __init__(self, decoder: _Decoder[S], startup: StartupSequence, last_request: bytes = b"") -> None:
        self.decoder = decoder
        self.health = decoder.health
        self.identity = ""
        self._startup = startup
        self._last_request = last_request

    @property
    def state(self) -> str:
        """State of the startup, as a short text for people."""
        return self._startup.state

    def start(self, now_ns: int) -> bytes:
        """Begin on a freshly opened link; return the first request if it is due at once."""
        self.decoder.forget()
        self.identity = ""
        self._startup.start(now_ns)
        return self._startup.on_time(now_ns)

    def receive(self, data: bytes, now_ns: int) -> list[S]:
        """Decode bytes received at ``now_ns``; return the readings they complete, in every state."""
        samples = self.decoder.receive(data, now_ns)
        if self._startup.awaited:
            self._handle_answers(now_ns)
        if samples:
            self._startup.reading_received(now_ns)
        return samples

    def next_deadline(self) -> int | None:
        """Return when `on_time` is due, ns; None while closed."""
        return self._startup.due_ns

    def on_time(self, now_ns: int) -> bytes:
        """Return the request that is due at ``now_ns``; empty if none is."""
        return self._startup.on_time(now_ns)

    def stop(self) -> bytes:
        """End; return the request that stops the readings."""
        self._startup.stop()
        return self._last_request

    def _handle_answers(self, now_ns: int) -> None:
        """Look for the awaited answer among the bytes that the decoder received last."""
