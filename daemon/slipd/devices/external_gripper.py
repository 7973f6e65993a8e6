"""A gripper that another driver holds: the daemon sends set-points to that driver, and believes its answers or not.

For labs whose own driver speaks to the gripper. One driver is connected at a time; it registers, reports the state of
its gripper all the time, and answers every set-point. The format is written down in docs/devices.md.
"""

from __future__ import annotations

import math
import re

from slipd.devices import Device
from slipd.devices import external_gripper_message as wire
from slipd.devices.commands import Command, Commands
from slipd.devices.external_gripper_message import Foreign, Message, Registration, Report
from slipd.devices.health import DecoderHealth
from slipd.samples import GripperSample

ANSWER_MS = 100
"""For the answer to a set-point: a driver that polls its gripper at 20 Hz can answer within two polls."""
SHORTEST_MS, LONGEST_MS = 5, 1000
SILENCE_NS = 500_000_000
"""A driver that reports nothing for so long has no gripper to be told anything."""
WIDTH_TOLERANCE_M = 0.001
"""Beyond the registered range a width is not believed; a calibration may be off by so much."""
FORCE_TOLERANCE = 1e-6
"""Share by which an applied force may be above the one asked for: what single precision makes of it."""

_BEGIN = re.compile(rb"[\x82-\x8a](?:[\xa1-\xaf]|\Z)")  # a map of so many fields, and a key

_SETS = ("move", "force")
_REGISTER = "a driver registers before all else"
_ANOTHER = "another driver registered here: connect anew"


class Decoder:
    """Makes a gripper sample of every report; ``echo_ok`` is None: `Session` knows what was asked.

    Bytes that are no message are `bad_bytes`, and each stretch of them is one `bad`; so is a message with an unknown
    key, a wrong kind of value, or a number that is not finite or beyond what a gripper can be.
    """

    def __init__(self) -> None:
        self.health = DecoderHealth()
        self._tail = b""
        self._in_garbage = False

    def receive(self, data: bytes, t_ns: int) -> list[GripperSample]:
        """Take bytes received at ``t_ns`` and return the readings they complete."""
        samples = [sample(message, t_ns) for message in self.messages(data) if isinstance(message, Report)]
        self.health.good += len(samples)
        return samples

    def forget(self) -> None:
        """Drop a begun message: the line was closed."""
        self._drop(len(self._tail))
        self._tail = b""

    def messages(self, data: bytes) -> list[Message]:
        """Take bytes and return every message they complete."""
        buffer = self._tail + data
        found: list[Message] = []
        done = at = 0
        while (begin := _BEGIN.search(buffer, at)) is not None:
            at = begin.start()
            length = wire.measure(buffer, at)
            if length == 0:
                break
            message = wire.parse(buffer[at : at + length]) if length > 0 else None
            if message is None:
                at += 1
                continue
            self._drop(at - done)
            self._in_garbage = False
            done = at = at + length
            found.append(message)
        keep = at if begin is not None else len(buffer)
        self._drop(keep - done)
        self._tail = buffer[keep:]
        return found

    def _drop(self, count: int) -> None:
        """Count bytes that are no message."""
        if count:
            self.health.bad_bytes += count
            self.health.bad += not self._in_garbage
            self._in_garbage = True


def sample(report: Report, t_ns: int) -> GripperSample:
    """Return the reading of a report, received at ``t_ns``."""
    return GripperSample(
        t_ns=t_ns,
        device_time_ns=None,
        active=report.active,
        width_m=report.width_m,
        moving=report.moving,
        object=report.object,
        fault=report.fault,
        echo_ok=None,
        force_n=report.force_n,
    )


class Session:
    """Takes a driver's registration and reports, and sends it set-points, one at a time.

    `state` is "closed", "waiting" (for the registration), "inactive", "active", a fault, "no reply" (no report of
    late), "command lost" with the reason, or why the driver was refused. `identity` is the name that it registered.
    A driver may register again by the same name; under another the connection tells nobody anything until it does.
    `health.lost` counts unanswered set-points, `duplicates` answers to none, `restarts` registrations after the first;
    a report that lies (before a registration, of a width beyond the registered range, an answer without the applied
    force) is `bad` and not believed.

    ``echo_ok`` of a sample: the force that the driver says it applied last is not above the one it was told.

    Args:
        answer_ms: How long the answer to a set-point may take, 5 to 1000 ms; then it is sent again, with its id.

    Raises:
        ValueError: The time is out of range or no integer.
    """

    def __init__(self, answer_ms: int = ANSWER_MS) -> None:
        if not (isinstance(answer_ms, int) and SHORTEST_MS <= answer_ms <= LONGEST_MS):
            raise ValueError(f"answer_ms {answer_ms!r} is none: an integer from {SHORTEST_MS} to {LONGEST_MS} is")
        self.decoder = Decoder()
        self.health = self.decoder.health
        self._commands = Commands(answer_ms * 1_000_000, self.health)
        self._sent = 0
        self._open = False
        self._reset()

    def _reset(self) -> None:
        self.decoder.forget()
        self._commands.reset()
        self.identity = ""
        self._driver: Registration | None = None
        self._sample: GripperSample | None = None
        self._refusal = ""
        self._goal: dict[str, float | None] = {}
        self._echo_ok: bool | None = None
        self._notice = b""
        self._notice_ns = 0
        self._silent = False
        self._silent_at_ns = 0

    @property
    def command_lost(self) -> bool:
        """The last set-point was refused by the driver, or never answered."""
        return bool(self._commands.trouble)

    @property
    def state(self) -> str:
        """A short word for people."""
        if not self._open:
            return "closed"
        if self._driver is None:
            return f"refused: {self._refusal}" if self._refusal else "waiting"
        if self._sample is None:
            return "no reply" if self._silent else "waiting"
        if self.command_lost:
            return f"command lost: {self._commands.trouble}"
        return self._sample.fault or ("active" if self._sample.active else "inactive")

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
        """Begin with a driver that has just connected: it speaks first."""
        self._reset()
        self._open = True
        self._silent_at_ns = now_ns + SILENCE_NS
        return b""

    def stop(self) -> bytes:
        """End. The driver sees that the connection ends, and keeps what it holds."""
        self._reset()
        self._open = False
        return b""

    @property
    def force_told_n(self) -> float | None:
        """The force of the last set-point that was sent or waits; None where there was none while active."""
        return self._commands.force

    def applied_n(self, force_n: float) -> float:
        """Return ``force_n``: what is asked for is told as it is."""
        return force_n

    def activate(self, now_ns: int) -> None:
        """Ask the driver to make its gripper ready, whatever that takes."""
        if self._sample is not None:
            self._commands.replace([self._command("activate")])

    def move(self, width_m: float, speed_mps: float | None, force_n: float) -> float | None:
        """Ask for a width, with a speed (None: the driver's own) and a force, N on one pad.

        Returns:
            The force that the driver is told, never above ``force_n`` but for its least; None, and nothing will be
            sent, where it reports no gripper that is active and without fault.

        Raises:
            ValueError: The gripper has no such width or speed, or the force is no number.
        """
        told = self._told(force_n)
        if told is None:
            return None
        if speed_mps is not None:
            _check("speed", speed_mps, self.speed_range_mps or (0.0, 0.0))
        _check("width", width_m, self.width_range_m)
        self._goal = {"width_m": width_m, "speed_mps": speed_mps}
        self._commands.replace([self._command("move", force_n=told, **self._goal)])
        return told

    def set_force(self, force_n: float) -> float | None:
        """Ask for another force, and no other motion; where a move waits, it goes with that force. See `move`."""
        told = self._told(force_n)
        if told is not None:
            moves = any(command.kind == "move" for command in self._commands.waiting)
            setpoint = (
                self._command("move", force_n=told, **self._goal) if moves else self._command("force", force_n=told)
            )
            self._commands.replace([setpoint], keep=self._stops())
        return told

    def halt(self) -> bool:
        """Ask the fingers to stop where they are, before all else; False where the gripper is not active."""
        if self._sample is None or not self._sample.active:
            return self.drop()  # an activation
        self._commands.interrupt(self._command("stop"))
        return True

    def drop(self) -> bool:
        """Forget what was not sent yet but for a stop; what is unanswered is not repeated."""
        return self._commands.drop(("stop",))

    def acknowledge(self) -> None:
        """Forget that a set-point was lost, and tell the driver that the fault it reports was seen."""
        self._commands.trouble = ""
        if self._sample is not None and self._sample.fault:
            self._commands.replace([self._command("acknowledge")], keep=self._stops())

    def receive(self, data: bytes, now_ns: int) -> list[GripperSample]:
        """Take bytes received at ``now_ns`` and return the readings they complete."""
        samples = []
        for message in self.decoder.messages(data):
            if isinstance(message, Registration):
                self._register(message, now_ns)
            elif isinstance(message, Foreign):
                self.health.bad += 1
                self._refuse(f"version {message.version} of the format is not spoken here: {wire.VERSION} is", now_ns)
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
        due = [self._notice_ns if self._notice else None, self._commands.due_ns, self._silent_at_ns]
        return min(time_ns for time_ns in due if time_ns is not None) if self._open else None

    def on_time(self, now_ns: int) -> bytes:
        """Return the notice or set-point that is due at ``now_ns``; empty when none is."""
        if now_ns >= self._silent_at_ns:
            self._fall_silent(now_ns)
        notice, self._notice = self._notice, b""
        return notice + self._commands.on_time(now_ns)

    def _command(self, operation: str, **values: float | None) -> Command:
        self._sent += 1
        data = wire.encode_setpoint(self._sent, operation, **values)
        return Command(operation, operation, data, values.get("force_n"), self._sent, operation == "activate")

    def _stops(self) -> list[Command]:
        return [command for command in self._commands.waiting if command.kind == "stop"]

    def _told(self, force_n: float) -> float | None:
        """Return the force that the driver can be told; None where it can be told nothing."""
        if not math.isfinite(force_n):
            raise ValueError(f"a force of {force_n} N cannot be asked for: a finite one can")
        if self._sample is None or not self._sample.active or self._sample.fault:
            return None
        least, most = self.force_range_n
        return min(max(force_n, least), most)

    def _register(self, driver: Registration, now_ns: int) -> None:
        if self._commands.due_ns is not None:
            self._commands.give_up("the driver registered anew")
        self._commands.void()
        self._sample, self._echo_ok = None, None
        if self.identity not in ("", driver.name):
            self._driver = None
            self._refuse(_ANOTHER, now_ns)
            return
        self.health.restarts += self.identity != ""
        self._driver = driver
        self._silent = False
        self.identity = driver.name
        self._silent_at_ns = now_ns + SILENCE_NS
        self._notice, self._notice_ns = wire.encode_notice(wire.REGISTERED, driver.name), now_ns

    def _fall_silent(self, now_ns: int) -> None:
        self._silent_at_ns = now_ns + SILENCE_NS
        self._silent = True
        self._sample = None
        if self._driver is None:
            self._refuse(self._refusal or _REGISTER, now_ns)
        if self._commands.due_ns is not None:
            self._commands.give_up("no report of late")

    def _refuse(self, reason: str, now_ns: int) -> None:
        self._refusal = reason
        self._notice, self._notice_ns = wire.encode_notice(wire.REFUSED, reason), now_ns

    def _is_believed(self, report: Report, driver: Registration) -> bool:
        low, high = driver.width_range_m
        width_m, command = report.width_m, self._commands.outstanding
        answers = command is not None and report.id == command.number and command.kind in _SETS
        if answers and report.applied_n is None and not report.error:
            return False
        return width_m is None or low - WIDTH_TOLERANCE_M <= width_m <= high + WIDTH_TOLERANCE_M

    def _take(self, report: Report, now_ns: int) -> GripperSample:
        if report.id is not None:
            self._take_answer(report, now_ns)
        reading = sample(report, now_ns)
        reading.echo_ok = self._echo_ok
        self._sample = reading
        self._silent_at_ns = now_ns + SILENCE_NS
        self.health.good += 1
        if (report.fault or not report.active) and self._commands.holds(_SETS):
            self._commands.give_up(report.fault or "not active")
        if not report.active:
            self._commands.void()
        return reading

    def _take_answer(self, report: Report, now_ns: int) -> None:
        command = self._commands.outstanding
        if command is None or report.id != command.number:
            self.health.duplicates += 1
            return
        self._commands.answered(now_ns, f"{command.name}: {report.error}" if report.error else "")
        if command.kind in _SETS and report.applied_n is not None:
            self._echo_ok = report.applied_n <= (command.force or 0.0) * (1.0 + FORCE_TOLERANCE)


def _check(name: str, value: float, bounds: tuple[float, float]) -> None:
    low, high = bounds
    if not low <= value <= high:  # also where it is no number
        raise ValueError(f"a {name} of {value} cannot be asked for: {low:g} to {high:g} can")


DEVICE = Device("external_gripper", "gripper", ("local",), Decoder, Session, rates_hz=(1.0, 1000.0))
