"""Messages about the daemon: its fingers, streams, lease, gripper and recordings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np

from slipd import __version__
from slipd.errors import one_line, printable
from slipd.events import Body, HostNotice, IncidentsChanged, Output, RecordingChanged
from slipd.finger.finger import Finger
from slipd.finger.force_channel import ForceChannel
from slipd.finger.image_channel import ImageChannel
from slipd.gripper.gripper_control import GripperControl
from slipd.links.device_link import DeviceLink
from slipd.links.stream_meter import StreamMeter
from slipd.publish.finger_messages import friction_setter_body, tare_body
from slipd.publish.grasp_messages import gripper_body, lease_body
from slipd.publish.message_sequencer import NO_FRAME, MessageSequencer, Pace
from slipd.publish.stream_health import Condition, finger_conditions, link_condition
from slipd.rig import GRIPPER_LINK, Rig
from slipd.types.arrays import finite_or_none
from slipd_client.messages import STATUS_TOPIC, Health


class Recordings(Protocol):
    """The recordings that ``status`` reports.

    Attributes:
        requested: The newest one on request; its state is "none" before the first.
        whole_run: State of the recording of the whole run; None if there is no such recording.
    """

    requested: RecordingChanged
    whole_run: RecordingChanged | None


class StatusPublisher:
    """Publish the state of the daemon.

    Args:
        rig: The rig of this run.
        recordings: The recordings of this run.
        not_restored: Why tares of the run before are not used, by stream.
        sequencer: Numbers and dates the messages.
    """

    def __init__(
        self,
        rig: Rig,
        recordings: Recordings,
        not_restored: Mapping[str, str],
        sequencer: MessageSequencer,
    ) -> None:
        self._rig = rig
        self._streams = [(link, stream) for link in rig.links.values() for stream in link.streams.values()]
        self._recordings, self._not_restored = recordings, not_restored
        self._sequencer, self._pace = sequencer, Pace(rig.config.rates.status_hz)
        self._notices: dict[str, str] = {}
        self._incidents: IncidentsChanged | None = None

    def note(self, event: HostNotice | IncidentsChanged) -> None:
        """Keep what the host reports; a notice with the text "" ends that of its topic."""
        if isinstance(event, IncidentsChanged):
            self._incidents = event
            return
        self._notices.pop(event.topic, None)
        if event.text:
            self._notices[event.topic] = event.text

    def publish(self, t_ns: int, out: list[Output]) -> None:
        """Append the state at ``t_ns``, due or not: something changed."""
        out.append(self._sequencer.message(STATUS_TOPIC, t_ns, NO_FRAME, self.body(t_ns)))

    def publish_due(self, t_ns: int, out: list[Output]) -> int:
        """Append the state at ``t_ns`` where it is due; return when the next one is."""
        if self._pace.passes(t_ns):
            self.publish(t_ns, out)
        return self._pace.due_ns

    def body(self, t_ns: int) -> Body:
        """Return ``status``: the state at ``t_ns``; also the result of the request of that name."""
        recordings = self._recordings
        gripper, lateness, named = self._rig.gripper, self._rig.lateness, self._rig.named
        return {
            "version": __version__,
            "uptime_s": (t_ns - (lateness.first_ns or t_ns)) * 1e-9,
            "fingers": {name: _finger_body(finger) for name, finger in self._rig.fingers.items()},
            "object_name": named.name,
            "object_by": named.set_by,
            "object_t_ns": named.set_t_ns,
            "streams": {stream.name: self._stream_body(link, stream, t_ns) for link, stream in self._streams},
            "publisher": {"messages": self._sequencer.published},
            "late_s": lateness.worst_ns(t_ns) * 1e-9,
            "lease": lease_body(gripper.policy.lease, t_ns),
            "gripper": gripper_body(gripper, t_ns) if isinstance(gripper, GripperControl) else None,
            "recording": _recording_body(recordings.requested),
            "run_recording": None if recordings.whole_run is None else _recording_body(recordings.whole_run),
            **({} if self._incidents is None else {"incidents": _incidents_body(self._incidents)}),
            "notices": {topic: one_line(text) for topic, text in self._notices.items()},
        }

    def _stream_body(self, link: DeviceLink, stream: StreamMeter, t_ns: int) -> Body:
        counters, clock = link.counters, stream.clock
        worst_first = sorted(self._conditions(link, stream, t_ns), key=lambda condition: -condition[0])
        return {
            "health": int(worst_first[0][0]),
            "message": one_line("; ".join(text for _, text in worst_first if text)),
            "hardware_id": one_line(link.guard.reported or link.guard.opened) or None,
            "address": one_line(link.spec.address),
            "state": None if link.session is None else one_line(link.session.state),
            "expected_hz": stream.expected_hz,
            "rate_hz": finite_or_none(stream.rate_hz),
            "age_s": None if stream.last_ns is None else (t_ns - stream.last_ns) * 1e-9,
            "samples": stream.count,
            "clock": "host" if stream.host_clock else clock.state,
            "clock_uncertainty_s": None if clock.uncertainty_ns is None else clock.uncertainty_ns * 1e-9,
            "clock_drift_ppm": finite_or_none(clock.drift_ppm),
            "good": counters.good,
            "bad": counters.bad,
            "lost": counters.lost,
            "duplicates": counters.duplicates,
            "restarts": counters.restarts,
            "bad_bytes": counters.bad_bytes,
            "dropped": link.flood.dropped,
            "reconnects": link.reconnects,
            **_channel_body(self._rig.channels.get(stream.name), t_ns),
        }

    def _conditions(self, link: DeviceLink, stream: StreamMeter, t_ns: int) -> list[Condition]:
        """Return everything that is wrong with a stream, or worth a hint; at least one."""
        rig, lateness = self._rig, self._rig.lateness
        found = [link_condition(link, stream, t_ns, lateness.unread_ns(t_ns), lateness.worst_ns(t_ns))]
        owner, _, kind = stream.name.partition(".")
        if kind:
            found += finger_conditions(rig.fingers[owner], kind, t_ns)
        elif isinstance(rig.gripper, GripperControl) and owner == GRIPPER_LINK:
            found += rig.gripper.conditions()
        elif owner == "arm" and rig.arm is not None:
            found += rig.arm.conditions()
        channel = self._rig.channels.get(stream.name)
        tared = channel is not None and channel.tare.current.origin == "measured"
        if not tared and (problem := self._not_restored.get(stream.name)):
            found.append((Health.OK, problem))
        return found


def _finger_body(finger: Finger) -> Body:
    return {
        "level": finger.state.verdict.level,
        "reasons": list(finger.state.verdict.reasons),
        "evidence": list(finger.state.evidence),
        "tare_id": finger.tare.current.id,
        "tare_busy": finger.tare.busy,
        **friction_setter_body(finger),
    }


def _channel_body(channel: ForceChannel | ImageChannel | None, t_ns: int) -> Body:
    """Return the state of a channel's tare and conditioning."""
    if channel is None:
        return {}
    tare: Body = {"tare_id": channel.tare.current.id, **tare_body(channel, t_ns), "tare_busy": channel.tare.busy}
    if isinstance(channel, ForceChannel):
        drift = channel.drift
        return tare | {
            "gravity": channel.gravity.state(t_ns),
            "drift": None if drift is None else drift.value.tolist(),
            "drift_frozen": None if drift is None else drift.frozen,
        }
    health = channel.taxel_health
    return tare | {
        "masked": np.flatnonzero(health.masked).tolist(),
        "taxel_faults": {kind: places for kind, places in health.report().items() if places},
    }


def _recording_body(recording: RecordingChanged) -> Body:
    return {
        "name": recording.name or None,
        "path": printable(recording.path) or None,  # the name of a folder may be no UTF-8
        "state": recording.state,
        "running": recording.state == "running",
        "failure": printable(recording.reason) or None,
        "lost": recording.lost,
    }


def _incidents_body(incidents: IncidentsChanged) -> Body:
    return {
        "saved": incidents.saved,
        "not_saved": incidents.failed,
        "lost": incidents.lost,
        "dropped": incidents.dropped,
        "path": printable(incidents.path) or None,
        "failure": printable(incidents.reason) or None,
    }
