"""Messages about the daemon: its fingers, streams, lease, gripper and recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from slipd import __version__
from slipd.devices.shared.device_interface import DecoderHealth
from slipd.events import IncidentsChanged, Output, RecordingChanged
from slipd.finger.finger import Finger
from slipd.finger.force_channel import ForceChannel
from slipd.finger.image_channel import ImageChannel
from slipd.grasp.named_object import NamedObject
from slipd.gripper.grip_policy import GripPolicy
from slipd.gripper.gripper_control import GripperControl
from slipd.publish.finger_messages import tare_body
from slipd.publish.friction_messages import friction_setter_body
from slipd.publish.gripper_publisher import gripper_body, lease_body
from slipd.publish.message_sequencer import NO_FRAME, MessageSequencer
from slipd.publish.wire_values import Body
from slipd.types.device_text import one_line
from slipd.types.finite import finite_or_none
from slipd_client.messages import STATUS_TOPIC, Health


@dataclass(frozen=True, slots=True)
class StreamStatus:
    """State of one stream: of its line, its device, its readings and their times.

    Attributes:
        name: Name of the stream, e.g. ``left.wrench``.
        conditions: Everything that is wrong, or worth a hint; at least one.
        hardware_id: Identity that the device reports, else what was opened; "" before that.
        address: Port or server of the config.
        state: State of the conversation with the device; None for a device that sends unasked.
        expected_hz: Rate of the config.
        rate_hz: Measured rate; None: not known.
        age_s: Time since the newest reading was received, s; None before the first.
        samples: Number of readings.
        clock: Source of the times.
        clock_uncertainty_s: Bound of the error of the times, s; None: not known.
        clock_drift_ppm: How much too fast the device's clock runs; None: not known.
        counters: Counters of the decoder.
        dropped: Readings dropped because the device floods.
        reconnects: Times that the link came up again.
        channel: Conditioning of the readings; None for the gripper.
    """

    name: str
    conditions: Sequence[tuple[Health, str]]
    hardware_id: str
    address: str
    state: str | None
    expected_hz: float
    rate_hz: float | None
    age_s: float | None
    samples: int
    clock: str
    clock_uncertainty_s: float | None
    clock_drift_ppm: float | None
    counters: DecoderHealth
    dropped: int
    reconnects: int
    channel: ForceChannel | ImageChannel | None


@dataclass(frozen=True, slots=True)
class DaemonStatus:
    """State of the daemon beside its fingers and gripper.

    Attributes:
        uptime_s: Time since the first event of the run, s.
        late_s: Longest stall of the daemon within the last second, s.
        streams: State of every stream.
        recording: The newest recording on request.
        run_recording: The recording of the whole run; None where there is none.
        incidents: What was saved of incidents; None where none are kept.
        notices: Notices of the host by topic.
    """

    uptime_s: float
    late_s: float
    streams: Sequence[StreamStatus]
    recording: RecordingChanged
    run_recording: RecordingChanged | None
    incidents: IncidentsChanged | None
    notices: Mapping[str, str]


class StatusPublisher:
    """Publish the state of the daemon.

    Args:
        fingers: The fingers by name.
        named: The object that clients named.
        gripper: The gripper; None where the config names none.
        policy: Keeps the lease.
        sequencer: Numbers and dates the messages.
    """

    def __init__(
        self,
        fingers: Mapping[str, Finger],
        named: NamedObject,
        gripper: GripperControl | None,
        policy: GripPolicy,
        sequencer: MessageSequencer,
    ) -> None:
        self._fingers = fingers
        self._object = named
        self._gripper = gripper
        self._policy = policy
        self._sequencer = sequencer

    def publish(self, daemon: DaemonStatus, t_ns: int, out: list[Output]) -> None:
        """Append the state at ``t_ns``."""
        out.append(self._sequencer.message(STATUS_TOPIC, t_ns, NO_FRAME, self.body(daemon, t_ns)))

    def body(self, daemon: DaemonStatus, t_ns: int) -> Body:
        """Return ``status``: the state at ``t_ns``; also the result of the request of that name."""
        return {
            "version": __version__,
            "uptime_s": daemon.uptime_s,
            "fingers": {name: _finger_body(finger) for name, finger in self._fingers.items()},
            "object_name": self._object.name,
            "object_by": self._object.set_by,
            "object_t_ns": self._object.set_t_ns,
            "streams": {stream.name: _stream_body(stream, t_ns) for stream in daemon.streams},
            "publisher": {"messages": self._sequencer.published},
            "late_s": daemon.late_s,
            "lease": lease_body(self._policy, t_ns),
            "gripper": None if self._gripper is None else gripper_body(self._gripper, t_ns),
            "recording": _recording_body(daemon.recording),
            "run_recording": None if daemon.run_recording is None else _recording_body(daemon.run_recording),
            **({} if daemon.incidents is None else {"incidents": _incidents_body(daemon.incidents)}),
            "notices": {topic: one_line(text) for topic, text in daemon.notices.items()},
        }


def _finger_body(finger: Finger) -> Body:
    return {
        "level": finger.state.verdict.level,
        "reasons": list(finger.state.verdict.reasons),
        "evidence": list(finger.state.evidence),
        "tare_id": finger.tare.current.id,
        "tare_busy": finger.tare.busy,
        **friction_setter_body(finger),
    }


def _stream_body(stream: StreamStatus, t_ns: int) -> Body:
    counters = stream.counters
    worst_first = sorted(stream.conditions, key=lambda condition: -condition[0])
    return {
        "health": int(worst_first[0][0]),
        "message": one_line("; ".join(text for _, text in worst_first if text)),
        "hardware_id": one_line(stream.hardware_id) or None,
        "address": one_line(stream.address),
        "state": None if stream.state is None else one_line(stream.state),
        "expected_hz": stream.expected_hz,
        "rate_hz": finite_or_none(stream.rate_hz),
        "age_s": stream.age_s,
        "samples": stream.samples,
        "clock": stream.clock,
        "clock_uncertainty_s": stream.clock_uncertainty_s,
        "clock_drift_ppm": finite_or_none(stream.clock_drift_ppm),
        "good": counters.good,
        "bad": counters.bad,
        "lost": counters.lost,
        "duplicates": counters.duplicates,
        "restarts": counters.restarts,
        "bad_bytes": counters.bad_bytes,
        "dropped": stream.dropped,
        "reconnects": stream.reconnects,
        **_channel_body(stream.channel, t_ns),
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
        "path": recording.path or None,
        "state": recording.state,
        "running": recording.state == "running",
        "failure": recording.reason or None,
        "lost": recording.lost,
    }


def _incidents_body(incidents: IncidentsChanged) -> Body:
    return {
        "saved": incidents.saved,
        "not_saved": incidents.failed,
        "lost": incidents.lost,
        "dropped": incidents.dropped,
        "path": incidents.path or None,
        "failure": incidents.reason or None,
    }
