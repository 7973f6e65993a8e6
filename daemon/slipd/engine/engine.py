"""The engine: every event that can change a decision enters here, and every message and command leaves here.

It knows no clock, socket or file. Fed the same events in the same order it gives the same messages, so a recording of
its events is the run itself.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, cast

from slipd import __version__
from slipd.config import Config
from slipd.device_text import one_line
from slipd.devices import GripperSession
from slipd.engine.device_link import DeviceLink, make_links
from slipd.engine.lateness import Lateness
from slipd.engine.stream_meter import StreamMeter
from slipd.events import (
    Bytes,
    Event,
    LinkSpec,
    LinkUp,
    Output,
    RecordingChanged,
    Request,
    Tick,
    Write,
)
from slipd.finger.finger import Finger
from slipd.finger.freshness import PROMPT, Arrival
from slipd.finger.verdict_batch import VerdictBatch
from slipd.gripper.grasp_controller import make_grasp_controller
from slipd.gripper.gripper_control import GripperControl
from slipd.publish.finger_publisher import FingerPublisher
from slipd.publish.message_bodies import lease_body
from slipd.publish.message_sequencer import NO_FRAME, MessageSequencer, Pace
from slipd.requests.handlers import RequestHandlers
from slipd.requests.lease_handlers import policy_without_gripper
from slipd.requests.recording_state import RecordingState
from slipd.samples import GripperSample
from slipd_client.messages import (
    GRIPPER_TOPIC,
    STATUS_TOPIC,
)

#: Sleep of the host that ends what was known of the present: streams are stale, leases over.
SUSPENSION_NS = 50_000_000
GRIPPER_LINK = "gripper"


class Engine:
    """Turns events into messages, replies and bytes for the devices.

    Args:
        config: The rig.
        boot: Id of this run.
        wall_minus_monotonic_ns: Wall clock less CLOCK_MONOTONIC at the start of the run.
    """

    def __init__(self, config: Config, *, boot: str, wall_minus_monotonic_ns: int) -> None:
        self._sequencer = MessageSequencer(boot, config.config_id, wall_minus_monotonic_ns)
        self._config = config
        self._links = make_links(config)
        self._fingers = {name: Finger(name, finger, config.levels) for name, finger in config.finger.items()}
        self._publishers = {
            name: FingerPublisher(finger, self._sequencer, config.rates) for name, finger in self._fingers.items()
        }
        self._gripper = self._make_gripper()
        self._grasp = make_grasp_controller(config, self._fingers, self._gripper, self._sequencer)
        self._recordings = RecordingState(boot, wall_minus_monotonic_ns)
        self._policy = policy_without_gripper() if self._gripper is None else self._gripper.policy
        self._handlers = RequestHandlers(
            boot, self._fingers, self._gripper, self._policy, config.requests, self._recordings, self._status
        )
        self._status_pace = Pace(config.rates.status_hz)
        self._started_ns: int | None = None
        self._suspended_ns: int | None = None
        self._lateness = Lateness()

    @property
    def links(self) -> dict[str, LinkSpec]:
        """The links that are to be opened, by name."""
        return {name: link.spec for name, link in self._links.items()}

    def handle(self, event: Event, t_ns: int) -> list[Output]:
        """Takes one event at ``t_ns`` (CLOCK_MONOTONIC) and returns what it brings about, in order."""
        out: list[Output] = []
        if self._started_ns is None:
            self._started_ns = t_ns
        self._lateness.note(event, t_ns)
        if self._gripper is not None:
            self._gripper.drop_after_stall(t_ns)
        match event:
            case Bytes(name, data):
                self._receive(self._links[name], data, t_ns, out)
            case Tick():
                self._tick(event.suspended_ns, t_ns, out)
            case Request():
                self._answer(event, t_ns, out)
            case RecordingChanged():
                if (reply := self._handlers.note_recording(event, t_ns)) is not None:
                    out.append(reply)
                self._publish_status(t_ns, out)
            case LinkUp(name, identity):
                greeting = self._links[name].open(identity, t_ns)
                if greeting:
                    out.append(Write(name, greeting))
                self._publish_status(t_ns, out)
            case _:
                self._links[event.link].close(event.reason)
                self._lose(event.link, t_ns, out)
                self._publish_status(t_ns, out)
        return out

    def farewell(self) -> list[Write]:
        """Ends the run, and returns what the devices hear last; nothing moves: a gripper goes on gripping."""
        return [Write(name, last) for name, link in self._links.items() if (last := link.farewell())]

    def _make_gripper(self) -> GripperControl | None:
        if self._config.gripper is None:
            return None
        session = cast("GripperSession", self._links[GRIPPER_LINK].session)
        return GripperControl(self._config.gripper, session, self._fingers)

    def _receive(self, link: DeviceLink, data: bytes, t_ns: int, out: list[Output]) -> None:
        late_ns, arrival = self._lateness.late_ns, PROMPT
        for stream, samples, times_ns in link.receive(data, t_ns, late_ns):
            if late_ns:
                waited_ns, unread_ns = self._lateness.waited_ns(t_ns), self._lateness.unread_ns(t_ns)
                arrival = Arrival(waited_ns, unread_ns, link.dated(stream))
            self._take(stream, samples, times_ns, arrival, t_ns, out)
        if pieces := link.due(t_ns):
            out += [Write(link.spec.name, piece) for piece in pieces]
        if self._gripper is None:
            return
        if link.spec.name == GRIPPER_LINK:
            self._watch_gripper(t_ns, out)
        else:  # a command may wait for no more than the gripper's own pause
            out += [Write(GRIPPER_LINK, piece) for piece in self._links[GRIPPER_LINK].due(t_ns)]

    def _answer(self, request: Request, t_ns: int, out: list[Output]) -> None:
        self._pass_time(t_ns, out)  # a request is judged on what is known now, and by nobody whose lease ran out
        if (reply := self._handlers.answer(request, t_ns)) is not None:
            out.append(reply)
        self._write_due(t_ns, out)
        for record in self._recordings.due():
            out.append(replace(record, opened=self._opened()) if record.name else record)
            self._publish_status(t_ns, out)

    def _opened(self) -> tuple[LinkUp, ...]:
        return tuple(LinkUp(name, link.opened) for name, link in self._links.items() if link.up)

    def _watch_gripper(self, t_ns: int, out: list[Output]) -> None:
        """Report at once what changed at the gripper, or ended a lease, without a request."""
        gripper = self._gripper
        if gripper is None:
            if self._policy.lapsed(t_ns):
                self._publish_status(t_ns, out)
        elif gripper.on_time(t_ns):
            out.append(self._sequencer.message(GRIPPER_TOPIC, t_ns, NO_FRAME, gripper.body(t_ns)))
            self._publish_status(t_ns, out)

    def _take(
        self,
        stream: str,
        samples: Sequence[Any],
        times_ns: Sequence[int],
        arrival: Arrival,
        t_ns: int,
        out: list[Output],
    ) -> None:
        """Takes the readings of one stream that came in one read."""
        owner, _, kind = stream.partition(".")
        if not kind:
            self._take_gripper(samples, out)
            return
        finger, publisher = self._fingers[owner], self._publishers[owner]
        if kind == "wrench":
            self._tell_reads(finger.decide(samples, times_ns, arrival), publisher, t_ns, out)
        else:
            for sample, acquired_ns in zip(samples, times_ns, strict=True):
                decided = finger.update_image(sample, acquired_ns, arrival)
                if decided is not None:
                    self._react(t_ns, out)
                    publisher.tell_read(decided, out)
                publisher.tell_image(acquired_ns, out)
                if arrival.waited_ns:
                    self._tell_reads(finger.decide_held(t_ns, arrival.unread_ns), publisher, t_ns, out)
        if self._grasp is not None:
            self._grasp.tell(t_ns, out)

    def _tell_reads(
        self, reads: Iterable[VerdictBatch], publisher: FingerPublisher, t_ns: int, out: list[Output]
    ) -> None:
        for judged in reads:
            self._react(t_ns, out)
            publisher.tell_read(judged, out)

    def _react(self, t_ns: int, out: list[Output]) -> None:
        """Lets the reflex act: its command leaves before anything is said of what called it."""
        act = None if self._grasp is None else self._grasp.react(t_ns)
        if act is not None:
            out += [Write(GRIPPER_LINK, piece) for piece in self._links[GRIPPER_LINK].due(t_ns)]
            out.append(act)

    def _take_gripper(self, samples: Sequence[GripperSample], out: list[Output]) -> None:
        gripper = cast("GripperControl", self._gripper)
        for sample in samples:
            gripper.update(sample)
            out.append(self._sequencer.message(GRIPPER_TOPIC, sample.t_ns, NO_FRAME, gripper.body(sample.t_ns)))

    def _tick(self, suspended_ns: int, t_ns: int, out: list[Output]) -> None:
        slept = 0 if self._suspended_ns is None else suspended_ns - self._suspended_ns
        self._suspended_ns = suspended_ns
        if slept > SUSPENSION_NS:
            self._wake(t_ns, out)
        self._pass_time(t_ns, out)
        self._react(t_ns, out)
        self._write_due(t_ns, out)
        if self._grasp is not None:
            self._grasp.tell(t_ns, out)
        if self._status_pace.passes(t_ns):
            self._publish_status(t_ns, out)

    def _pass_time(self, t_ns: int, out: list[Output]) -> None:
        """Tells what the passing of time alone changed."""
        unread_ns = self._lateness.unread_ns(t_ns)
        for name, finger in self._fingers.items():
            self._tell_reads(finger.decide_held(t_ns, unread_ns), self._publishers[name], t_ns, out)
            state = finger.check_silence(t_ns, unread_ns)
            if state is not None:
                self._publishers[name].tell(state, out)
            if finger.expire_image(t_ns, unread_ns):
                self._publishers[name].tell_image(t_ns, out)
        self._watch_gripper(t_ns, out)

    def _wake(self, t_ns: int, out: list[Output]) -> None:
        """The host slept, and the monotonic clock with it: what looks fresh is old, and leases are over."""
        self._policy.end_lease()
        if self._gripper is not None:
            self._gripper.wake()
            out.append(self._sequencer.message(GRIPPER_TOPIC, t_ns, NO_FRAME, self._gripper.body(t_ns)))
        for link in self._links.values():
            link.interrupt()
        for name, finger in self._fingers.items():
            finger.disconnect_image()
            self._publishers[name].tell_image(t_ns, out)
            if finger.force is not None:
                finger.force.gravity.forget()
            self._publishers[name].tell(finger.disconnect(t_ns), out)

    def _lose(self, name: str, t_ns: int, out: list[Output]) -> None:
        """A link is gone: what came over it is no longer known."""
        for meter in self._links[name].streams.values():
            owner, _, kind = meter.name.partition(".")
            finger = self._fingers.get(owner)
            if finger is not None and kind == "pad":
                finger.disconnect_image()
                self._publishers[owner].tell_image(t_ns, out)
            if finger is not None and (kind == "wrench" or finger.force is None):
                self._publishers[owner].tell(finger.disconnect(t_ns), out)
            elif finger is None and self._gripper is not None:
                self._gripper.lose()
                out.append(self._sequencer.message(GRIPPER_TOPIC, t_ns, NO_FRAME, self._gripper.body(t_ns)))

    def _write_due(self, t_ns: int, out: list[Output]) -> None:
        for name, link in self._links.items():
            out += [Write(name, piece) for piece in link.due(t_ns)]

    def _publish_status(self, t_ns: int, out: list[Output]) -> None:
        out.append(self._sequencer.message(STATUS_TOPIC, t_ns, NO_FRAME, self._status(t_ns)))

    def _status(self, t_ns: int) -> dict[str, Any]:
        gripper = None if self._gripper is None else self._gripper.body(t_ns)
        fingers = {
            name: {
                "level": finger.state.verdict.level,
                "reasons": list(finger.state.verdict.reasons),
                "tare_id": finger.tare.current.id,
                "tare_busy": finger.tare.busy,
                **finger.friction_body(),
            }
            for name, finger in self._fingers.items()
        }
        streams = {
            stream.name: self._stream_body(link, stream, t_ns)
            for link in self._links.values()
            for stream in link.streams.values()
        }
        return {
            "version": __version__,
            "uptime_s": (t_ns - (self._started_ns or t_ns)) * 1e-9,
            "fingers": fingers,
            "streams": streams,
            "publisher": {"messages": self._sequencer.published},
            "late_s": self._lateness.worst_ns(t_ns) * 1e-9,
            "lease": lease_body(self._policy, t_ns),
            "gripper": gripper,
            "recording": self._recordings.body(),
            "run_recording": self._recordings.whole_run_body(),
        }

    def _stream_body(self, link: DeviceLink, stream: StreamMeter, t_ns: int) -> dict[str, Any]:
        lateness = self._lateness
        conditions = [link.level(stream, t_ns, lateness.unread_ns(t_ns), lateness.worst_ns(t_ns))]
        body = link.told(stream, t_ns)
        owner, _, kind = stream.name.partition(".")
        finger = self._fingers[owner] if kind else None
        side = None if finger is None else finger.channel(kind)
        if finger is None or side is None:
            conditions += cast("GripperControl", self._gripper).conditions()
        else:
            conditions += finger.conditions(kind, t_ns)
            body |= {"tare_id": side.tare.current.id, "tare_busy": side.tare.busy} | side.told(t_ns)
        worst = max(health for health, _ in conditions)
        message = "; ".join(text for _, text in sorted(conditions, key=lambda told: -told[0]) if text)
        shown = {key: one_line(value) if isinstance(value, str) else value for key, value in body.items()}
        return {"health": int(worst), "message": one_line(message), **shown}
