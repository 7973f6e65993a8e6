import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from project import TRIAL

from slipd.devices.xela import Decoder
from slipd.errors import ConfigError, RecordingError, SlipdError
from slipd.events import Bytes, LinkUp, Tick
from slipd.recording.reader import open_recording
from slipd.tools.recordings.grips_import import import_trial

LAST_NS = 5_751_000_000


@pytest.fixture
def trial(tmp_path: Path) -> Path:
    """A copy of the trial, to be damaged."""
    return Path(shutil.copytree(TRIAL, tmp_path / "trial"))


@pytest.fixture
def refused(trial: Path, tmp_path: Path, two_pads: str) -> Callable[[str], None]:
    """Check that the import of the damaged trial is refused with this text and leaves no file."""

    def refused(text: str) -> None:
        with pytest.raises(RecordingError) as caught:
            import_trial(trial, tmp_path / "out.mcap", two_pads)
        assert str(caught.value) == str(trial / text)
        assert list(tmp_path.iterdir()) == [trial]

    return refused


def spoil(path: Path, line: int, column: int, cell: str) -> None:
    """Replace one cell; lines count from 1, columns from 0."""
    rows = [row.split(",") for row in path.read_text().splitlines()]
    rows[line - 1][column] = cell
    path.write_text("\n".join(map(",".join, rows)))


def test_a_trial_becomes_the_events_of_a_live_run(tmp_path: Path, two_pads: str) -> None:
    import_trial(TRIAL, tmp_path / "out.mcap", two_pads)
    recording = open_recording(tmp_path / "out.mcap")
    events = list(recording.events())
    assert recording.complete
    assert recording.config_text == two_pads
    assert events[:2] == [
        (1_000_000_000, LinkUp("left.pad", "ws://127.0.0.1:5000")),
        (1_000_000_000, Bytes("left.pad", b'{"message":"Welcome"}')),
    ]
    times_ns = [t_ns for t_ns, _ in events]
    assert times_ns == sorted(times_ns)
    ticks_ns = [t_ns for t_ns, event in events if isinstance(event, Tick)]
    assert ticks_ns == list(range(1_000_000_000, LAST_NS + 500_000_000, 10_000_000))
    assert list(recording.messages()) == []


def test_the_decoder_reads_every_count_of_every_row_at_its_time(tmp_path: Path, two_pads: str) -> None:
    import_trial(TRIAL, tmp_path / "out.mcap", two_pads)
    decoder = Decoder()
    samples = [
        sample
        for t_ns, event in open_recording(tmp_path / "out.mcap").events()
        if isinstance(event, Bytes)
        for sample in decoder.receive(event.data, t_ns)
    ]
    assert (decoder.health.bad, decoder.health.lost, decoder.health.bad_bytes) == (0, 0, 0)
    times_s = np.loadtxt(TRIAL / "robot_state.csv", skiprows=1)
    for key, name in (("1", "xela_sensor1.csv"), ("2", "xela_sensor2.csv")):
        of_pad = [sample for sample in samples if sample.source == key]
        counts = np.loadtxt(TRIAL / name, delimiter=",", skiprows=1)
        np.testing.assert_array_equal([sample.values.ravel() for sample in of_pad], counts)
        np.testing.assert_allclose([sample.t_ns / 1e9 - 1.0 for sample in of_pad], times_s, atol=1e-9)
        assert [sample.device_time_ns for sample in of_pad] == [sample.t_ns for sample in of_pad]


def test_other_columns_and_their_order_do_not_matter(trial: Path, tmp_path: Path, two_pads: str) -> None:
    times = (trial / "robot_state.csv").read_text().split()
    (trial / "robot_state.csv").write_text("\n".join(f"{i},{time},x" for i, time in enumerate(times)))
    import_trial(TRIAL, tmp_path / "reduced.mcap", two_pads)
    import_trial(trial, tmp_path / "whole.mcap", two_pads)
    reduced, whole = open_recording(tmp_path / "reduced.mcap"), open_recording(tmp_path / "whole.mcap")
    assert list(whole.entries()) == list(reduced.entries())


@pytest.mark.parametrize("name", ["xela_sensor1.csv", "xela_sensor2.csv", "robot_state.csv"])
def test_a_missing_file_is_named(trial: Path, refused: Callable[[str], None], name: str) -> None:
    (trial / name).unlink()
    refused(f"{name}: cannot be read: No such file or directory")


@pytest.mark.parametrize(
    ("cell", "text"),
    [
        ("16305.5", "an integer from 0 to 65535, got '16305.5'"),
        ("-1", "an integer from 0 to 65535, got '-1'"),
        ("65536.0", "an integer from 0 to 65535, got '65536.0'"),
        ("high", "a finite number, got 'high'"),
        ("nan", "a finite number, got 'nan'"),
        ("1e999", "a finite number, got '1e999'"),
        ("", "a finite number, got ''"),
    ],
)
def test_an_invalid_count_is_reported_with_file_and_line(
    trial: Path, refused: Callable[[str], None], cell: str, text: str
) -> None:
    spoil(trial / "xela_sensor2.csv", 17, 4, cell)
    refused(f"xela_sensor2.csv:17: txl2_y must be {text}")


def test_a_missing_column_is_named(trial: Path, refused: Callable[[str], None]) -> None:
    spoil(trial / "xela_sensor1.csv", 1, 5, "txl2_w")
    refused("xela_sensor1.csv:1: must have one column 'txl2_z', got 0")


def test_a_duplicate_column_is_named(trial: Path, refused: Callable[[str], None]) -> None:
    spoil(trial / "xela_sensor1.csv", 1, 4, "txl2_x")
    refused("xela_sensor1.csv:1: must have one column 'txl2_x', got 2")


def test_a_truncated_row_is_reported_with_file_and_line(trial: Path, refused: Callable[[str], None]) -> None:
    whole = (trial / "xela_sensor1.csv").read_text()
    (trial / "xela_sensor1.csv").write_text(whole[:-30])
    refused("xela_sensor1.csv:286: must have 48 cells, as the header, got 45")


def test_a_pad_with_another_number_of_rows_than_times_is_refused(trial: Path, refused: Callable[[str], None]) -> None:
    rows = (trial / "xela_sensor2.csv").read_text().splitlines()
    (trial / "xela_sensor2.csv").write_text("\n".join(rows[:-2]))
    refused("xela_sensor2.csv: must have as many rows as robot_state.csv, 285, got 283")


@pytest.mark.parametrize(
    ("cell", "text"),
    [
        ("0.001", "must not decrease, got '0.001'"),
        ("4751", "must be in seconds, within an hour of the first row, got '4751'"),
        ("soon", "must be a finite number, got 'soon'"),
    ],
)
def test_an_invalid_time_is_reported_with_file_and_line(
    trial: Path, refused: Callable[[str], None], cell: str, text: str
) -> None:
    spoil(trial / "robot_state.csv", 50, 0, cell)
    refused(f"robot_state.csv:50: time {text}")


@pytest.mark.parametrize("data", [b"", b"time\n"])
def test_a_trial_without_rows_is_refused(trial: Path, tmp_path: Path, two_pads: str, data: bytes) -> None:
    (trial / "robot_state.csv").write_bytes(data)
    with pytest.raises(RecordingError, match=r"robot_state\.csv"):
        import_trial(trial, tmp_path / "out.mcap", two_pads)
    assert not (tmp_path / "out.mcap").exists()


@pytest.mark.parametrize("data", [b"time\n\xff\n", b'time\n"0\n', b"\x00\x89PNG"])
def test_a_file_that_is_not_csv_is_refused(trial: Path, tmp_path: Path, two_pads: str, data: bytes) -> None:
    (trial / "robot_state.csv").write_bytes(data)
    with pytest.raises(RecordingError, match=r"robot_state\.csv"):
        import_trial(trial, tmp_path / "out.mcap", two_pads)
    assert not (tmp_path / "out.mcap").exists()


def test_a_config_with_faults_is_refused(tmp_path: Path, two_pads: str) -> None:
    with pytest.raises(ConfigError, match="rowz"):
        import_trial(TRIAL, tmp_path / "out.mcap", two_pads.replace("rows", "rowz"))


@pytest.mark.parametrize(
    ("old", "new"), [('sensor = "2"', 'sensor = "3"'), ("ws://127.0.0.1:5000", "ws://127.0.0.1:5001")]
)
def test_a_config_with_other_sensors_or_addresses_is_refused(tmp_path: Path, two_pads: str, old: str, new: str) -> None:
    head, tail = two_pads.rsplit(old, 1)
    with pytest.raises(RecordingError, match="must have the XELA sensors 1 and 2 at one address"):
        import_trial(TRIAL, tmp_path / "out.mcap", head + new + tail)
    assert list(tmp_path.iterdir()) == []


def test_an_existing_recording_is_never_overwritten(tmp_path: Path, two_pads: str) -> None:
    (tmp_path / "out.mcap").write_text("precious")
    with pytest.raises(SlipdError, match="exists already"):
        import_trial(TRIAL, tmp_path / "out.mcap", two_pads)
    assert (tmp_path / "out.mcap").read_text() == "precious"


def test_a_folder_that_does_not_exist_is_reported(tmp_path: Path, two_pads: str) -> None:
    with pytest.raises(SlipdError, match=r"out\.mcap: cannot be written: No such file"):
        import_trial(TRIAL, tmp_path / "nowhere" / "out.mcap", two_pads)


def test_a_disk_failure_leaves_no_file(tmp_path: Path, two_pads: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def fdatasync(fd: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fdatasync", fdatasync)
    with pytest.raises(SlipdError, match="cannot be written: No space left"):
        import_trial(TRIAL, tmp_path / "out.mcap", two_pads)
    assert list(tmp_path.iterdir()) == []
