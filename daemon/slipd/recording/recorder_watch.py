"""Reports the state of a recorder to the log and, as events, to the engine."""

from __future__ import annotations

import logging

from slipd.events import RecordingChanged
from slipd.recording.writer import CLOSE_LIMIT_S, Recorder

LOSSES_PERIOD_NS = 1_000_000_000
"""Shortest time between two reports of lost entries."""

START_LIMIT_NS = 500_000_000
"""How long the disk may take to create a file before its recording is given up."""

_log = logging.getLogger(__name__)


class RecorderWatch:
    """Polls a recorder; each change is logged and returned once.

    Args:
        name: Name of the recording, "" for that of the whole run.
        recorder: The recorder.
        t_ns: When it was started, CLOCK_MONOTONIC.
    """

    def __init__(self, name: str, recorder: Recorder, t_ns: int) -> None:
        self.recorder = recorder
        self._name = name
        self._started_ns = t_ns
        self._reported: RecordingChanged | None = None
        self._losses_due_ns = t_ns

    @property
    def over(self) -> bool:
        """Whether the end of a recording that ended by itself has been reported."""
        return self._reported is not None and self._reported.state != "running"

    def poll(self, t_ns: int) -> RecordingChanged | None:
        """Return what changed since the last report; None if nothing did.

        A file that the disk does not create in time is given up; its recorder removes it as soon as it can.
        """
        change = self._state(t_ns)
        before = self._reported
        if change is None or change == before or self.over:  # `close` reports what is lost after the end
            return None
        if before is not None and change.state == before.state and t_ns < self._losses_due_ns:
            return None
        self._reported = change
        self._losses_due_ns = t_ns + LOSSES_PERIOD_NS
        _log_change(change)
        return change

    def close(self, within_s: float = CLOSE_LIMIT_S) -> None:
        """Finish the recorder, and log what was lost.

        Args:
            within_s: How long the disk may take, s.

        Raises:
            RecordingError: The disk failed, now or before.
        """
        self.recorder.close(within_s)
        recorder = self.recorder
        if recorder.lost:
            line = "%s: %d entries are missing: the disk was too slow"
            _log.warning(line, recorder.path, recorder.lost, extra={"slipd_recording": recorder.path})

    def _state(self, t_ns: int) -> RecordingChanged | None:
        recorder, name, path = self.recorder, self._name, str(self.recorder.path)
        if recorder.failure is not None:
            return RecordingChanged(name, path, "failed", recorder.failure, recorder.lost)
        if recorder.limit is not None:
            return RecordingChanged(name, path, "limited", recorder.limit, recorder.lost)
        if recorder.begun:
            return RecordingChanged(name, path, "running", "", recorder.lost)
        if t_ns - self._started_ns < START_LIMIT_NS:
            return None
        recorder.discard()
        reason = f"{path}: the disk did not create the file within {START_LIMIT_NS * 1e-9:g} s"
        return RecordingChanged(name, path, "failed", reason)


def _log_change(change: RecordingChanged) -> None:
    fields = {"slipd_recording": change.path}
    if change.state == "failed":
        _log.error("%s", change.reason, extra=fields | {"slipd_fault": "recording-failed"})
    elif change.state == "limited":
        _log.warning("%s", change.reason, extra=fields | {"slipd_fault": "recording-limited"})
    elif change.lost:
        _log.warning("%s: %d entries lost so far: the disk is too slow", change.path, change.lost, extra=fields)
    else:
        _log.info("%s: recording", change.path, extra=fields)
