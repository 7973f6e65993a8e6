"""Gripper behind an external driver: the daemon sends set-points to the driver and checks its answers.

This is for labs with a driver of their own. One driver is connected at a time; it registers, reports the state of its
gripper continuously, and answers every set-point. docs/devices.md describes the format.
"""

from __future__ import annotations

from slipd.devices import Device
from slipd.devices.external_gripper import external_gripper_message as wire
from slipd.devices.external_gripper.external_gripper_message import Decoder, Foreign, Registration, Report, sample
from slipd.devices.shared.command_queue import SETS_FORCE, STOP, CommandQueue, QueuedCommand
from slipd.devices.shared.device_interface import check_integer
from slipd.devices.shared.gripper_session import QueuedGripperSession
from slipd.devices.shared.gripper_states import FAULT_REPORTS, MOTIONS, Event, State, Table, report_of
from slipd.types.samples import GripperSample

__all__ = ["DEVICE", "Decoder", "Session"]

ANSWER_MS = 100
"""Time allowed for the answer to a set-point: two polls of a driver that polls its gripper at 20 Hz."""
SHORTEST_MS, LONGEST_MS = 5, 1000
"""Shortest and longest such time that can be configured."""
SILENCE_NS = 500_000_000
"""Time without a report after which the gripper accepts no commands."""
WIDTH_TOLERANCE_M = 0.001
"""A width this far beyond the registered range is still accepted, because a calibration may be inexact."""

FORCE_TOLERANCE = 1e-6
"""Largest relative excess of the applied force over the requested one; single precision can cause it."""


class SetpointQueue(CommandQueue):
    """Waiting set-points, each with its own id; for the arguments see `CommandQueue`."""

    _made = 0  # also before the last reset

    def reset(self) -> None:
        """Start again: nothing waits, nothing is known."""
        super().reset()
        self._goal: dict[str, float | None] = {}

    def activate(self) -> None:
        """Queue an activation, and nothing else."""
        self.replace([self._make("activate")])

    def move(self, width_m: float, speed_mps: float | None, force_n: float) -> None:
        """Queue a move, and nothing else."""
        self._goal = {"width_m": width_m, "speed_mps": speed_mps}
        self.replace([self._make("move", force_n=force_n, **self._goal)])

    def set_force(self, force_n: float) -> None:
        """Queue a force, after a stop that waits; a move that waits is queued with that force."""
        moves = any(command.kind == "move" for command in self.waiting)
        operation, goal = ("move", self._goal) if moves else ("force", {})
        self.replace([self._make(operation, force_n=force_n, **goal)], keep=(STOP,))

    def stop(self) -> None:
        """Send a stop at once in place of all else."""
        self.interrupt(self._make(STOP))

    def acknowledge(self) -> None:
        """Queue the acknowledgement of a fault, after a stop that waits."""
        self.replace([self._make("acknowledge")], keep=(STOP,))

    def is_complete(self, report: Report) -> bool:
        """Return whether a report, if it answers a force, contains the applied force."""
        command = self.outstanding
        answers = command is not None and report.id == command.number and command.kind in SETS_FORCE
        return not answers or report.applied_n is not None or bool(report.error)

    def match_answer(self, report: Report, now_ns: int) -> bool:
        """Handle the answer to the outstanding set-point; return False if the report is not its answer."""
        command = self.outstanding
        if command is None or report.id != command.number:
            return False
        self.handle_answer(now_ns, f"{command.name}: {report.error}" if report.error else "")
        if command.kind in SETS_FORCE and report.applied_n is not None:
            self.echo_ok = report.applied_n <= (command.force_n or 0.0) * (1.0 + FORCE_TOLERANCE)
        return True

    def _make(self, operation: str, **values: float | None) -> QueuedCommand:
        self._made += 1
        data = wire.encode_setpoint(self._made, operation, **values)
        return QueuedCommand(operation, values.get("force_n"), operation, data, self._made)


_REGISTRATIONS = {Event.REGISTERED: State.WAITING, Event.STRANGER: State.UNREGISTERED}
_ALWAYS = {**_REGISTRATIONS, Event.FELL_SILENT: State.SILENT, Event.ACTIVATE: State.ACTIVATION_QUEUED}

TRANSITIONS: Table = {
    State.CLOSED: {},
    State.UNREGISTERED: _REGISTRATIONS,
    State.WAITING: {**_REGISTRATIONS, **FAULT_REPORTS, Event.FELL_SILENT: State.SILENT},
    State.SILENT: {**_REGISTRATIONS, **FAULT_REPORTS},
    State.INACTIVE: {**_ALWAYS, **FAULT_REPORTS},
    State.ACTIVE: {**_ALWAYS, **FAULT_REPORTS, **MOTIONS},
    State.FAULTY: {**_ALWAYS, **FAULT_REPORTS, Event.HALT: State.FAULTY},
    State.ACTIVATION_QUEUED: {
        **_ALWAYS,
        Event.ACTIVATION_SENT: State.ACTIVATING,
        Event.ACTIVATION_GONE: State.INACTIVE,
    },
    State.ACTIVATING: {**_ALWAYS, Event.HALT: State.INACTIVE, Event.ACTIVATION_GONE: State.INACTIVE},
}
"""States of the session; after an activation is over or halted, it handles the last report again.

The driver carries out an activation on its own; it is in progress until the driver answers the set-point.
"""

ACTIVATION = frozenset({State.ACTIVATION_QUEUED, State.ACTIVATING})
"""In these states the gripper accepts no motion, whatever the driver reports."""

_REGISTER = "the driver must register first"
_ANOTHER = "another driver registered on this connection: reconnect"


class Session(QueuedGripperSession[SetpointQueue]):
    """Handle the registration and reports of a driver, and carry out permits as set-points, one at a time.

    `state` is "closed", "waiting" (for the registration or the first report), "inactive", "activating", "active", a
    fault, "no reply" (no recent report), "command lost" with the reason, or why the driver was refused. `identity` is
    the name that the driver registered. `TRANSITIONS` lists what the gripper accepts in each state.
    A driver may register again under the same name; after another name its messages are ignored until it reconnects or
    registers under the first name.
    `health.lost` counts unanswered set-points, `duplicates` answers to no set-point, `restarts` registrations after the
    first. An impossible report (before a registration, with a width beyond the registered range, or an answer without
    the applied force) is `bad` and ignored.

    ``echo_ok`` of a sample is whether the force that the driver applied last is at most the requested one.

    Args:
        answer_ms: Time allowed for the answer to a set-point, 5 to 1000 ms; then it is sent again with the same id.

    Raises:
        ValueError: The time is out of range or not an integer.
    """

    _activation = ACTIVATION
    _table = TRANSITIONS

    def __init__(self, answer_ms: int = ANSWER_MS) -> None:
        check_integer("answer_ms", answer_ms, SHORTEST_MS, LONGEST_MS)
        self.decoder = Decoder()
        self.health = self.decoder.health
        self._queue = SetpointQueue(answer_ms * 1_000_000, self.health)
        self._reset(State.CLOSED)

    def _reset(self, state: State) -> None:
        super()._reset(state)
        self._driver: Registration | None = None
        self._refusal = ""
        self._notice = b""
        self._notice_ns = 0
        self._silent_at_ns = 0

    @property
    def state(self) -> str:
        """State of driver and gripper, as a short text for people."""
        state = self._state
        if state is State.UNREGISTERED:
            return f"refused: {self._refusal}" if self._refusal else "waiting"
        if state in (State.CLOSED, State.WAITING):
            return str(state.value)
        if state is State.SILENT:
            return "no reply"
        if self.command_lost:
            return f"command lost: {self._queue.failure}"
        return "activating" if self.activating else self._fault or str(state.value)

    def start(self, now_ns: int) -> bytes:
        """Begin with a driver that has just connected and will send the first message."""
        self._reset(State.UNREGISTERED)
        self._silent_at_ns = now_ns + SILENCE_NS
        return b""

    def stop(self) -> bytes:
        """End. The driver sees that the connection ends, and keeps what it holds."""
        self._reset(State.CLOSED)
        return b""

    def receive(self, data: bytes, now_ns: int) -> list[GripperSample]:
        """Decode bytes received at ``now_ns``; return the readings they complete."""
        samples = []
        for message in self.decoder.messages(data):
            if isinstance(message, Registration):
                self._register(message, now_ns)
            elif isinstance(message, Foreign):
                self.health.bad += 1
                self._refuse(f"the format must be version {wire.VERSION}, got {message.version}", now_ns)
            elif self._driver is None:
                self.health.bad += 1
                self._refuse(self._refusal or _REGISTER, now_ns)
            elif self._is_plausible(message, self._driver):
                samples.append(self._handle_report(message, now_ns))
            else:
                self.health.bad += 1
        return samples

    def next_deadline(self) -> int | None:
        """Return when `on_time` is due, ns; None while closed."""
        if self._state is State.CLOSED:
            return None
        due = [self._notice_ns if self._notice else None, self._queue.due_ns, self._silent_at_ns]
        return min(time_ns for time_ns in due if time_ns is not None)

    def on_time(self, now_ns: int) -> bytes:
        """Return the notice or set-point that is due at ``now_ns``; empty if none is."""
        if self._state is State.CLOSED:
            return b""
        if now_ns >= self._silent_at_ns:
            self._fall_silent(now_ns)
        notice, self._notice = self._notice, b""
        setpoint = self._queue.on_time(now_ns)
        self._follow_activation()
        return notice + setpoint

    def _activate(self, now_ns: int) -> None:
        """Queue the activation, whatever the driver does for it."""
        self._queue.activate()

    def _halt(self) -> bool:
        dropped = self.drop()
        if not self._handle_event(Event.HALT):
            return dropped
        self._queue.stop()
        self._repeat_report()
        return True

    def _register(self, driver: Registration, now_ns: int) -> None:
        if self._queue.due_ns is not None:
            self._queue.give_up("the driver registered again")
        self._queue.forget_force()
        self._fault, self._queue.echo_ok = "", None
        if self.identity not in ("", driver.name):
            self._handle_event(Event.STRANGER)
            self._driver = None
            self._set_ranges()
            self._refuse(_ANOTHER, now_ns)
            return
        self.health.restarts += self.identity != ""
        self._handle_event(Event.REGISTERED)
        self._driver = driver
        self._set_ranges(driver.width_range_m, driver.force_range_n, driver.speed_range_mps)
        self.identity = driver.name
        self._silent_at_ns = now_ns + SILENCE_NS
        self._notice, self._notice_ns = wire.encode_notice(wire.REGISTERED, driver.name), now_ns

    def _fall_silent(self, now_ns: int) -> None:
        self._silent_at_ns = now_ns + SILENCE_NS
        self._handle_event(Event.FELL_SILENT)
        self._fault = ""
        if self._driver is None:
            self._refuse(self._refusal or _REGISTER, now_ns)
        if self._queue.due_ns is not None:
            self._queue.give_up("no recent report")

    def _refuse(self, reason: str, now_ns: int) -> None:
        self._refusal = reason
        self._notice, self._notice_ns = wire.encode_notice(wire.REFUSED, reason), now_ns

    def _is_plausible(self, report: Report, driver: Registration) -> bool:
        (low, high), width_m = driver.width_range_m, report.width_m
        in_range = width_m is None or low - WIDTH_TOLERANCE_M <= width_m <= high + WIDTH_TOLERANCE_M
        return in_range and self._queue.is_complete(report)

    def _handle_report(self, report: Report, now_ns: int) -> GripperSample:
        if report.id is not None:
            self.health.duplicates += not self._queue.match_answer(report, now_ns)
            self._follow_activation()
        self._silent_at_ns = now_ns + SILENCE_NS
        self.health.good += 1
        self._fault = report.fault
        self._reported = report_of(active=report.active, fault=report.fault)
        self._handle_event(self._reported)
        if report.fault or not report.active:
            self._queue.drop_grip(report.fault or "not active")
            self._follow_activation()
        if not report.active:
            self._queue.forget_force()
        reading = sample(report, now_ns)
        reading.echo_ok = self._queue.echo_ok
        return reading


DEVICE = Device(
    "external_gripper",
    "gripper",
    ("local",),
    Decoder,
    Session,
    rates_hz=(1.0, 1000.0),
    frame="a message of a gripper's driver",
    evidence="own",
)
