"""Tares of one finger: those of its force sensor and its pad are requested, read and undone separately."""

from __future__ import annotations

from dataclasses import dataclass

from slipd.finger.finger import Finger
from slipd.finger.force_channel import ForceChannel
from slipd.finger.image_channel import ImageChannel
from slipd.refusal import Refusal

STREAMS = ("wrench", "pad")


@dataclass(frozen=True)
class Tares:
    """The streams of a finger that one request is about.

    Attributes:
        finger: The finger.
        channels: The channel of each stream, by its kind, "wrench" or "pad".
    """

    finger: Finger
    channels: dict[str, ForceChannel | ImageChannel]

    @classmethod
    def of(cls, finger: Finger, stream: str | None) -> Tares | Refusal:
        """Find the streams that a request names.

        Args:
            finger: The finger.
            stream: "wrench", "pad", or "all"; None: what measures the force, which is the pad where there is no force
                sensor.
        """
        has = {kind: channel for kind in STREAMS if (channel := finger.channel(kind)) is not None}
        if stream == "all":
            return cls(finger, has)
        kind = next(iter(has)) if stream is None else stream
        if kind not in has:
            return Refusal("not_ready", f"finger {finger.name} has no {kind}, only a {next(iter(has))}", "stream")
        return cls(finger, {kind: has[kind]})

    def refuse(self, t_ns: int, *, unloaded: bool) -> Refusal | None:
        """Return why these streams cannot be tared now; None if they can.

        Args:
            t_ns: Now.
            unloaded: The client states that nothing touches the finger, although its normal force is clearly negative.
        """
        name = self.finger.name
        for kind in self.channels:
            if not self.finger.is_fresh(kind, t_ns):
                return Refusal("not_ready", f"finger {name} has no fresh {kind} readings to average", "finger")
        if self.finger.is_pressed_without(self.channels) is True:
            return Refusal("in_contact", f"finger {name} is in contact: a tare would erase its load", "finger")
        if self.finger.is_pulled and self.finger.main_stream in self.channels and not unloaded:
            message = (
                f"the normal force of finger {name} is negative, as if the pad were pulled: status says what to"
                " check; if this is the bias of an unloaded sensor, send unloaded: true"
            )
            return Refusal("not_ready", message, "finger")
        return None

    @property
    def verified(self) -> bool:
        """The finger is known to be untouched, by all but the zeros that these streams are about to get."""
        return self.finger.is_pressed_without(self.channels) is False

    @property
    def busy(self) -> bool:
        """Whether a tare of one of them is in progress."""
        return any(channel.tare.busy for channel in self.channels.values())

    def begin(self, t_ns: int, seconds: float, by: str, *, unloaded: bool) -> None:
        """Start to average; ``unloaded`` as in `refuse`."""
        for kind in self.channels:
            self.finger.begin_tare(t_ns, seconds, by, kind, unloaded=unloaded)

    def undo(self) -> Refusal | None:
        """Restore the offset before the last tare of the one stream; refused where there is none."""
        [kind] = self.channels
        if self.finger.undo_tare(kind):
            return None
        message = f"the {kind} of finger {self.finger.name} has no earlier tare to go back to"
        return Refusal("not_ready", message, "finger")
