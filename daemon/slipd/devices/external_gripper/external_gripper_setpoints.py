"""What an external driver is asked to do: the states of the session, and the queue of set-points with their answers.

The driver carries out an activation on its own; it is in progress until the driver answers the set-point. While an
activation is queued or in progress, the gripper accepts no motion, whatever the driver reports.
"""

from __future__ import annotations

from slipd.devices.external_gripper import external_gripper_message as wire
from slipd.devices.external_gripper.external_gripper_message import Report
from slipd.devices.shared.command_queue import CommandQueue, QueuedCommand
from slipd.devices.shared.device_interface import DecoderHealth
from slipd.devices.shared.gripper_session import FAULT_REPORTS, MOTIONS, Event, State, Table
from slipd.devices.shared.waiting_commands import SETS_FORCE, STOP

FORCE_TOLERANCE = 1e-6
"""Largest relative excess of the applied force over the requested one; single precision can cause it."""


class SetpointQueue(CommandQueue):
    """Waiting set-points, each with its own id.

    Args:
        answer_ns: Time allowed for an answer.
        health: Its ``lost`` counts unanswered set-points.
    """

    def __init__(self, answer_ns: int, health: DecoderHealth) -> None:
        super().__init__(answer_ns, health)
        self._made = 0

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
"""States of the session; after an activation is over or halted, it handles the last report again."""

ACTIVATION = frozenset({State.ACTIVATION_QUEUED, State.ACTIVATING})
"""In these states the gripper accepts no motion."""
