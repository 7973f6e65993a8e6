"""What goes wrong with a gripper: which of its readings, and what else, is a fault that must be looked at."""

from __future__ import annotations

from slipd.samples import GripperSample

#: A gripper repeats the command before in the reading that crosses it; three in a row are a mismatch.
ECHO_READINGS = 3

#: An activation during which no reading said "inactive" for so long was done at once, or was none.
ACTIVATION_NS = 1_000_000_000

COMMAND_LOST = "command_lost"
LINK_LOST = "link_lost"
NO_ANSWER = "no_answer"
ECHO_MISMATCH = "echo_mismatch"
ACTIVATION_LOST = "activation_lost"


class GripperFaultDetector:
    """Tells each fault once, when it begins: what is told again and again could never be acknowledged."""

    def __init__(self) -> None:
        self._fault = ""
        self._wrong_echoes = 0
        self._active = False
        self._activation = ""  # "asked", then "under way" from the first inactive reading to the next active one
        self._asked_ns = 0
        self._command_lost = False

    def forget(self) -> None:
        """Nothing is heard of the gripper any more: whether it stays active is for a later reading to say."""
        self._active, self._activation = False, ""

    def activate(self, t_ns: int) -> None:
        """An activation was asked for: the gripper is inactive, and reports what it likes, until it is done."""
        self._activation, self._asked_ns = "asked", t_ns

    def acknowledge(self) -> None:
        """What was told was looked at: an echo that is still wrong is told anew.

        A command stays lost, and a fault of the gripper's own stays, until a later command or activation ends it: that
        must be possible, so they are not told again.
        """
        self._wrong_echoes = 0

    def update(self, sample: GripperSample) -> str:
        """Takes a reading; returns the fault that begins with it, "" for none."""
        if self._activation == "asked" and not sample.active:
            self._activation, self._fault = "under way", ""
        elif sample.active and (self._activation == "under way" or sample.t_ns - self._asked_ns > ACTIVATION_NS):
            self._activation = ""
        self._wrong_echoes = self._wrong_echoes + 1 if sample.echo_ok is False else 0
        began = "" if self._activation == "under way" else self._begun(sample)
        self._fault, self._active = sample.fault, sample.active
        return began

    def update_command(self, *, lost: bool) -> str:
        """Takes whether the last command was lost; returns the fault where it has just been."""
        began = lost and not self._command_lost
        self._command_lost = lost
        return COMMAND_LOST if began else ""

    def _begun(self, sample: GripperSample) -> str:
        if sample.fault and sample.fault != self._fault:
            return sample.fault
        if self._wrong_echoes == ECHO_READINGS:
            return ECHO_MISMATCH
        return ACTIVATION_LOST if self._active and not sample.active else ""
