"""When the messages about one finger are published."""

from __future__ import annotations

from typing import cast

from slipd.config import Rates
from slipd.events import Output
from slipd.finger.finger import Finger
from slipd.finger.finger_state import FingerState, ForceReading, VerdictBatch
from slipd.finger.image_channel import STALE
from slipd.publish.finger_messages import slip_body, tactile_body, warning_body, wrench_body
from slipd.publish.message_sequencer import MessageSequencer, Pace
from slipd_client.messages import LEVELS, WARNING_TOPIC, Level, slip_topic, tactile_topic, wrench_topic


class FingerPublisher:
    """Publish a change of level at once, and all else at the configured rates.

    Args:
        finger: The finger.
        sequencer: Numbers and dates the messages.
        rates: ``[rates]``.

    Attributes:
        level: Level that was published last.
    """

    def __init__(self, finger: Finger, sequencer: MessageSequencer, rates: Rates) -> None:
        self._finger = finger
        self._sequencer = sequencer
        self._frame = f"{finger.name}_pad"
        self._slip_topic, self._wrench_topic = slip_topic(finger.name), wrench_topic(finger.name)
        self._tactile_topic = tactile_topic(finger.name)
        self.level: Level = "unknown"
        self._slip, self._wrench = Pace(rates.slip_hz), Pace(rates.wrench_hz)
        self._tactile = Pace(rates.tactile_hz)
        self._image_reasons = STALE

    def publish_state(self, state: FingerState, out: list[Output]) -> None:
        """Append the messages about a new state of the finger."""
        t_ns = state.t_ns
        changed = state.verdict.level != self.level
        if changed:
            self._publish_warning(state, out)
        if self._slip.passes(t_ns, now=changed):
            out.append(self._sequencer.message(self._slip_topic, t_ns, self._frame, slip_body(self._finger, state)))
        if self._wrench.passes(t_ns, now=changed):
            self._publish_wrench(t_ns, state.force_reading, out)

    def publish_batch(self, batch: VerdictBatch, out: list[Output]) -> None:
        """Append the messages about the readings of one read: the same as about each of their states."""
        slip, wrench, times_ns = self._slip, self._wrench, batch.readings.times_ns
        for at, level in enumerate(batch.levels):
            t_ns = times_ns[at]
            if t_ns >= slip.due_ns or LEVELS[level] != self.level:
                self.publish_state(batch[at], out)
            elif t_ns >= wrench.due_ns:
                wrench.passes(t_ns)
                self._publish_wrench(t_ns, batch.force_reading(at), out)

    def publish_image(self, t_ns: int, out: list[Output]) -> None:
        """Append the message about the newest image; at once where the image became usable or unusable."""
        finger, image = self._finger, self._finger.image
        if image is None:
            return
        changed = image.reasons != self._image_reasons
        self._image_reasons = image.reasons
        if self._tactile.passes(t_ns, now=changed):
            body = tactile_body(finger, image)
            out.append(self._sequencer.message(self._tactile_topic, t_ns, self._frame, body))

    def _publish_wrench(self, t_ns: int, reading: ForceReading, out: list[Output]) -> None:
        body = wrench_body(self._finger, reading)
        out.append(self._sequencer.message(self._wrench_topic, t_ns, self._frame, body))

    def _publish_warning(self, state: FingerState, out: list[Output]) -> None:
        previous, self.level = self.level, cast("Level", state.verdict.level)
        body = warning_body(self._finger, state, previous)
        out.append(self._sequencer.message(WARNING_TOPIC, state.t_ns, self._frame, body))
