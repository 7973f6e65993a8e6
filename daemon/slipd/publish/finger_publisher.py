"""What one finger says on the bus, and how often."""

from __future__ import annotations

from typing import cast

from slipd.config import Rates
from slipd.events import Output
from slipd.finger.finger import Finger
from slipd.finger.finger_state import FingerState, ForceReading
from slipd.finger.image_channel import STALE
from slipd.finger.verdict import SEVERITY
from slipd.finger.verdict_batch import VerdictBatch
from slipd.publish.message_bodies import number, slip_body, tactile_body, verdict_body, wrench_body
from slipd.publish.message_sequencer import MessageSequencer, Pace
from slipd_client.messages import LEVELS, WARNING_TOPIC, Level, slip_topic, tactile_topic, wrench_topic


class FingerPublisher:
    """Tells a change of level at once, the rest as often as is configured.

    Args:
        finger: Whose words these are.
        outlet: Numbers and dates the messages.
        rates: ``[rates]``.
    """

    def __init__(self, finger: Finger, sequencer: MessageSequencer, rates: Rates) -> None:
        self._finger = finger
        self._sequencer = sequencer
        self._frame = f"{finger.name}_pad"
        self._wrench_topic = wrench_topic(finger.name)
        self._told: Level = "unknown"
        self._slip, self._wrench = Pace(rates.slip_hz), Pace(rates.wrench_hz)
        self._tactile = Pace(rates.tactile_hz)
        self._image_reasons = STALE

    def tell(self, state: FingerState, out: list[Output]) -> None:
        """Adds what is to be said of a new state."""
        t_ns, topic = state.t_ns, self._finger.name
        changed = state.verdict.level != self._told
        if changed:
            self._warn(state, out)
        if self._slip.passes(t_ns, now=changed):
            out.append(self._sequencer.message(slip_topic(topic), t_ns, self._frame, slip_body(self._finger, state)))
        if self._wrench.passes(t_ns, now=changed):
            self._tell_wrench(t_ns, state.force_reading, out)

    def tell_read(self, judged: VerdictBatch, out: list[Output]) -> None:
        """Adds what is to be said of the readings of one read."""
        slip, wrench, times_ns = self._slip, self._wrench, judged.readings.times_ns
        for at, level in enumerate(judged.levels):
            t_ns = times_ns[at]
            if t_ns >= slip.due_ns or LEVELS[level] != self._told:
                self.tell(judged[at], out)
            elif wrench.passes(t_ns):
                self._tell_wrench(t_ns, judged.force_reading(at), out)

    def tell_image(self, t_ns: int, out: list[Output]) -> None:
        """Add the message of a new image, or of one that is too old; at once where it became usable or unusable."""
        finger, image = self._finger, self._finger.image
        if image is None:
            return
        changed = image.reasons != self._image_reasons
        self._image_reasons = image.reasons
        if self._tactile.passes(t_ns, now=changed):
            body = tactile_body(finger, image)
            out.append(self._sequencer.message(tactile_topic(finger.name), t_ns, self._frame, body))

    def _tell_wrench(self, t_ns: int, felt: ForceReading, out: list[Output]) -> None:
        body = wrench_body(self._finger, felt)
        out.append(self._sequencer.message(self._wrench_topic, t_ns, self._frame, body))

    def _warn(self, state: FingerState, out: list[Output]) -> None:
        level, told = cast("Level", state.verdict.level), self._told
        self._told = level
        change = {"previous": told, "rising": SEVERITY[level] > SEVERITY[told]}
        used = None if state.utilisation is None else number(state.utilisation.value)
        body = verdict_body(self._finger, state) | change | {"utilisation": used}
        out.append(self._sequencer.message(WARNING_TOPIC, state.t_ns, self._frame, body))
