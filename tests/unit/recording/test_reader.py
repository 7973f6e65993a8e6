"""A recording is read whole; one that is cut off, damaged or foreign is read up to the fault, or refused."""

from collections.abc import Callable
from pathlib import Path
from random import Random

import pytest
from fuzz.extent import ROUNDS, SEED
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from recorded_entries import contents, entries, write

from slipd.errors import RecordingError
from slipd.recording.reader import GAP_S, EventGaps, Gap, Recording, open_recording

BEGIN_NS = 5_000_000_000


def about(recording: Recording) -> tuple[object, ...]:
    return recording.config_text, recording.boot, recording.wall_minus_monotonic_ns, recording.versions


class Run:
    """A whole recording of 60 entries, and damaged copies of it."""

    def __init__(self, path: Path) -> None:
        self.copy = path.with_name("damaged.mcap")
        self.data = path.read_bytes()
        self.recording, self.entries = contents(path)

    def read(self, data: bytes) -> tuple[Recording | None, list]:
        """Read a damaged copy: its beginning is right, or it is refused."""
        self.copy.write_bytes(data)
        try:
            recording, found = contents(self.copy)
        except RecordingError:
            return None, []
        assert about(recording) == about(self.recording)
        assert found == self.entries[: len(found)]
        assert not recording.complete or len(found) == len(self.entries)
        return recording, found


@pytest.fixture
def run(tmp_path: Path) -> Run:
    write(tmp_path / "run.mcap", entries(60), 20)
    return Run(tmp_path / "run.mcap")


def test_a_recording_reads_as_events_as_messages_or_as_both(run: Run) -> None:
    recording, both = run.recording, run.entries
    assert both == entries(60)
    assert list(recording.events()) == [(e.t_ns, e.content) for e in both[::2]]
    assert list(recording.messages()) == [(e.topic, e.content) for e in both[1::2]]
    assert list(recording.entries()) == both, "every pass starts anew"
    assert recording.complete


def test_K2_a_recording_cut_off_anywhere_yields_its_beginning_and_reports_it(run: Run) -> None:
    lengths = []
    for end in range(0, len(run.data), max(13 // ROUNDS, 1)):
        recording, found = run.read(run.data[:end])
        assert recording is None or (recording.complete, recording.lost) == (False, 0)
        lengths.append(-1 if recording is None else len(found))
    assert lengths == sorted(lengths), "a longer beginning is readable where a shorter one was"
    assert set(lengths) == {-1, 0, 20, 40, 60}


def test_K4_a_recording_with_a_changed_byte_is_never_misread(run: Run) -> None:
    rng, ended = Random(SEED), 0
    for place in range(0, len(run.data), max(31 // ROUNDS, 1)):
        for change in (rng.randrange(1, 0xFF), 0xFF, 1 << rng.randrange(8)):
            damaged = bytearray(run.data)
            damaged[place] ^= change
            recording, _ = run.read(bytes(damaged))
            ended += recording is not None and not recording.complete
    assert ended > 50


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=100, deadline=None)
@given(place=st.floats(0, 1), noise=st.binary(min_size=1, max_size=40), cut=st.integers(0, 40))
def test_K4_noise_in_a_recording_raises_only_recording_errors(run: Run, place: float, noise: bytes, cut: int) -> None:
    at = int(place * len(run.data))
    run.read(run.data[:at] + noise + run.data[at + cut :])


FOREIGN: list[tuple[Callable[[Path], object], str]] = [
    (lambda path: path.write_bytes(b""), "is empty"),
    (lambda path: path.write_bytes(b"\x89MCA"), "not an MCAP file"),
    (lambda path: path.write_bytes(b"time,force\n0,1\n"), "not an MCAP file"),
    (lambda path: path.write_bytes(b"\x89MCAP0\r\n"), "an MCAP file, but not a recording of slipd"),
    (Path.mkdir, "Is a directory"),
    (Path.exists, "No such file"),
]


@pytest.mark.parametrize(("make", "text"), FOREIGN, ids=[text for _, text in FOREIGN])
def test_a_file_that_is_not_a_recording_is_refused_with_a_reason(
    tmp_path: Path, make: Callable[[Path], object], text: str
) -> None:
    make(tmp_path / "some.mcap")
    with pytest.raises(RecordingError, match=rf"^{tmp_path}/some\.mcap: .*{text}"):
        open_recording(tmp_path / "some.mcap")


@pytest.mark.parametrize(
    ("begin_ns", "times_s", "gaps"),
    [
        ((BEGIN_NS,), [0.0, 0.005, 0.005 + 0.99 * GAP_S, 3.0, 3.005, 4.0], {3: Gap(0.104, 3.0), 5: Gap(3.005, 4.0)}),
        ((), [0.0], {}),
    ],
    ids=["a longer time without an event", "a run does not begin with a gap"],
)
def test_a_gap_is_a_time_of_the_run_of_which_nothing_is_known(
    begin_ns: tuple[int, ...], times_s: list[float], gaps: dict[int, Gap]
) -> None:
    found = EventGaps(*begin_ns)
    told = [found.add(BEGIN_NS + round(t_s * 1e9)) for t_s in times_s]
    assert [number for number, gap in enumerate(told) if gap] == list(gaps)
    assert found.found == [pytest.approx(gap) for gap in gaps.values()]
