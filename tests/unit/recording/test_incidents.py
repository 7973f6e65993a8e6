"""What happened before a warning is saved: the last seconds, no more often than allowed, and the file replays."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from pathlib import Path
from unittest.mock import Mock

import pytest
from recorded_entries import ABOUT_RUN, complete, small_disk

from slipd import config
from slipd.config import Incidents as Limits
from slipd.errors import RecordingError
from slipd.events import Bytes, IncidentsChanged, Publish, Record, Tick, WallClock
from slipd.recording import incidents as module
from slipd.recording.entry_walk import Entry
from slipd.recording.incidents import Incidents
from slipd.recording.mcap_file import EVENTS, RecordingFile
from slipd.recording.run_files import RunFiles
from slipd.recording.run_recordings import RunRecordings

SECOND_NS = 1_000_000_000
WARNING = {"finger": "left", "level": "warning", "previous": "stable"}


def name_at(t_ns: int) -> str:
    return f"{WallClock(0).stamp(t_ns)}-b00t"


def nothing() -> None:
    """There is room."""


def full() -> None:
    raise RecordingError("no room")


def incidents(folder: Path, prepare: Callable[[], None] = nothing, **limits: object) -> Incidents:
    return Incidents(
        RunFiles(folder, "b00t"),
        Limits(**limits),
        name_at,
        lambda path, first: RecordingFile(path, ABOUT_RUN, first=first),
        prepare,
    )


def called(number: int, second: int, what: str) -> str:
    return f"incident-{number:06}-{name_at(second * SECOND_NS)}-{what}.mcap"


def files(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.glob("*.mcap"))


def test_a_warning_saves_what_came_before_and_after_it_and_no_later_one_within_the_pause(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    kept = incidents(tmp_path, after_s=2.0, pause_s=60.0)
    for n in range(200):
        t_ns = n * SECOND_NS
        kept.add(EVENTS, Bytes("left.wrench", bytes([n])), t_ns)
        kept.add("status", b"\x80", t_ns)
        if n in (5, 6, 7, 100, 199):
            kept.note_warning(WARNING, t_ns)
    kept.close()
    assert files(tmp_path) == [called(k, n, "left-warning") for k, n in enumerate((5, 100, 199), 1)]
    saved = [complete(tmp_path / name) for name in files(tmp_path)]
    assert [[entry.n for entry in entries] for entries in saved] == [list(range(len(entries))) for entries in saved]
    assert [entries[-1].t_ns // SECOND_NS for entries in saved] == [7, 102, 199]
    assert "incidents within 60 s of the last saved one, not saved: 2" in caplog.text
    assert caplog.text.count("incidents within") == 1, "nothing is said where none was left out"


@pytest.mark.parametrize(
    ("least", "level", "previous", "name"),
    [
        ("warning", "caution", "stable", None),
        ("warning", "stable", "warning", None),
        ("warning", "unknown", "warning", None),
        ("warning", "no_contact", "stable", None),
        ("warning", "no_contact", "slipping", "left-contact_lost"),
        ("warning", "slipping", "stable", "left-slipping"),
        ("slipping", "warning", "stable", None),
        ("caution", "caution", "stable", "left-caution"),
    ],
)
def test_the_level_decides_what_is_an_incident(
    tmp_path: Path, least: str, level: str, previous: str, name: str | None
) -> None:
    kept = incidents(tmp_path, level=least)
    kept.note_warning({"finger": "left", "level": level, "previous": previous}, 0)
    kept.close()
    assert files(tmp_path) == ([called(1, 0, name)] if name else [])


def test_a_grasp_that_loses_its_object_is_saved_once_also_after_its_warning(tmp_path: Path) -> None:
    kept = incidents(tmp_path, after_s=5.0, pause_s=60.0)
    for second, state, since in ((1, "held", 1), (3, "lost", 3), (4, "unknown", 4), (5, "lost", 3), (70, "lost", 70)):
        t_ns = second * SECOND_NS
        kept.add(EVENTS, Bytes("left.wrench", b"x"), t_ns)
        if second == 1:
            kept.note_warning(WARNING, t_ns)
        kept.note_grasp({"state": state, "state_t_ns": since}, t_ns)
    kept.close()
    names = (1, "left-warning"), (3, "grasp-lost"), (70, "grasp-lost")
    assert files(tmp_path) == [called(number, *name) for number, name in enumerate(names, 1)]


def test_what_is_saved_and_lost_is_reported_once_at_most_every_second(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MOST_BYTES", 300)
    prepare = iter([full, nothing])
    kept = incidents(tmp_path, lambda: next(prepare)(), pause_s=1.0)
    assert kept.follow(0, tuple) == IncidentsChanged(0, 0, 0, 0, "", "")
    assert kept.follow(2 * SECOND_NS, tuple) is None
    monkeypatch.setattr(module, "QUEUE_LIMIT", 0)
    kept.add("status", b"x", 0)
    assert kept.follow(SECOND_NS // 2, tuple) is None, "too soon"
    assert kept.follow(2 * SECOND_NS, tuple) == IncidentsChanged(0, 0, 1, 0, "", "")
    monkeypatch.setattr(module, "QUEUE_LIMIT", 1000)
    first = Mock(return_value=())
    for n in range(100):
        kept.add("status", os.urandom(40), n * SECOND_NS)
        kept.follow(n * SECOND_NS, first)
    assert first.call_count == 97, "at 2 s it was asked already; then once a second"
    kept.note_warning(WARNING, SECOND_NS)
    kept.note_grasp({"state": "lost", "state_t_ns": 7}, 2 * SECOND_NS)
    kept.close()
    change = kept.follow(200 * SECOND_NS, tuple)
    assert 0 < change.dropped < 100
    assert change == IncidentsChanged(1, 1, 1, change.dropped, str(tmp_path / called(1, 2, "grasp-lost")), "")


@pytest.mark.parametrize(
    ("prepare", "number", "reason"), [(full, "", "no room"), (nothing, "000001-", "File too large")]
)
def test_a_disk_without_room_or_that_fails_costs_the_file_only(
    tmp_path: Path, prepare: Callable[[], None], number: str, reason: str, caplog: pytest.LogCaptureFixture
) -> None:
    kept = incidents(tmp_path, prepare)
    for n in range(1000):
        kept.add(EVENTS, Bytes("left.wrench", bytes(range(n % 256))), n)
    kept.note_warning(WARNING, 1)
    with small_disk(5000):
        kept.close()
    assert f"incident-{number}19700101T000000Z-b00t-left-warning.mcap: not saved: {reason}" in caplog.text
    assert files(tmp_path) == []


@pytest.mark.parametrize(
    ("enabled", "saved"), [(True, ["asked.mcap", "grasp-lost.mcap", "left-warning.mcap"]), (False, ["asked.mcap"])]
)
def test_of_all_messages_of_a_run_a_warning_and_a_loss_are_incidents(
    tmp_path: Path, rig: str, enabled: bool, saved: list[str]
) -> None:
    table = f'[recording]\ndirectory = "{tmp_path}"\n[recording.incidents]\nenabled = {str(enabled).lower()}\n'
    recordings = RunRecordings(config.parse(f"{rig}\n{table}", "rig.toml"), "b00t", WallClock(0), None)
    recordings.open(0)
    recordings.handle(Record("asked.mcap"), 0)
    recordings.event(Tick(7), 0)
    for topic, body in (("status", {}), ("warning", WARNING), ("grasp", {"state": "lost", "state_t_ns": 1})):
        recordings.published(Publish(topic, body), b"\x80", 0)
    recordings.close()
    assert sorted(name.rpartition("b00t-")[2] for name in files(tmp_path)) == saved
    assert [complete(tmp_path / name)[0] for name in files(tmp_path)] == [Entry(0, 0, EVENTS, Tick(7))] * len(saved)


@pytest.mark.parametrize("started", [True, False])
def test_the_file_of_a_whole_run_is_kept_only_if_the_run_began(tmp_path: Path, rig: str, started: bool) -> None:
    recordings = RunRecordings(config.parse(rig, "rig.toml"), "b00t", WallClock(0), tmp_path / "run.mcap")
    recordings.open(0)
    recordings.event(Tick(7), 0)
    if started:
        recordings.kept = True
    recordings.close()
    assert [complete(path) for path in tmp_path.iterdir()] == [[Entry(0, 0, EVENTS, Tick(7))]] * started
