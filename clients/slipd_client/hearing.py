"""What both subscribers know of the messages they have heard: gaps, restarts, silence. Knows no socket."""

from __future__ import annotations

import time
from collections.abc import Sequence

from slipd_client.errors import Silence, is_it_there
from slipd_client.messages import STATUS_TOPIC, MessageError
from slipd_client.messages.reader import read, typed_message
from slipd_client.messages.typed import Message

SILENCE_S = 3.0
"""The daemon says its ``status`` once a second: so long without a word, and it is gone or cut off."""


class Hearing:
    """Places each message among those before it.

    ``status`` is always listened to, as the daemon's sign of life where all else is quiet, but handed out only
    to who asked for it.

    Args:
        topics: Beginnings of the topics to hand out.
        silence_s: Without any message for so long, `stale` is true and `silent_at` has passed; None never.

    Attributes:
        bad: Messages dropped because they could not be read.
        bad_reason: Why the last of them could not be read.
        prefixes: Beginnings of the topics to subscribe to.

    Raises:
        ValueError: The topics are a text instead of a sequence of texts.
    """

    def __init__(self, topics: Sequence[str], silence_s: float | None) -> None:
        if isinstance(topics, str):
            raise ValueError(f'topics is a sequence of beginnings, e.g. ("{topics}",)')  # noqa: TRY004
        self.silence_s = silence_s
        self.bad = 0
        self.bad_reason = ""
        self._topics = tuple(topics)
        self.prefixes = self._topics if STATUS_TOPIC.startswith(self._topics) else (*self._topics, STATUS_TOPIC)
        self._boot = ""
        self._seq: dict[str, int] = {}
        self._heard_s: float | None = None
        self._restart_untold = False
        self._since_s = time.monotonic()

    @property
    def age_s(self) -> float | None:
        """Seconds since a message was last heard, of whatever topic; None before the first."""
        return None if self._heard_s is None else time.monotonic() - self._heard_s

    @property
    def stale(self) -> bool:
        """Nothing has been heard for ``silence_s``, or ever: what was last heard says nothing of now."""
        age_s = self.age_s
        return age_s is None or (self.silence_s is not None and age_s > self.silence_s)

    @property
    def silent_at(self) -> float | None:
        """When silence will have lasted too long, on ``time.monotonic``; None never."""
        return None if self.silence_s is None else max(self._since_s, self._heard_s or 0.0) + self.silence_s

    def silence(self, endpoint: str) -> Silence:
        """What to raise when it has; from now on it counts anew."""
        self._since_s = time.monotonic()
        unreadable = f"; {self.bad} could not be read, the last: {self.bad_reason}" if self.bad else ""
        return Silence(f"no message from {endpoint} for {self.silence_s} s{unreadable}. {is_it_there(endpoint)}")

    def take(self, frames: list[bytes]) -> Message | None:
        """The message in these frames; None for one that is unreadable, heard already, or not asked for."""
        try:
            topic, raw = read(frames)
            seq, boot = raw["seq"], raw["boot"]
            anew = self._boot not in ("", boot)
            last = seq - 1 if anew else self._seq.get(topic, seq - 1)
            if seq <= last:  # after a reconnection the daemon sends the last message of each topic again
                return None
            message = typed_message(topic, raw, missed=seq - last - 1, restarted=anew or self._restart_untold)
        except MessageError as error:
            self.bad += 1
            self.bad_reason = str(error)
            return None
        if anew:
            self._seq.clear()
        self._boot = boot
        self._seq[topic] = seq
        self._heard_s = time.monotonic()
        wanted = topic.startswith(self._topics)
        self._restart_untold = message.restarted and not wanted
        return message if wanted else None
