"""The engine: every event that can change a decision enters here, and every message and command leaves here.

It knows no clock, socket or file. The same events in the same order give the same messages, so that a recording of the
events is a recording of the run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import cast

from slipd.config import Config
from slipd.engine.held_motion import Found, HeldMotion
from slipd.engine.kept_state import KeptState
from slipd.events import (
    NEVER_NS,
    Bytes,
    Event,
    HostNotice,
    IncidentsChanged,
    LinkDown,
    LinkSpec,
    LinkUp,
    Output,
    RecordingChanged,
    Request,
    StateRestored,
    Tick,
    WallClock,
    Write,
)
from slipd.finger.finger_state import VerdictBatch
from slipd.finger.freshness import PROMPT, Read
from slipd.grasp.arm_motion import ArmMotion
from slipd.grasp.held_object import HeldObject
from slipd.grasp.motion_advice import MotionAdvice
from slipd.gripper.gripper_control import LONGEST_PAUSE_NS, GripperControl
from slipd.gripper.reflex import ReflexAct, ReflexController
from slipd.links.device_link import DeviceLink
from slipd.publish.finger_messages import FingerPublisher
from slipd.publish.grasp_messages import GraspPublisher, MotionPublisher, gripper_body
from slipd.publish.message_sequencer import NO_FRAME, MessageSequencer
from slipd.publish.status_publisher import StatusPublisher
from slipd.requests.handlers import RecordingState, RequestHandlers
from slipd.rig import GRIPPER_LINK, Rig
from slipd_client.messages import GRIPPER_TOPIC

SUSPENSION_NS = 50_000_000
"""A longer sleep of the host makes every stream stale and ends the lease."""


@dataclass(slots=True)
class Deadline:
    """What passing time alone may change.

    Attributes:
        run: Changes and publishes what is due at a time, and returns when it must be called again unless an event
            comes before.
        due_ns: Earliest time at which it may have something to do; 0: at the next tick.
        periodic: It goes by time alone: no event makes it due.
    """

    run: Callable[[int, list[Output]], int]
    due_ns: int = 0
    periodic: bool = False

    def run_now(self, t_ns: int, out: list[Output]) -> None:
        """Run it, due or not."""
        self.due_ns = self.run(t_ns, out)


class Engine:
    """Turn events into messages, replies and bytes for the devices.

    A tick calls only the deadlines that are due. Readings move their own deadlines on; a rarer event makes all due that
    it may change.

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
        rig = Rig(config, boot, self.wall)
        self._fingers, self._links, self._gripper = rig.fingers, rig.links, rig.gripper
        self._arm, self._lateness = rig.arm, rig.lateness
        self._suspended_ns: int | None = None  # as of the last tick
        self._released = False  # as of the last reading of the gripper
        self._clocks = [stream.clock for link in rig.links.values() for stream in link.streams.values()]
        self._motion, self.kept = HeldMotion(rig), KeptState(rig)
        self._recordings = RecordingState(boot, self.wall)
        self._sequencer = sequencer = MessageSequencer(boot, config.config_id, self.wall)
        self._publishers = {name: FingerPublisher(each, sequencer, config.rates) for name, each in rig.fingers.items()}
        self._status = StatusPublisher(rig, self._recordings, self.kept.problems, sequencer)
        self._handlers = RequestHandlers(rig, self._recordings, self._status.body)
        self._readers = {name: self._reader(name) for name in config.streams()}
        self._set_deadlines(rig, config.rates.grasp_hz)

    def _set_deadlines(self, rig: Rig, grasp_hz: float) -> None:
        """Set what passing time alone may change, in the order in which a tick looks at it."""
        absent = Deadline(lambda _, __: NEVER_NS)  # stands in for what the rig does not have
        self._silence = {name: Deadline(partial(self._check_silence, each)) for name, each in self._publishers.items()}
        self._gripper_check = Deadline(self._check_gripper)
        self._time_checks = [*self._silence.values(), self._gripper_check]
        self._reflex_due = absent if rig.reflex is None else Deadline(partial(self._run_reflex, rig.reflex))
        sessions = {name: link for name, link in rig.links.items() if link.session is not None}
        self._writes = {name: Deadline(partial(self._write_due, link)) for name, link in sessions.items()}
        self._gripper_write = self._writes.get(GRIPPER_LINK, absent)
        weigh = look = self._grasp_due = self._advice_due = absent
        if rig.grasp is not None:
            view, held, advice = rig.grasp
            weigh = Deadline(partial(self._weigh, held), periodic=True)
            look = Deadline(partial(self._look, advice), periodic=True)
            self._grasp_due = Deadline(GraspPublisher(view, held, rig.gripper, self._sequencer, grasp_hz).publish)
            self._advice_due = Deadline(MotionPublisher(advice, view, rig.gripper, self._sequencer).publish)
        self._deadlines = [
            *self._time_checks,  # a stream fell silent, the lease ended, the gripper does not answer
            self._reflex_due,
            *self._writes.values(),  # sessions poll, repeat, or send what waited
            weigh,
            self._grasp_due,
            look,
            self._advice_due,
            Deadline(self._status.publish_due),
        ]

    @property
    def links(self) -> dict[str, LinkSpec]:
        """Links to open, by name."""
        return {name: link.spec for name, link in self._links.items()}

    def handle(self, event: Event, t_ns: int) -> list[Output]:
        """Handle one event at ``t_ns`` (CLOCK_MONOTONIC) and return its outputs, in order."""
        out: list[Output] = []
        self._lateness.update(event, t_ns)
        if self._lateness.paused_ns > LONGEST_PAUSE_NS:
            self._gripper.drop_after_pause(self._lateness.paused_ns)
            self._make_all_due()
        if isinstance(event, Bytes):
            self._handle_bytes(self._links[event.link], event.data, t_ns, out)
        elif isinstance(event, Tick):
            self._handle_tick(event, t_ns, out)
        elif isinstance(event, Request):
            self._handle_request(event, t_ns, out)
        else:
            self._handle_rare(event, t_ns, out)
            self._make_all_due()
        return out

    def _handle_rare(self, event: Event, t_ns: int, out: list[Output]) -> None:
        match event:
            case RecordingChanged():
                if (reply := self._handlers.note_recording(event, t_ns)) is not None:
                    out.append(reply)
            case LinkUp(name, identity):
                if greeting := self._links[name].open(identity, t_ns):
                    out.append(Write(name, greeting))
            case LinkDown(name, reason):
                self._links[name].close(reason)
                self._handle_lost_link(name, t_ns, out)
            case StateRestored():
                self._status.note(self.kept.restore(event, t_ns))
            case HostNotice() | IncidentsChanged():  # pragma: no branch - the last
                self._status.note(event)
        self._status.publish(t_ns, out)

    def farewell(self) -> list[Write]:
        """End the run and return the last bytes for the devices; nothing moves, and a gripper keeps its grip."""
        return [Write(name, last) for name, link in self._links.items() if (last := link.farewell())]

    # Bytes and the readings in them

    def _handle_bytes(self, link: DeviceLink, data: bytes, t_ns: int, out: list[Output]) -> None:
        arrival = PROMPT
        if self._lateness.late_ns:
            arrival = self._lateness.arrival(t_ns)
            if self._arm is not None:
                self._arm.bridge_stall(t_ns - arrival.waited_ns)
            self._make_all_due()
        for read in link.receive(data, t_ns, arrival):
            if read.stream in self.kept.waiting:
                self.kept.apply(read.stream, t_ns)
            self._readers[read.stream](read, t_ns, out)
        if link.session is not None:
            write = self._writes[link.spec.name]
            write.due_ns = link.due_ns
            if t_ns >= write.due_ns or link.failed:
                write.run_now(t_ns, out)
        if link.spec.name == GRIPPER_LINK:
            self._gripper_check.due_ns = self._gripper.deadline_ns
            if t_ns >= self._gripper_check.due_ns:
                self._gripper_check.run_now(t_ns, out)
            self._follow_release()
        elif t_ns >= self._gripper_write.due_ns:  # a command may wait for its own pause, no longer
            self._gripper_write.run_now(t_ns, out)

    def _reader(self, stream: str) -> Callable[[Read, int, list[Output]], None]:
        """Return what handles the readings of a stream."""
        owner, _, kind = stream.partition(".")
        if kind:
            return partial(self._handle_finger, self._publishers[owner], kind)
        if isinstance(self._gripper, GripperControl) and owner == GRIPPER_LINK:
            return partial(self._handle_gripper, self._gripper)
        return self._handle_arm if owner == "arm" else self._handle_object

    def _handle_finger(self, publisher: FingerPublisher, kind: str, read: Read, t_ns: int, out: list[Output]) -> None:
        """Handle the readings of one stream of a finger that came in one read."""
        finger, before = publisher.finger, publisher.level
        if kind == "wrench":
            self._publish_batches(publisher, finger.decide(read), t_ns, out)
        else:
            self._handle_images(publisher, read, t_ns, out)
        if publisher.level != before:
            self._advice_due.due_ns = 0
        if publisher.level != before or t_ns >= self._grasp_due.due_ns:
            self._grasp_due.run_now(t_ns, out)

    def _handle_images(self, publisher: FingerPublisher, read: Read, t_ns: int, out: list[Output]) -> None:
        finger, arrival = publisher.finger, read.arrival
        for sample, acquired_ns in zip(read.samples, read.times_ns, strict=True):
            self._publish_batches(publisher, finger.update_image(sample, acquired_ns, arrival), t_ns, out)
            publisher.publish_image(acquired_ns, out)
            self._report_motion(self._motion.update_image(finger), t_ns, out)
            if arrival.waited_ns:
                self._publish_batches(publisher, finger.decide_delayed(t_ns, arrival.unread_ns), t_ns, out)
        silence = self._silence[finger.name]
        silence.due_ns = min(silence.due_ns, finger.quiet_until_ns(t_ns) + 1)

    def _handle_arm(self, read: Read, _: int, __: list[Output]) -> None:
        cast("ArmMotion", self._arm).update(read.samples, read.times_ns, self._gripper.width_m)

    def _handle_gripper(self, gripper: GripperControl, read: Read, _: int, out: list[Output]) -> None:
        for sample in read.samples:
            gripper.update(sample)
            self._publish_gripper(sample.t_ns, out)
            self._report_motion(self._motion.update_gripper(gripper, sample.t_ns), sample.t_ns, out)

    def _handle_object(self, read: Read, _: int, out: list[Output]) -> None:
        """Handle what another process observes of the object."""
        for sample, acquired_ns in zip(read.samples, read.times_ns, strict=True):
            self._report_motion(self._motion.update_object(sample, acquired_ns), sample.t_ns, out)

    def _report_motion(self, found: Found, t_ns: int, out: list[Output]) -> None:
        """Publish at once that fingers report motion."""
        if found:
            self._reflex_due.run_now(t_ns, out)
            self._grasp_due.due_ns = 0
        for finger, state in found:
            self._publishers[finger.name].publish_state(state, out)

    def _publish_batches(
        self, publisher: FingerPublisher, batches: Iterable[VerdictBatch], t_ns: int, out: list[Output]
    ) -> None:
        for batch in batches:
            if t_ns >= self._reflex_due.due_ns or publisher.finger.level != publisher.level:
                self._reflex_due.run_now(t_ns, out)
            publisher.publish_batch(batch, out)

    def _run_reflex(self, reflex: ReflexController, t_ns: int, out: list[Output]) -> int:
        """Let the reflex act: its command is sent before the verdict that called for it is published."""
        act = reflex.react(t_ns)
        if act is not None:
            self._gripper_write.run_now(t_ns, out)
            self._publish_gripper(t_ns, out, act)
        return reflex.due_ns

    def _publish_gripper(self, t_ns: int, out: list[Output], act: ReflexAct | None = None) -> None:
        """Publish the state of the gripper, where there is one, with the act of the reflex that led to it."""
        if isinstance(self._gripper, GripperControl):
            body = gripper_body(self._gripper, t_ns, act)
            out.append(self._sequencer.message(GRIPPER_TOPIC, t_ns, NO_FRAME, body))

    # Requests

    def _handle_request(self, request: Request, t_ns: int, out: list[Output]) -> None:
        for check in self._time_checks:  # a request is judged by what is known now, and by the lease in force now
            check.run(t_ns, out)
            check.due_ns = 0
        if (reply := self._handlers.answer(request, t_ns)) is not None:
            out.append(reply)
        for write in self._writes.values():
            write.run_now(t_ns, out)
        for record in self._recordings.due():
            out.append(replace(record, first=self.kept.first_events(t_ns)) if record.name else record)
            self._status.publish(t_ns, out)
        self._follow_release()

    def _follow_release(self) -> None:
        if self._gripper.policy.releasing is not self._released:
            self._released = not self._released
            self._grasp_due.due_ns = 0

    # Time

    def _handle_tick(self, tick: Tick, t_ns: int, out: list[Output]) -> None:
        before_ns, self._suspended_ns = self._suspended_ns, tick.suspended_ns
        if tick.wall_minus_monotonic_ns not in (0, self.wall.minus_monotonic_ns):
            self.kept.set_wall_clock(tick.wall_minus_monotonic_ns)
        for clock in self._clocks:
            clock.slewed_ns = self._lateness.slewed_ns
        if before_ns is not None and tick.suspended_ns - before_ns > SUSPENSION_NS:
            self._handle_wake_up(t_ns, out)
        if self._lateness.late_ns:
            self._make_all_due()
        for deadline in self._deadlines:
            if t_ns >= deadline.due_ns:
                deadline.due_ns = deadline.run(t_ns, out)

    def _make_all_due(self) -> None:
        for deadline in self._deadlines:
            if not deadline.periodic:
                deadline.due_ns = 0

    def _check_silence(self, publisher: FingerPublisher, t_ns: int, out: list[Output]) -> int:
        """Publish what has changed of a finger only because time passed."""
        finger = publisher.finger
        if t_ns <= (quiet_ns := finger.quiet_until_ns(t_ns)):
            return quiet_ns + 1
        unread_ns = self._lateness.unread_ns(t_ns)
        self._publish_batches(publisher, finger.decide_delayed(t_ns, unread_ns), t_ns, out)
        state = finger.check_silence(t_ns, unread_ns)
        if state is not None:
            publisher.publish_state(state, out)
            self._reflex_due.due_ns = self._grasp_due.due_ns = self._advice_due.due_ns = 0
        if finger.expire_image(t_ns, unread_ns):
            publisher.publish_image(t_ns, out)
        return 0

    def _check_gripper(self, t_ns: int, out: list[Output]) -> int:
        """Publish at once that a fault was latched, or that a lease ended by itself."""
        if self._gripper.on_time(t_ns):
            self._publish_gripper(t_ns, out)
            self._status.publish(t_ns, out)
            self._make_all_due()
        return self._gripper.deadline_ns

    def _weigh(self, held: HeldObject, t_ns: int, out: list[Output]) -> int:
        """Estimate the object; publish `status` when the arm stream begins or ceases to contradict the load."""
        fault = "" if self._arm is None else self._arm.check.fault
        due_ns = held.update(t_ns, self._gripper.width_m)
        if self._arm is not None and self._arm.check.fault != fault:
            self._status.publish(t_ns, out)
        return due_ns

    def _look(self, advice: MotionAdvice, t_ns: int, _: list[Output]) -> int:
        """Let the advice follow the loads on the pads."""
        return advice.follow(t_ns)

    def _write_due(self, link: DeviceLink, t_ns: int, out: list[Output]) -> int:
        """Write what a session has to send; what relies on a session that failed forgets it first."""
        name, pieces = link.spec.name, link.due(t_ns)
        if link.failed:
            link.failed = False
            self._handle_lost_link(name, t_ns, out)
            self._status.publish(t_ns, out)
            self._make_all_due()
        if pieces:
            out += [Write(name, piece) for piece in pieces]
        if name == GRIPPER_LINK:  # the session may have given up a command
            self._gripper_check.due_ns = min(self._gripper_check.due_ns, self._gripper.deadline_ns)
        return link.due_ns

    def _handle_wake_up(self, t_ns: int, out: list[Output]) -> None:
        """Handle the end of a suspend, in which CLOCK_MONOTONIC stood still: readings are old, the lease ends."""
        self._gripper.wake()
        self._publish_gripper(t_ns, out)
        for link in self._links.values():
            link.interrupt()
        for name, finger in self._fingers.items():
            if finger.force is not None:
                finger.force.gravity.forget()
            for kind in ("pad", "wrench"):
                self._lose_stream(name, kind, t_ns, out)
        self._make_all_due()

    def _handle_lost_link(self, name: str, t_ns: int, out: list[Output]) -> None:
        """Forget what came over a link that is closed."""
        for stream in self._links[name].streams.values():
            owner, _, kind = stream.name.partition(".")
            if kind:
                self._lose_stream(owner, kind, t_ns, out)
            elif isinstance(self._gripper, GripperControl) and owner == GRIPPER_LINK:
                self._gripper.lose()
                self._publish_gripper(t_ns, out)

    def _lose_stream(self, owner: str, kind: str, t_ns: int, out: list[Output]) -> None:
        publisher = self._publishers[owner]
        finger = publisher.finger
        if kind == "pad":
            finger.disconnect_image()
            publisher.publish_image(t_ns, out)
        if kind == finger.main_stream:
            publisher.publish_state(finger.disconnect(t_ns), out)
            self._reflex_due.due_ns = 0
