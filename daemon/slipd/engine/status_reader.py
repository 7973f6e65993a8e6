"""State of the daemon for the ``status`` message: its streams, lateness and recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import cast

from slipd.engine.device_link import DeviceLink
from slipd.engine.lateness import Lateness
from slipd.engine.stream_meter import StreamMeter
from slipd.events import HostNotice, IncidentsChanged
from slipd.finger.finger import Finger
from slipd.finger.force_channel import ForceChannel
from slipd.finger.image_channel import ImageChannel
from slipd.gripper.gripper_control import GripperControl
from slipd.publish.status_publisher import DaemonStatus, StreamStatus
from slipd.requests.recording_state import RecordingState
from slipd_client.messages import Health


class StatusReader:
    """Read the state of the daemon.

    Args:
        links: The links by name.
        fingers: The fingers by name.
        gripper: The gripper; None where the config names none.
        lateness: How late the daemon is.
        recordings: The recordings of this run.
        not_restored: Why tares of the run before are not used; see `KeptState.problems`.
    """

    def __init__(
        self,
        links: Mapping[str, DeviceLink],
        fingers: Mapping[str, Finger],
        gripper: GripperControl | None,
        lateness: Lateness,
        recordings: RecordingState,
        not_restored: Mapping[str, str],
    ) -> None:
        self._links = links
        self._fingers = fingers
        self._gripper = gripper
        self._lateness = lateness
        self._recordings = recordings
        self._not_restored = not_restored
        self._notices: dict[str, str] = {}
        self._incidents: IncidentsChanged | None = None

    def note(self, event: HostNotice | IncidentsChanged) -> None:
        """Keep what the host reports for `read`; a notice with the text "" ends that of its topic."""
        if isinstance(event, IncidentsChanged):
            self._incidents = event
            return
        self._notices.pop(event.topic, None)
        if event.text:
            self._notices[event.topic] = event.text

    def read(self, t_ns: int) -> DaemonStatus:
        """Return the state at ``t_ns``."""
        return DaemonStatus(
            uptime_s=(t_ns - (self._lateness.first_ns or t_ns)) * 1e-9,
            late_s=self._lateness.worst_ns(t_ns) * 1e-9,
            streams=[
                self._read_stream(link, stream, t_ns)
                for link in self._links.values()
                for stream in link.streams.values()
            ],
            recording=self._recordings.requested,
            run_recording=self._recordings.whole_run,
            incidents=self._incidents,
            notices=dict(self._notices),
        )

    def _read_stream(self, link: DeviceLink, stream: StreamMeter, t_ns: int) -> StreamStatus:
        lateness = self._lateness
        conditions = [link.condition(stream, t_ns, lateness.unread_ns(t_ns), lateness.worst_ns(t_ns))]
        owner, _, kind = stream.name.partition(".")
        if stream.name == "gripper":
            conditions += cast("GripperControl", self._gripper).conditions()
            return _status_of(link, stream, t_ns, conditions, None)
        if not kind:
            return _status_of(link, stream, t_ns, conditions, None)
        finger = self._fingers[owner]
        conditions += finger.conditions(kind, t_ns)
        if problem := self._not_restored.get(stream.name):
            conditions.append((Health.OK, problem))
        return _status_of(link, stream, t_ns, conditions, finger.channel(kind))


def _status_of(
    link: DeviceLink,
    stream: StreamMeter,
    t_ns: int,
    conditions: Sequence[tuple[Health, str]],
    channel: ForceChannel | ImageChannel | None,
) -> StreamStatus:
    session, clock = link.session, stream.clock
    uncertainty_ns = clock.uncertainty_ns
    return StreamStatus(
        name=stream.name,
        conditions=conditions,
        hardware_id=link.identity.reported or link.identity.opened,
        address=link.spec.address,
        state=session.state if session is not None else None,
        expected_hz=stream.expected_hz,
        rate_hz=stream.rate_hz,
        age_s=None if stream.last_ns is None else (t_ns - stream.last_ns) * 1e-9,
        samples=stream.count,
        clock="host" if stream.host_clock else clock.state,
        clock_uncertainty_s=None if uncertainty_ns is None else uncertainty_ns * 1e-9,
        clock_drift_ppm=clock.drift_ppm,
        counters=link.counters,
        dropped=link.flood.dropped,
        reconnects=link.reconnects,
        channel=channel,
    )
