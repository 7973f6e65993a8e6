"""Session with an external driver: permits become set-points, reports become samples."""

from __future__ import annotations

import math

from slipd.devices.external_gripper import external_gripper_message as wire
from slipd.devices.external_gripper.external_gripper_decoder import Decoder, sample
from slipd.devices.external_gripper.external_gripper_message import Foreign, Registration, Report
from slipd.devices.external_gripper.external_gripper_setpoints import SetPoints
from slipd.devices.external_gripper.external_gripper_states import ACTIVATION, TRANSITIONS, Event, State
from slipd.devices.permitted_session import PermittedSession
from slipd.devices.state_machine import StateMachine
from slipd.samples import GripperSample

ANSWER_MS = 100
"""For the answer to a set-point: a driver that polls its gripper at 20 Hz can answer within two polls."""
SHORTEST_MS, LONGEST_MS = 5, 1000
SILENCE_NS = 500_000_000
"""A driver that reports nothing for this long has no gripper that takes commands."""
WIDTH_TOLERANCE_M = 0.001
"""A width this far beyond the registered range is still accepted, because a calibration may be off."""

_REGISTER = "a driver registers before all else"
_ANOTHER = "another driver registered here: connect anew"


class Session(PermittedSession):
    """Takes a driver's registration and reports, and carries out permits as set-points, one at a time.

    `state` is "closed", "waiting" (for the registration or the first report), "inactive", "activating", "active", a
    fault, "no reply" (no report of late), "command lost" with the reason, or why the driver was refused. `identity` is
    the name that it registered. `external_gripper_states` lists what the gripper accepts in each state.
    A driver may register again under the same name; after another name its messages are ignored until it does.
    `health.lost` counts unanswered set-points, `duplicates` answers to none, `restarts` registrations after the first;
    an impossible report (before a registration, of a width beyond the registered range, an answer without the applied
    force) is `bad` and ignored.

    ``echo_ok`` of a sample: the force that the driver last reported as applied is not above the one requested.

    Args:
        answer_ms: How long the answer to a set-point may take, 5 to 1000 ms; then it is sent again, with its id.

    Raises:
        ValueError: The time is out of range or no integer.
    """

    def __init__(self, answer_ms: int = ANSWER_MS) -> None:
        if not (isinstance(answer_ms, int) and SHORTEST_MS <= answer_ms <= LONGEST_MS):
            raise ValueError(f"answer_ms must be an integer from {SHORTEST_MS} to {LONGEST_MS}, got {answer_ms!r}")
        self.decoder = Decoder()
        self.health = self.decoder.health
        self._setpoints = SetPoints(answer_ms * 1_000_000, self.health)
        self._reset(State.CLOSED)

    def _reset(self, state: State) -> None:
        self.decoder.forget()
        self._setpoints.reset()
        self._machine = StateMachine(TRANSITIONS, state)
        self.identity = ""
        self._driver: Registration | None = None
        self._reported = Event.REPORTED_INACTIVE  # by the last report
        self._fault = ""  # in the last report
        self._refusal = ""
        self._notice = b""
        self._notice_ns = 0
        self._silent_at_ns = 0

    @property
    def command_lost(self) -> bool:
        """The last set-point was refused by the driver, or never answered."""
        return bool(self._setpoints.trouble)

    @property
    def state(self) -> str:
        """The state in a word, for people."""
        state = self._machine.state
        if state is State.UNREGISTERED:
            return f"refused: {self._refusal}" if self._refusal else "waiting"
        if state in (State.CLOSED, State.WAITING):
            return str(state.value)
        if state is State.SILENT:
            return "no reply"
        if self.command_lost:
            return f"command lost: {self._setpoints.trouble}"
        return "activating" if self.activating else self._fault or str(state.value)

    @property
    def activating(self) -> bool:
        """Whether an activation is queued, or sent and not answered."""
        return self._machine.state in ACTIVATION

    @property
    def width_range_m(self) -> tuple[float, float]:
        """Least and largest width between the pads; (0, inf) while no driver has registered."""
        return (0.0, math.inf) if self._driver is None else self._driver.width_range_m

    @property
    def speed_range_mps(self) -> tuple[float, float] | None:
        """Least and largest speed; None where no speed can be asked for."""
        return None if self._driver is None else self._driver.speed_range_mps

    @property
    def force_range_n(self) -> tuple[float, float]:
        """Least and largest force, N on one pad; (0, inf) while no driver has registered."""
        return (0.0, math.inf) if self._driver is None else self._driver.force_range_n

    def start(self, now_ns: int) -> bytes:
        """Begin with a driver that has just connected; it sends the first message."""
        self._reset(State.UNREGISTERED)
        self._silent_at_ns = now_ns + SILENCE_NS
        return b""

    def stop(self) -> bytes:
        """End. The driver sees that the connection ends, and keeps what it holds."""
        self._reset(State.CLOSED)
        return b""

    @property
    def force_sent_n(self) -> float | None:
        """The force of the set-point last sent or queued; None where there is none since the activation."""
        return self._setpoints.force

    def applied_n(self, force_n: float) -> float:
        """Return ``force_n``: a set-point has no steps."""
        return force_n

    def drop(self) -> bool:
        """Drop what is not sent yet, except a stop; do not repeat what is unanswered."""
        dropped = self._setpoints.forget()
        self._follow_activation()
        return dropped

    def acknowledge(self) -> None:
        """Forget that a set-point was lost, and let the driver know that the fault it reports was seen."""
        self._setpoints.trouble = ""
        if self._fault:
            self._setpoints.acknowledge()
            self._follow_activation()

    def receive(self, data: bytes, now_ns: int) -> list[GripperSample]:
        """Take bytes received at ``now_ns`` and return the readings they complete."""
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
            elif self._is_believed(message, self._driver):
                samples.append(self._take(message, now_ns))
            else:
                self.health.bad += 1
        return samples

    def next_deadline(self) -> int | None:
        """Return when `on_time` is due, ns; None while closed."""
        if self._machine.state is State.CLOSED:
            return None
        due = [self._notice_ns if self._notice else None, self._setpoints.due_ns, self._silent_at_ns]
        return min(time_ns for time_ns in due if time_ns is not None)

    def on_time(self, now_ns: int) -> bytes:
        """Return the notice or set-point that is due at ``now_ns``; empty when none is."""
        if self._machine.state is State.CLOSED:
            return b""
        if now_ns >= self._silent_at_ns:
            self._fall_silent(now_ns)
        notice, self._notice = self._notice, b""
        setpoint = self._setpoints.on_time(now_ns)
        self._follow_activation()
        return notice + setpoint

    def _activate(self, now_ns: int) -> bool:
        """Ask the driver to make its gripper ready, whatever that takes."""
        if not self._machine.handle(Event.ACTIVATE):
            return False
        self._setpoints.activate()
        return True

    def _move(self, width_m: float, speed_mps: float | None, force_n: float) -> bool:
        """Ask for a width, at the driver's own speed where none is given."""
        if not self._machine.takes(Event.MOVE):
            return False
        if speed_mps is not None:
            _check("speed", speed_mps, self.speed_range_mps or (0.0, 0.0))
        _check("width", width_m, self.width_range_m)
        self._machine.handle(Event.MOVE)
        self._setpoints.move(width_m, speed_mps, self._in_range(force_n))
        return True

    def _set_force(self, force_n: float) -> bool:
        """Ask for another force, and no other motion; a move that waits goes with that force."""
        if not self._machine.handle(Event.SET_FORCE):
            return False
        self._setpoints.set_force(self._in_range(force_n))
        return True

    def _halt(self) -> bool:
        dropped = self.drop()
        if not self._machine.handle(Event.HALT):
            return dropped
        self._setpoints.stop()
        self._recall()
        return True

    def _follow_activation(self) -> None:
        """Update the state with the outcome of an activation."""
        if self._setpoints.activation_waits:
            return
        if self._setpoints.activation_is_sent:
            self._machine.handle(Event.ACTIVATION_SENT)
        elif self._machine.handle(Event.ACTIVATION_OVER):
            self._recall()

    def _recall(self) -> None:
        """Let the last report count again: an activation is over."""
        self._machine.handle(self._reported)

    def _in_range(self, force_n: float) -> float:
        """Return the force of the gripper's that is nearest."""
        least, most = self.force_range_n
        return min(max(force_n, least), most)

    def _register(self, driver: Registration, now_ns: int) -> None:
        if self._setpoints.due_ns is not None:
            self._setpoints.give_up("the driver registered anew")
        self._setpoints.void()
        self._fault, self._setpoints.echo_ok = "", None
        if self.identity not in ("", driver.name):
            self._machine.handle(Event.STRANGER)
            self._driver = None
            self._refuse(_ANOTHER, now_ns)
            return
        self.health.restarts += self.identity != ""
        self._machine.handle(Event.REGISTERED)
        self._driver = driver
        self.identity = driver.name
        self._silent_at_ns = now_ns + SILENCE_NS
        self._notice, self._notice_ns = wire.encode_notice(wire.REGISTERED, driver.name), now_ns

    def _fall_silent(self, now_ns: int) -> None:
        self._silent_at_ns = now_ns + SILENCE_NS
        self._machine.handle(Event.FELL_SILENT)
        self._fault = ""
        if self._driver is None:
            self._refuse(self._refusal or _REGISTER, now_ns)
        if self._setpoints.due_ns is not None:
            self._setpoints.give_up("no report of late")

    def _refuse(self, reason: str, now_ns: int) -> None:
        self._refusal = reason
        self._notice, self._notice_ns = wire.encode_notice(wire.REFUSED, reason), now_ns

    def _is_believed(self, report: Report, driver: Registration) -> bool:
        (low, high), width_m = driver.width_range_m, report.width_m
        in_range = width_m is None or low - WIDTH_TOLERANCE_M <= width_m <= high + WIDTH_TOLERANCE_M
        return in_range and self._setpoints.is_sound(report)

    def _take(self, report: Report, now_ns: int) -> GripperSample:
        if report.id is not None:
            self.health.duplicates += not self._setpoints.take_answer(report, now_ns)
            self._follow_activation()
        self._silent_at_ns = now_ns + SILENCE_NS
        self.health.good += 1
        self._fault = report.fault
        if not report.active:
            self._reported = Event.REPORTED_INACTIVE
        else:
            self._reported = Event.REPORTED_FAULT if report.fault else Event.REPORTED_ACTIVE
        self._machine.handle(self._reported)
        if report.fault or not report.active:
            self._setpoints.lose_grip(report.fault or "not active")
            self._follow_activation()
        if not report.active:
            self._setpoints.void()
        reading = sample(report, now_ns)
        reading.echo_ok = self._setpoints.echo_ok
        return reading


def _check(name: str, value: float, bounds: tuple[float, float]) -> None:
    low, high = bounds
    if not low <= value <= high:  # also where it is no number
        raise ValueError(f"the {name} must be from {low:g} to {high:g}, got {value}")
