"""One finger of the gripper: samples in, verdicts out, and its state for the other rooms."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from typing import cast

from slipd.config import Finger as FingerConfig
from slipd.config import Levels, Stream, in_newtons, stale_after_ns
from slipd.finger.contact_motion import ContactMotion
from slipd.finger.delayed_reads import DelayedRead, DelayedReads
from slipd.finger.finger_state import FingerState
from slipd.finger.force_channel import ForceChannel
from slipd.finger.freshness import PROMPT, Arrival, Freshness
from slipd.finger.friction import Friction
from slipd.finger.image_channel import ImageChannel
from slipd.finger.stream_health import Condition, force_conditions, image_conditions
from slipd.finger.trust import RaiseTrust, is_trusted
from slipd.finger.verdict import PAD_PULLED
from slipd.finger.verdict_batch import VerdictBatch
from slipd.finger.verdict_path import VerdictPath
from slipd.friction.friction_state import FrictionState
from slipd.types.samples import TactileSample, WrenchSample
from slipd_client.messages import Health


class Finger:
    """A force sensor with a pad in front of it, one of both, or a pad of three-axis taxels.

    Force readings come through `decide`, images through `update_image`, the passing of time through `check_silence`.

    Args:
        name: Name of the finger.
        config: ``[finger.X]``.
        levels: ``[levels]``.

    Attributes:
        name: Name of the finger.
        config: ``[finger.X]``.
        force: The force sensor; None where the pad measures the force.
        image: The pad; None where there is none.
        tare: Tare of the stream that measures the force.
        in_newtons: Forces are in newtons, not in the unit of a pad without calibration.
        image_in_newtons: Likewise the loads of the image.

    Raises:
        ValueError: The config has neither a force sensor nor a pad.
    """

    def __init__(self, name: str, config: FingerConfig, levels: Levels) -> None:
        self.name = name
        self.config = config
        self.force = ForceChannel(config.wrench, stale_after_ns(config.wrench)) if config.wrench is not None else None
        self.image = ImageChannel(config.pad, config) if config.pad is not None else None
        self.image_in_newtons = config.pad is not None and in_newtons(config.pad)
        self.in_newtons = config.wrench is not None or self.image_in_newtons
        self.tare = self._existing_channel(None).tare
        stream = cast("Stream", config.wrench or config.pad)
        self._freshness = Freshness(stale_after_ns(stream))
        self._delayed = DelayedReads(self.image)
        self._path = VerdictPath(config, levels, self.force, self.image, self.tare, self._freshness)
        self._trust = RaiseTrust(stream, config.pad, self.force, self.image, self._freshness)

    def decide(
        self, samples: Sequence[WrenchSample], times_ns: Sequence[int], arrival: Arrival = PROMPT
    ) -> Iterator[VerdictBatch]:
        """Yield the verdicts on the force readings of one read.

        Readings that waited for the daemon may first wait for the image of their time; see `decide_delayed`.

        Args:
            samples: The readings, received together.
            times_ns: When each was acquired, CLOCK_MONOTONIC.
            arrival: How they reached the daemon.

        Raises:
            ValueError: The finger has no force sensor.
        """
        if self.force is None:
            raise ValueError(f"finger {self.name} has no force sensor")
        if arrival.waited_ns or self._delayed:
            self._delayed.add(DelayedRead(samples, times_ns, arrival))
            return self.decide_delayed(samples[-1].t_ns, arrival.unread_ns)
        return self._path.decide(self.force, samples, times_ns, arrival)

    def decide_delayed(self, t_ns: int, unread_ns: int | None = None) -> Iterator[VerdictBatch]:
        """Yield the verdicts on the force readings that need not wait for an image any more.

        Args:
            t_ns: Now.
            unread_ns: How long the image's line counts as unread; None: it is empty.
        """
        if self.force is not None and self._delayed:
            for samples, times_ns, arrival in self._delayed.release(t_ns, unread_ns):
                yield from self._path.decide(self.force, samples, times_ns, arrival, t_ns)

    def update_image(
        self, sample: TactileSample, acquired_ns: int | None = None, arrival: Arrival = PROMPT
    ) -> VerdictBatch | None:
        """Update with an image.

        Args:
            sample: The image, of as many taxels as the pad has.
            acquired_ns: When it was acquired, CLOCK_MONOTONIC; None: when it was received.
            arrival: How it reached the daemon.

        Returns:
            The verdict where three-axis taxels are what measures the force; else None.
        """
        return None if self.image is None else self._path.update_image(self.image, sample, acquired_ns, arrival)

    def check_silence(self, t_ns: int, unread_ns: int | None = None) -> FingerState | None:
        """Update the verdict if a stream that it depends on fell silent.

        Args:
            t_ns: Now.
            unread_ns: How long lines count as unread, which is no silence of a stream; None: they are empty.

        Returns:
            The new state; None where nothing changed.
        """
        return self._path.check_silence(t_ns, unread_ns)

    def note_motion(self, until_ns: int, kinds: tuple[str, ...]) -> FingerState | None:
        """Report slip until a time, because evidence of these kinds shows it; see `VerdictPath.note_motion`."""
        return self._path.note_motion(until_ns, kinds)

    @property
    def motion(self) -> ContactMotion | None:
        """Evidence of motion beside the load; None where the pad measures the force."""
        return self._path.motion

    def expire_image(self, t_ns: int, unread_ns: int | None = None) -> bool:
        """Return whether the newest image just became too old, see `check_silence`; True once for each image."""
        return self.image is not None and self.image.expire(t_ns, unread_ns)

    def disconnect(self, t_ns: int) -> FingerState:
        """Return the state at ``t_ns`` without the force stream, which ended; its tare would average across the gap."""
        self.tare.abort("ended")
        self._delayed.clear()
        return self._path.lose_force(t_ns)

    def disconnect_image(self) -> None:
        """Forget the image: its stream ended."""
        self._path.forget_comparison()
        if self.image is not None:
            self.image.tare.abort("ended")
            self.image.forget()

    @property
    def state(self) -> FingerState:
        """State after the newest force reading."""
        return self._path.state

    @property
    def level(self) -> str:
        """Level after the newest force reading, without the work of a whole state."""
        return self._path.newest.level

    @property
    def main_channel(self) -> ForceChannel | ImageChannel:
        """The channel that measures the force."""
        return self._existing_channel(None)

    @property
    def main_stream(self) -> str:
        """The stream that measures the force: "wrench" or "pad"."""
        return "pad" if self.force is None else "wrench"

    def channel(self, stream: str) -> ForceChannel | ImageChannel | None:
        """Return the channel of the stream "wrench" or "pad"; None where the finger has none."""
        return self.force if stream == "wrench" else self.image

    def age_s(self, t_ns: int) -> float | None:
        """Return the age of the newest force reading at ``t_ns``, s; None before the first."""
        return self._freshness.age_s(t_ns)

    def is_fresh(self, stream: str, t_ns: int) -> bool:
        """Return whether readings of the stream "wrench" or "pad" came lately."""
        if stream == "wrench" or self.force is None:
            return not self._path.newest.is_stale
        return self.image is not None and self.image.is_fresh(t_ns, None)

    def conditions(self, stream: str, t_ns: int) -> list[Condition]:
        """Return what people should know of the readings of the stream "wrench" or "pad" at ``t_ns``.

        Raises:
            ValueError: The finger has no such stream.
        """
        channel = self._existing_channel(stream)
        found = force_conditions(channel, t_ns) if isinstance(channel, ForceChannel) else image_conditions(channel)
        state, presence = self.state, self._path.presence
        if state.verdict is PAD_PULLED and stream == self.main_stream:
            normal_n = math.nan if state.wrench is None else -state.wrench[2]
            shown = presence.shown_by_image()
            found.append(
                (Health.ERROR, self._path.negative_force.advice(normal_n, tared=presence.zero_known, pressed=shown))
            )
        return found

    def is_pressed(self) -> bool | None:
        """Return whether something presses on the pad; None: unknown."""
        return self._path.presence.is_pressed(self.state)

    def is_pressed_without(self, streams: Collection[str]) -> bool | None:
        """Return whether something presses, without the streams that are about to be tared; None: unknown."""
        return self._path.presence.is_pressed_without(streams, self.state)

    @property
    def is_pulled(self) -> bool:
        """The normal force is clearly negative: the sensor or its config is wrong."""
        return self._path.presence.is_pulled(self.state)

    def contact_force_n(self, t_ns: int) -> float | None:
        """Return the normal force of a contact at ``t_ns``, N; None without contact, or where the force is not trusted.

        An image alone does not count: its noise or drift may look like a contact.
        """
        contact = self.state.contact
        if contact is None or not (self._path.presence.zero_known and self._path.estimator.in_contact):
            return None
        return contact.normal_n if self.is_trusted_at_rest(t_ns) else None

    @property
    def is_trusted(self) -> bool:
        """The newest force reading is fresh, and its sensor shows no fault."""
        return is_trusted(self.state.verdict)

    def is_trusted_for_raise(self, t_ns: int) -> bool:
        """Return whether a grip may be raised at ``t_ns``: readings and images are fresh, usable and trusted.

        A stall of the daemon excuses nothing: a reading that it has not read, or reads late, may show something else.
        Nor is a repeated reading of a sensor whose readings may rest enough: one that hangs looks the same.
        """
        return self._trust.allows(self.state.verdict, t_ns, at_rest=False)

    def is_trusted_at_rest(self, t_ns: int) -> bool:
        """Return whether readings are trusted as in `is_trusted_for_raise`, or repeat as the config allows.

        This is enough to open the gripper: at rest the readings of some sensors always repeat.
        """
        return self._trust.allows(self.state.verdict, t_ns, at_rest=True)

    @property
    def friction(self) -> Friction:
        """Coefficients of friction in use, and who set them."""
        return self._path.estimator.friction

    @property
    def friction_state(self) -> FrictionState:
        """What is known of the friction now; that of one reading is in its `FingerState`."""
        return self.friction.state

    def set_object(self, name: str | None) -> None:
        """Name the object in the grip, or the next one, so that what is learned of it is kept; None: it has no name."""
        self.friction.estimate.set_object(name)

    def set_friction(self, mu_s: float, mu_d: float | None, by: str = "", t_ns: int | None = None) -> None:
        """Use the coefficients of friction that client ``by`` states at ``t_ns``; see `Friction.set`."""
        self._path.estimator.set_friction(mu_s, mu_d, by, t_ns)

    def begin_tare(
        self, t_ns: int, seconds: float, by: str, stream: str | None = None, *, unloaded: bool = False
    ) -> None:
        """Begin to average unloaded readings.

        Args:
            t_ns: Now.
            seconds: Duration, s.
            by: The client that asks for it.
            stream: "wrench" or "pad"; None: the one that measures the force.
            unloaded: The client states that nothing touches the finger, even if the normal force is clearly negative.

        Raises:
            ValueError: The finger has no such stream.
        """
        channel = self._existing_channel(stream)
        self._path.tares.unloaded = unloaded
        channel.begin_tare(t_ns, seconds, by)

    def undo_tare(self, stream: str | None = None) -> bool:
        """Restore the offset before the last tare of a stream, see `begin_tare`; return False where there is none."""
        return self._existing_channel(stream).undo_tare()

    def _existing_channel(self, stream: str | None) -> ForceChannel | ImageChannel:
        channel = self.force or self.image if stream is None else self.channel(stream)
        if channel is None:
            raise ValueError(f"finger {self.name} has no {stream or 'stream'}")
        return channel
