"""Run a recording through the engine of the live run.

The engine gets the recorded config, boot and wall offset, and every event with the time at which it entered; it has no
other clock. So a replay publishes the messages of the live run, byte for byte.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

from slipd.config import Config
from slipd.engine.engine import Engine
from slipd.errors import RecordingError
from slipd.events import Bytes, LinkDown, LinkUp, Publish
from slipd.recording.reader import Recording


class PlaybackPace:
    """Let recorded time pass like real time, or faster by a factor.

    Args:
        speed: Recorded seconds per second, above 0.
        sleep: Waits for a number of seconds.
        now_ns: The clock that runs during ``sleep``, ns.
    """

    def __init__(
        self,
        speed: float,
        sleep: Callable[[float], None] = time.sleep,
        now_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self._speed = speed
        self._sleep = sleep
        self._now_ns = now_ns
        self._recorded_minus_passed_ns: float | None = None

    def wait_until(self, t_ns: int) -> None:
        """Wait until the recorded time ``t_ns``; the first call only starts the clock."""
        passed_ns = self._now_ns() * self._speed
        if self._recorded_minus_passed_ns is None:
            self._recorded_minus_passed_ns = t_ns - passed_ns
        ahead_ns = t_ns - self._recorded_minus_passed_ns - passed_ns
        if ahead_ns > 0:
            self._sleep(ahead_ns / self._speed / 1e9)


def replay(
    recording: Recording, settings: Config | None = None, on_event: Callable[[int], object] = lambda _: None
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield ``(topic, body)`` of every message that the recorded events cause, in order.

    Writes to devices and replies to clients are discarded. Check ``recording.complete`` afterwards: after a gap in the
    events, the messages are not those of the live run.

    Args:
        recording: The recording.
        settings: Another config than the recorded one, with the same streams; None: the recorded one.
        on_event: Called with the time of each event, ns, before it enters the engine, such as
            `PlaybackPace.wait_until`.

    Raises:
        ConfigError: The recorded config has faults (for this version of slipd).
        RecordingError: The file can no longer be opened, or its events do not fit its config.
    """
    return ((topic, body) for _, topic, body in replay_dated(recording, settings, on_event))


def replay_dated(
    recording: Recording, settings: Config | None = None, on_event: Callable[[int], object] = lambda _: None
) -> Iterator[tuple[int, str, dict[str, Any]]]:
    """Yield ``(t_ns, topic, body)`` of every message; arguments and errors are those of `replay`.

    ``t_ns`` is when the message was published, CLOCK_MONOTONIC of the recorded run.
    """
    if settings is None:
        settings = recording.settings()
    engine = Engine(settings, boot=recording.boot, wall_minus_monotonic_ns=recording.wall_minus_monotonic_ns)
    return _run(engine, recording, on_event)


def _run(
    engine: Engine, recording: Recording, on_event: Callable[[int], object]
) -> Iterator[tuple[int, str, dict[str, Any]]]:
    links = engine.links
    for t_ns, event in recording.events():
        if isinstance(event, (Bytes, LinkUp, LinkDown)) and event.link not in links:
            known = ", ".join(sorted(links)) or "none"
            raise RecordingError(
                f"{recording.path}: the config must have the link {event.link!r} of an event, got {known}"
            )
        on_event(t_ns)
        for output in engine.handle(event, t_ns):
            if isinstance(output, Publish):
                yield t_ns, output.topic, output.body
