"""Tares of one finger: those that a client requests, and the guard that gives up one that would be wrong.

A tare averages the force sensor, the pad, or both; each has an offset of its own. The guard gives up a tare that would
take a load for zero, or that lost its stream.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from slipd.finger.force_channel import ForceChannel
from slipd.finger.image_channel import ImageChannel
from slipd.types.permit import Refusal, RefusalError

if TYPE_CHECKING:
    from slipd.finger.finger import Finger

LONGEST_GAP_NS = 500_000_000
"""Longest silence of its stream that a tare survives; during a longer one a contact may have come and gone."""


@dataclass(frozen=True)
class Tares:
    """Streams of a finger that one request names.

    Attributes:
        finger: The finger.
        channels: Channel of each stream, by "wrench" or "pad".
    """

    finger: Finger
    channels: dict[str, ForceChannel | ImageChannel]

    @classmethod
    def of(cls, finger: Finger, stream: str | None) -> Tares:
        """Find the streams of a request.

        Args:
            finger: The finger.
            stream: "wrench", "pad" or "all"; None: the stream that measures the force.

        Raises:
            RefusalError: The finger does not have it.
        """
        channels = finger.channels
        if stream == "all":
            return cls(finger, channels)
        name = finger.main_stream if stream is None else stream
        if name not in channels:
            rule = f"finger {finger.name} has no {name}, only a {finger.main_stream}"
            raise RefusalError("not_ready", rule, "stream")
        return cls(finger, {name: channels[name]})

    def refuse(self, t_ns: int, *, unloaded: bool) -> Refusal | None:
        """Return why these streams cannot be tared at ``t_ns``; None where they can.

        Args:
            t_ns: Now, CLOCK_MONOTONIC.
            unloaded: The client states that nothing touches the finger, even if its normal force is clearly negative.
        """
        name = self.finger.name
        for stream in self.channels:
            if not self.finger.is_fresh(stream, t_ns):
                return Refusal("not_ready", f"finger {name} has no fresh {stream} readings to average", "finger")
        if self.finger.presence.is_pressed_without(self.channels) is True:
            message = f"finger {name} is in contact: a tare would erase its load"
            if self.finger.force is not None and not self.finger.presence.is_pressed_by_force():
                message += "; only its pad shows this: if nothing touches it, tare the pad, or raise its threshold"
            return Refusal("in_contact", message, "finger")
        if self.finger.presence.is_pulled() and self.finger.main_stream in self.channels and not unloaded:
            message = (
                f"the normal force of finger {name} is negative, as if the pad were pulled: status says what to"
                " check; if this is the bias of an unloaded sensor, send unloaded: true"
            )
            return Refusal("not_ready", message, "finger")
        return None

    @property
    def verified(self) -> bool:
        """Nothing touches the finger, as known without the streams that are to be tared."""
        return self.finger.presence.is_pressed_without(self.channels) is False

    @property
    def busy(self) -> bool:
        """A tare of one of them is in progress."""
        return any(channel.tare.busy for channel in self.channels.values())

    def begin(self, t_ns: int, seconds: float, by: str, *, unloaded: bool) -> None:
        """Begin to average the readings of each; see `Finger.begin_tare`."""
        for stream in self.channels:
            self.finger.begin_tare(t_ns, seconds, by, stream, unloaded=unloaded)

    def undo(self) -> Refusal | None:
        """Restore the offset before the last tare of the only stream; refuse where there is none."""
        [(stream, channel)] = self.channels.items()
        if channel.tare.undo():
            return None
        message = f"the {stream} of finger {self.finger.name} has no earlier tare to go back to"
        return Refusal("not_ready", message, "finger")


class TareGuard:
    """Watches the tares of one finger while they are measured.

    Args:
        finger: The finger.

    Attributes:
        unloaded: The client that began the last tare states that nothing touches the finger, even if the normal force
            is clearly negative.
    """

    def __init__(self, finger: Finger) -> None:
        self._finger = finger
        self.unloaded = False

    def check_silence(self, t_ns: int, unread_ns: int | None) -> None:
        """Give up tares whose stream fell silent; arguments as of `Freshness.silent_ns`."""
        for channel in self._finger.channels.values():
            if channel.tare.busy and channel.freshness.silent_ns(t_ns, unread_ns) > LONGEST_GAP_NS:
                channel.tare.abort("silent")

    def quiet_until_ns(self) -> int:
        """Return until when `check_silence` gives up none of the tares in progress, of which there is at least one."""
        came_ns = [channel.freshness.came_ns for channel in self._finger.channels.values() if channel.tare.busy]
        return min(each or 0 for each in came_ns) + LONGEST_GAP_NS

    def check_load(self) -> None:
        """Give up tares that the load of the newest force reading would spoil."""
        main, image, presence = self._finger.tare, self._finger.image, self._finger.presence
        if main.busy and presence.is_pressed():
            main.abort("contact")
        elif main.busy and presence.is_pulled() and not self.unloaded:
            main.abort("pulled")
        if image is not None and image.tare.busy and presence.is_pressed_by_force():
            image.tare.abort("contact")
