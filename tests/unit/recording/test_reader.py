"""A recording is read whole; one that is cut off, damaged or foreign is read up to the fault, or refused."""

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from slipd.errors import RecordingError
from slipd.recording.reader import Recording, open_recording


def contents(path: Path) -> tuple[Recording, list]:
    recording = open_recording(path)
    return recording, list(recording.entries())


def about(recording: Recording) -> tuple[object, ...]:
    return recording.config_text, recording.boot, recording.wall_minus_monotonic_ns, recording.versions


def test_a_recording_reads_as_events_as_messages_or_as_both(tmp_path: Path, write, entries) -> None:
    write(tmp_path / "run.mcap", entries(200), 30)
    recording = open_recording(tmp_path / "run.mcap")
    both = list(recording.entries())
    assert both == entries(200)
    assert list(recording.events()) == [(e.t_ns, e.event) for e in both[::2]]
    assert list(recording.messages()) == [(e.topic, e.payload) for e in both[1::2]]
    assert list(recording.entries()) == both, "every pass starts anew"
    assert recording.complete


def test_K2_a_recording_cut_off_anywhere_yields_its_beginning_and_reports_it(tmp_path: Path, write, entries) -> None:
    write(tmp_path / "whole.mcap", entries(60), 20)
    data = (tmp_path / "whole.mcap").read_bytes()
    whole, everything = contents(tmp_path / "whole.mcap")
    lengths = set()
    for end in range(0, len(data), 13):
        (tmp_path / "cut.mcap").write_bytes(data[:end])
        try:
            recording, found = contents(tmp_path / "cut.mcap")
        except RecordingError:
            assert not lengths, "a longer beginning is not readable where a shorter one was"
            continue
        assert found == everything[: len(found)]
        assert not recording.complete
        assert about(recording) == about(whole)
        assert recording.lost == 0
        lengths.add(len(found))
    assert lengths == {0, 20, 40, 60}


def test_a_flipped_bit_is_noticed_or_harmless(tmp_path: Path, write, entries) -> None:
    write(tmp_path / "whole.mcap", entries(60), 20)
    data = (tmp_path / "whole.mcap").read_bytes()
    whole, everything = contents(tmp_path / "whole.mcap")
    noticed = 0
    for place in range(0, len(data), 7):
        damaged = bytearray(data)
        damaged[place] ^= 1 << place % 8
        (tmp_path / "damaged.mcap").write_bytes(damaged)
        try:
            recording, found = contents(tmp_path / "damaged.mcap")
        except RecordingError:
            noticed += 1
            continue
        assert about(recording) == about(whole)
        assert all(item in everything for item in found)
        assert [item.n for item in found] == sorted(item.n for item in found)
        if recording.complete:
            assert found == everything
        else:
            noticed += 1
    assert noticed > 50


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=200, deadline=None)
@given(place=st.floats(0, 1), noise=st.binary(min_size=1, max_size=40), cut=st.integers(0, 40))
def test_K4_noise_in_a_recording_raises_only_recording_errors(
    tmp_path: Path, write, entries, place: float, noise: bytes, cut: int
) -> None:
    path = tmp_path / "whole.mcap"
    if not path.exists():
        write(path, entries(60), 20)
    data = path.read_bytes()
    at = int(place * len(data))
    (tmp_path / "noisy.mcap").write_bytes(data[:at] + noise + data[at + cut :])
    try:
        recording, found = contents(tmp_path / "noisy.mcap")
    except RecordingError:
        return
    assert all(item in entries(60) for item in found)
    assert recording.config_text


@pytest.mark.parametrize(
    ("data", "text"),
    [
        (b"", "is empty"),
        (b"\x89MCA", "not an MCAP file"),
        (b"time,force\n0,1\n", "not an MCAP file"),
        (b"\x89MCAP0\r\n", "an MCAP file, but not a recording of slipd"),
    ],
)
def test_a_file_that_is_not_a_recording_is_refused_with_a_reason(tmp_path: Path, data: bytes, text: str) -> None:
    path = tmp_path / "some.mcap"
    path.write_bytes(data)
    with pytest.raises(RecordingError, match=text) as caught:
        open_recording(path)
    assert str(caught.value).startswith(f"{path}: ")


def test_a_missing_file_and_a_folder_are_refused_with_a_reason(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="No such file"):
        open_recording(tmp_path / "none.mcap")
    with pytest.raises(RecordingError, match="Is a directory"):
        open_recording(tmp_path)
