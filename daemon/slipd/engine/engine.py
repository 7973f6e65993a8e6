"""The engine: every event that can change a decision enters here, and every message and command leaves here.

It knows no clock, socket or file. The same events in the same order give the same messages, so that a recording of the
events is a recording of the run.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, cast

from slipd.config import Config
from slipd.devices import GripperSession
from slipd.engine.device_link import DeviceLink, make_links
from slipd.engine.held_motion import Found, HeldMotion
from slipd.engine.kept_state import KeptState
from slipd.engine.lateness import Lateness
from slipd.engine.status_reader import StatusReader
from slipd.events import (
    Bytes,
    Event,
    LinkDown,
    LinkSpec,
    LinkUp,
    Output,
    RecordingChanged,
    Request,
    StateRestored,
    Tick,
    Write,
)
from slipd.finger.finger import Finger
from slipd.finger.finger_state import VerdictBatch
from slipd.finger.freshness import PROMPT, Arrival
from slipd.grasp.grasp_view import GraspView
from slipd.grasp.named_object import NamedObject
from slipd.gripper.gripper_control import GripperControl
from slipd.gripper.reflex_controller import make_reflex_controller
from slipd.publish.finger_publisher import FingerPublisher
from slipd.publish.grasp_publisher import GraspPublisher
from slipd.publish.gripper_publisher import GripperPublisher
from slipd.publish.message_sequencer import MessageSequencer, Pace
from slipd.publish.status_publisher import StatusPublisher
from slipd.publish.wire_values import Body
from slipd.requests.handlers import RequestHandlers
from slipd.requests.lease_handlers import policy_without_gripper
from slipd.requests.recording_state import RecordingState
from slipd.types.samples import GripperSample
from slipd.types.wall_clock import WallClock

SUSPENSION_NS = 50_000_000
"""A longer sleep of the host makes every stream stale and ends the lease."""

GRIPPER_LINK = "gripper"


class Engine:
    """Turn events into messages, replies and bytes for the devices.

    Args:
        config: The rig.
        boot: Id of this run.
        wall_minus_monotonic_ns: Wall clock less CLOCK_MONOTONIC at the start of the run.

    Attributes:
        kept: What is kept for the next run, and what precedes a recording that begins now.
        wall: Wall clock of the run.
    """

    def __init__(self, config: Config, *, boot: str, wall_minus_monotonic_ns: int) -> None:
        self.wall = WallClock(wall_minus_monotonic_ns)
        sequencer = MessageSequencer(boot, config.config_id, self.wall)
        self._links = make_links(config)
        self._fingers = {name: Finger(name, finger, config.levels) for name, finger in config.finger.items()}
        self._gripper: GripperControl | None = None
        if config.gripper is not None:
            session = cast("GripperSession", self._links[GRIPPER_LINK].session)
            self._gripper = GripperControl(config.gripper, session, self._fingers)
        self._policy = policy_without_gripper() if self._gripper is None else self._gripper.policy
        view = None if config.grasp is None else GraspView(config.grasp, self._fingers)
        self._motion = HeldMotion(self._fingers, config.levels, config.grasp, self._gripper)
        self._reflex = make_reflex_controller(config, view, self._fingers, self._gripper)
        self._recordings = RecordingState(boot, self.wall)
        self._lateness = Lateness()
        self._finger_publishers = {
            name: FingerPublisher(finger, sequencer, config.rates) for name, finger in self._fingers.items()
        }
        named = NamedObject()
        self._grasp_publisher = (
            None if view is None else GraspPublisher(view, self._gripper, sequencer, config.rates.grasp_hz)
        )
        self._gripper_publisher = None if self._gripper is None else GripperPublisher(self._gripper, sequencer)
        self._status_publisher = StatusPublisher(self._fingers, named, self._gripper, self._policy, sequencer)
        self.kept = KeptState(config, boot, self.wall, self._links, self._fingers, self._gripper, named)
        self._status_reader = StatusReader(
            self._links, self._fingers, self._gripper, self._lateness, self._recordings, self.kept.problems
        )
        self._status_pace = Pace(config.rates.status_hz)
        self._handlers = RequestHandlers(
            boot,
            self._fingers,
            named,
            self._gripper,
            self._policy,
            config.requests,
            self._reflex is not None,
            self._recordings,
            self._status_body,
        )
        self._suspended_ns: int | None = None

    @property
    def links(self) -> dict[str, LinkSpec]:
        """The links that are to be opened, by name."""
        return {name: link.spec for name, link in self._links.items()}

    def handle(self, event: Event, t_ns: int) -> list[Output]:
        """Handle one event at ``t_ns`` (CLOCK_MONOTONIC) and return its outputs, in order."""
        out: list[Output] = []
        self._lateness.update(event, t_ns)
        if self._gripper is not None:
            self._gripper.drop_after_stall(t_ns)
        match event:
            case Bytes(name, data):
                self._handle_bytes(self._links[name], data, t_ns, out)
            case Tick():
                self._handle_tick(event, t_ns, out)
            case Request():
                self._handle_request(event, t_ns, out)
            case RecordingChanged():
                if (reply := self._handlers.note_recording(event, t_ns)) is not None:
                    out.append(reply)
                self._publish_status(t_ns, out)
            case LinkUp(name, identity):
                if greeting := self._links[name].open(identity, t_ns):
                    out.append(Write(name, greeting))
                self._publish_status(t_ns, out)
            case LinkDown(name, reason):
                self._links[name].close(reason)
                self._handle_lost_link(name, t_ns, out)
                self._publish_status(t_ns, out)
            case StateRestored():
                self._status_reader.note(self.kept.restore(event, t_ns))
                self._publish_status(t_ns, out)
            case _:  # HostNotice, IncidentsChanged
                self._status_reader.note(event)
                self._publish_status(t_ns, out)
        return out

    def farewell(self) -> list[Write]:
        """End the run and return the last bytes for the devices; nothing moves, and a gripper keeps its grip."""
        return [Write(name, last) for name, link in self._links.items() if (last := link.farewell())]

    # Bytes and the readings in them

    def _handle_bytes(self, link: DeviceLink, data: bytes, t_ns: int, out: list[Output]) -> None:
        late_ns, arrival = self._lateness.late_ns, PROMPT
        for stream, samples, times_ns in link.receive(data, t_ns, late_ns):
            if late_ns:
                arrival = self._lateness.arrival(t_ns, dated=link.dated(stream))
            if stream in self.kept.waiting:
                self.kept.apply(stream, t_ns)
            self._handle_samples(stream, samples, times_ns, arrival, t_ns, out)
        self._write_due(link, t_ns, out)
        if self._gripper is None:
            return
        if link.spec.name == GRIPPER_LINK:
            self._check_lease_and_gripper(t_ns, out)
        else:  # a command may wait for no more than the gripper's own pause
            self._write_due(self._links[GRIPPER_LINK], t_ns, out)

    def _handle_samples(
        self, stream: str, samples: Sequence[Any], times_ns: Sequence[int], arrival: Arrival, t_ns: int,
        out: list[Output],
    ) -> None:  # fmt: skip
        """Handle the readings of one stream that came in one read."""
        owner, _, kind = stream.partition(".")
        if not kind:
            self._handle_grasp_samples(samples, times_ns, out)
            return
        finger, publisher = self._fingers[owner], self._finger_publishers[owner]
        if kind == "wrench":
            self._publish_batches(finger.decide(samples, times_ns, arrival), publisher, t_ns, out)
        else:
            for sample, acquired_ns in zip(samples, times_ns, strict=True):
                batch = finger.update_image(sample, acquired_ns, arrival)
                if batch is not None:
                    self._run_reflex(t_ns, out)
                    publisher.publish_batch(batch, out)
                publisher.publish_image(acquired_ns, out)
                self._report_motion(self._motion.update_pads(), t_ns, out)
                if arrival.waited_ns:
                    self._publish_batches(finger.decide_delayed(t_ns, arrival.unread_ns), publisher, t_ns, out)
        if found := self._motion.update_finger(finger):
            self._report_motion(found, t_ns, out)
        if self._grasp_publisher is not None:
            self._grasp_publisher.publish(t_ns, out)

    def _handle_grasp_samples(self, samples: Sequence[Any], times_ns: Sequence[int], out: list[Output]) -> None:
        """Handle readings of the gripper, or of the object by another process."""
        for sample, acquired_ns in zip(samples, times_ns, strict=True):
            if isinstance(sample, GripperSample):
                cast("GripperControl", self._gripper).update(sample)
                self._publish_gripper(sample.t_ns, out)
            self._report_motion(self._motion.update_grasp(sample, acquired_ns), sample.t_ns, out)

    def _report_motion(self, found: Found, t_ns: int, out: list[Output]) -> None:
        """Publish at once that fingers report motion."""
        if found:
            self._run_reflex(t_ns, out)
        for finger, state in found:
            self._finger_publishers[finger.name].publish_state(state, out)

    def _publish_batches(
        self, batches: Iterable[VerdictBatch], publisher: FingerPublisher, t_ns: int, out: list[Output]
    ) -> None:
        for batch in batches:
            self._run_reflex(t_ns, out)
            publisher.publish_batch(batch, out)

    def _run_reflex(self, t_ns: int, out: list[Output]) -> None:
        """Let the reflex act: its command is sent before the verdict that called for it is published."""
        act = None if self._reflex is None else self._reflex.react(t_ns)
        if act is not None:
            self._write_due(self._links[GRIPPER_LINK], t_ns, out)
            cast("GripperPublisher", self._gripper_publisher).publish(t_ns, out, act)

    # Requests

    def _handle_request(self, request: Request, t_ns: int, out: list[Output]) -> None:
        self._check_time(t_ns, out)  # a request is judged by what is known now, and by the lease that is in force now
        if (reply := self._handlers.answer(request, t_ns)) is not None:
            out.append(reply)
        self._write_all_due(t_ns, out)
        for record in self._recordings.due():
            out.append(replace(record, opened=self.kept.first_events(t_ns)) if record.name else record)
            self._publish_status(t_ns, out)

    # Time

    def _handle_tick(self, tick: Tick, t_ns: int, out: list[Output]) -> None:
        before_ns, self._suspended_ns = self._suspended_ns, tick.suspended_ns
        if tick.wall_minus_monotonic_ns not in (0, self.wall.minus_monotonic_ns):
            self.kept.set_wall_clock(tick.wall_minus_monotonic_ns)
        for link in self._links.values():
            link.note_slew(self._lateness.slewed_ns)
        if before_ns is not None and tick.suspended_ns - before_ns > SUSPENSION_NS:
            self._handle_wake_up(t_ns, out)
        self._check_time(t_ns, out)
        self._run_reflex(t_ns, out)
        self._write_all_due(t_ns, out)
        if self._grasp_publisher is not None:
            self._grasp_publisher.publish(t_ns, out)
        if self._status_pace.passes(t_ns):
            self._publish_status(t_ns, out)

    def _check_time(self, t_ns: int, out: list[Output]) -> None:
        """Publish what has changed only because time passed."""
        unread_ns = self._lateness.unread_ns(t_ns)
        for name, finger in self._fingers.items():
            publisher = self._finger_publishers[name]
            self._publish_batches(finger.decide_delayed(t_ns, unread_ns), publisher, t_ns, out)
            state = finger.check_silence(t_ns, unread_ns)
            if state is not None:
                publisher.publish_state(state, out)
            if finger.expire_image(t_ns, unread_ns):
                publisher.publish_image(t_ns, out)
        self._check_lease_and_gripper(t_ns, out)

    def _check_lease_and_gripper(self, t_ns: int, out: list[Output]) -> None:
        """Publish at once that a fault was latched, or that a lease ended by itself."""
        if self._gripper is None:
            if self._policy.lease.lapsed(t_ns):
                self._publish_status(t_ns, out)
        elif self._gripper.on_time(t_ns):
            self._publish_gripper(t_ns, out)
            self._publish_status(t_ns, out)

    def _handle_wake_up(self, t_ns: int, out: list[Output]) -> None:
        """Handle the end of a suspend, in which CLOCK_MONOTONIC stood still: readings are old, the lease ends."""
        self._policy.lease.end()
        if self._gripper is not None:
            self._gripper.wake()
            self._publish_gripper(t_ns, out)
        for link in self._links.values():
            link.interrupt()
        for name, finger in self._fingers.items():
            if finger.force is not None:
                finger.force.gravity.forget()
            for kind in ("pad", "wrench"):
                self._lose_stream(name, kind, t_ns, out)

    def _handle_lost_link(self, name: str, t_ns: int, out: list[Output]) -> None:
        """Forget what came over a link that is closed."""
        for stream in self._links[name].streams.values():
            owner, _, kind = stream.name.partition(".")
            if kind:
                self._lose_stream(owner, kind, t_ns, out)
            elif owner == GRIPPER_LINK:
                cast("GripperControl", self._gripper).lose()
                self._publish_gripper(t_ns, out)

    def _lose_stream(self, owner: str, kind: str, t_ns: int, out: list[Output]) -> None:
        finger, publisher = self._fingers[owner], self._finger_publishers[owner]
        if kind == "pad":
            finger.disconnect_image()
            publisher.publish_image(t_ns, out)
        if kind == finger.main_stream:
            publisher.publish_state(finger.disconnect(t_ns), out)

    def _write_all_due(self, t_ns: int, out: list[Output]) -> None:
        for link in self._links.values():
            self._write_due(link, t_ns, out)

    def _write_due(self, link: DeviceLink, t_ns: int, out: list[Output]) -> None:
        """Write what a session has to send; what relies on a session that failed forgets it first."""
        pieces = link.due(t_ns)
        if link.failed:
            link.failed = False
            self._handle_lost_link(link.spec.name, t_ns, out)
            self._publish_status(t_ns, out)
        out += [Write(link.spec.name, piece) for piece in pieces]

    def _publish_gripper(self, t_ns: int, out: list[Output]) -> None:
        cast("GripperPublisher", self._gripper_publisher).publish(t_ns, out)

    def _publish_status(self, t_ns: int, out: list[Output]) -> None:
        self._status_publisher.publish(self._status_reader.read(t_ns), t_ns, out)

    def _status_body(self, t_ns: int) -> Body:
        return self._status_publisher.body(self._status_reader.read(t_ns), t_ns)
