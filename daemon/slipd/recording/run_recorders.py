"""All recordings of one run: those on request, that of the whole run, and the last seconds before an incident."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from slipd.config import Config
from slipd.events import Event, FirstEvents, Publish, Record
from slipd.recording.incidents import Incidents
from slipd.recording.mcap_file import EVENTS, RecordingFile, check_new
from slipd.recording.requested_recordings import (
    RecorderWatch,
    RequestedRecordings,
    check_room,
    private_directory,
    state_dir,
)
from slipd.recording.run_files import KIND, ContinuousRecording, RunFiles, run_name
from slipd.recording.writer import Recorder, Room
from slipd.types.clocks import WallClock
from slipd_client.messages import GRASP_TOPIC, WARNING_TOPIC

T = TypeVar("T")


class RunRecorders:
    """Pass events and messages to every recording, and report what becomes of the files.

    Args:
        config: The rig.
        boot: Id of the run.
        wall: Wall clock of the run.
        record: New file of the whole run; None: the config decides.

    Attributes:
        kept: The file of the whole run is worth keeping; it is deleted otherwise.

    Raises:
        RecordingError: The new file exists already, or cannot be created.
    """

    def __init__(self, config: Config, boot: str, wall: WallClock, record: Path | None) -> None:
        self._config, self._boot, self._wall, self._record = config, boot, wall, record
        self._folder = Path(config.recording.directory or state_dir())
        self._all: list[Recorder | RequestedRecordings | Incidents] = []
        self._whole: RecorderWatch | None = None
        self._continuous: ContinuousRecording | None = None
        self._incidents: Incidents | None = None
        self._stack = ExitStack()
        self.kept = False
        if record is not None:
            check_new(record)

    def open(self, t_ns: int) -> None:
        """Create what records from the start of the run; call it once the run can start."""
        limits = self._config.recording
        least, most = limits.min_free_bytes, sys.maxsize
        room = Room(limits.max_bytes, least)
        check = partial(check_room, self._folder, room, limits.max_files)
        make = partial(self._begin, Recorder, room=room, prepare=partial(self._prepare, check))
        self._requested = self._add(RequestedRecordings(self._folder, make))
        files = self._stack.enter_context(closing(RunFiles(self._folder, self._boot)))
        names = run_name(self._boot, self._wall)
        if self._record is not None:
            recorder = self._begin(Recorder, self._record)
            self._whole = RecorderWatch("", recorder, t_ns)
            self._all.append(recorder)
            self._stack.callback(self._close_whole, self._whole)
        elif limits.continuous.enabled:
            rule = limits.continuous
            tidy = partial(files.delete_oldest, KIND, rule.keep_files - 1, rule.keep_bytes - rule.file_bytes)
            prepare = partial(self._prepare, tidy)
            make = partial(self._begin, Recorder, room=Room(most, least), prepare=prepare, place=files.place)
            self._continuous = self._add(ContinuousRecording(self._folder, make, rule, names))
        if limits.incidents.enabled:
            prepare = partial(self._prepare, partial(check_room, self._folder, Room(most, least), most))
            create = partial(self._begin, RecordingFile)
            self._incidents = self._add(Incidents(files, limits.incidents, names, create, prepare))

    def _add(self, recorder: T) -> T:
        self._all.append(recorder)  # type: ignore[arg-type]
        self._stack.enter_context(closing(recorder))  # type: ignore[type-var]
        return recorder

    def _prepare(self, then: Callable[[], None]) -> None:
        private_directory(self._folder)
        then()

    def _begin(self, kind: Callable[..., T], path: Path, **options: Any) -> T:
        """Return a recorder or file that begins now, with what its head says of the run."""
        wall_ns = self._wall.minus_monotonic_ns
        return kind(path, config_text=self._config.text, boot=self._boot, wall_minus_monotonic_ns=wall_ns, **options)

    def _close_whole(self, whole: RecorderWatch) -> None:
        if not self.kept:
            whole.recorder.discard()
        whole.close()

    def close(self) -> None:
        """Finish every file."""
        self._stack.close()

    def event(self, event: Event, t_ns: int) -> None:
        """Record an event that enters the engine at ``t_ns``."""
        for recorder in self._all:
            recorder.add(EVENTS, event, t_ns)

    def published(self, message: Publish, payload: bytes, t_ns: int) -> None:
        """Record the bytes that were published; a warning or a loss saves the last seconds."""
        for recorder in self._all:
            recorder.add(message.topic, payload, t_ns)
        if self._incidents is not None and message.topic == WARNING_TOPIC:
            self._incidents.note_warning(message.body, t_ns)
        elif self._incidents is not None and message.topic == GRASP_TOPIC:
            self._incidents.note_grasp(message.body, t_ns)

    def handle(self, record: Record, t_ns: int) -> None:
        """Start or end a recording on request."""
        self._requested.handle(record, t_ns)

    def changes(self, t_ns: int, first: Callable[[], FirstEvents]) -> Iterator[Event]:
        """Yield the changes that the engine must know, each once.

        Args:
            t_ns: Now, CLOCK_MONOTONIC.
            first: Returns the events that precede a file that begins now.
        """
        if self._whole is not None and (change := self._whole.poll(t_ns)):
            yield change
        if self._continuous is not None:
            yield from self._continuous.follow(t_ns, first)
        if self._incidents is not None and (saved := self._incidents.follow(t_ns, first)):
            yield saved
        yield from self._requested.changes(t_ns)
