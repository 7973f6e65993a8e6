"""Detect gripper faults: reported ones, wrong echoes and forces, lost commands and lost activations."""

from __future__ import annotations

from slipd.types.samples import GripperSample

ECHO_READINGS = 3
"""Wrong echoes in a row that count as a mismatch: a reading that crosses a command still echoes the previous one."""

FORCE_NS, FORCE_FACTOR, FORCE_N = 200_000_000, 3.0, 5.0
"""A gripper that holds cannot exert so much more than it was ever sent in this grip, for so long: an impact is shorter,
and a motor current shows the force only roughly."""

ACTIVATION_NS = 1_000_000_000
"""After this time without an inactive reading an activation was immediate, or never happened."""

COMMAND_LOST = "command_lost"
LINK_LOST = "link_lost"
NO_ANSWER = "no_answer"
ECHO_MISMATCH = "echo_mismatch"
FORCE_MISMATCH = "force_mismatch"
MOTION_IGNORED = "motion_ignored"
ACTIVATION_LOST = "activation_lost"


class GripperFaultDetector:
    """Reports each fault once, when it begins; a fault that was reported again and again could not be acknowledged."""

    def __init__(self) -> None:
        self._fault = ""
        self._wrong_echoes = 0
        self._most_n = 0.0  # sent in this grip
        self._strong_ns = 0  # since when every reading has reported far more; 0: the last one has not
        self._active = False
        self._activation = ""  # "requested", then "under way" from the first inactive reading to the next active one
        self._requested_ns = 0

    def forget(self) -> None:
        """Forget the activation state: the gripper does not answer, so a later reading decides whether it is active."""
        self._active, self._activation = False, ""

    def activate(self, t_ns: int) -> None:
        """Record a requested activation: until it is done, the gripper is inactive and its reports do not count."""
        self._activation, self._requested_ns = "requested", t_ns

    def acknowledge(self) -> None:
        """Record an acknowledgement: an echo or a force that is still wrong is reported again.

        A lost command and a fault of the gripper itself are not reported again. They last until a later command or
        activation, which must be possible.
        """
        self._wrong_echoes = self._strong_ns = 0

    def update(self, sample: GripperSample, sent_n: float | None) -> str:
        """Update with a reading; return the fault that begins with it, or "".

        Args:
            sample: The reading.
            sent_n: Force last sent to the gripper in the grip in force, N; None if there is none.
        """
        if self._activation == "requested" and not sample.active:
            self._activation, self._fault = "under way", ""
        elif sample.active and (self._activation == "under way" or sample.t_ns - self._requested_ns > ACTIVATION_NS):
            self._activation = ""
        self._wrong_echoes = self._wrong_echoes + 1 if sample.echo_ok is False else 0
        self._most_n = 0.0 if sent_n is None else max(self._most_n, sent_n)
        holds = sent_n is not None and sample.object.startswith("contact") and not sample.moving
        strong = holds and (sample.force_n or 0.0) > FORCE_FACTOR * self._most_n + FORCE_N
        self._strong_ns = (self._strong_ns or sample.t_ns) if strong else 0
        began = "" if self._activation == "under way" else self._begun(sample)
        self._fault, self._active = sample.fault, sample.active
        return began

    def _begun(self, sample: GripperSample) -> str:
        if sample.fault and sample.fault != self._fault:
            return sample.fault
        if self._wrong_echoes == ECHO_READINGS:
            return ECHO_MISMATCH
        if self._active and not sample.active:
            return ACTIVATION_LOST
        return FORCE_MISMATCH if self._strong_ns and sample.t_ns - self._strong_ns >= FORCE_NS else ""
