"""One recording, replayed with its own config and with others."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from lossy_recording import lossy
from replays import RECORDINGS, messages

from slipd.errors import ConfigError, RecordingError
from slipd.events import Tick
from slipd.recording.mcap_file import RecordingFile
from slipd.recording.reader import open_recording
from slipd.tools.evaluation.config_replay import outline, run_config
from slipd.tools.evaluation.config_run import NOT_RECORDED, ConfigRun

DEMO, GRIPS = RECORDINGS / "demo.mcap", RECORDINGS / "import_grips.mcap"
Write = Callable[..., Path]


def levels(run: ConfigRun, finger: str = "left") -> list[str]:
    found = [span.level for span in run.spans[finger]]
    return [level for before, level in zip(["unknown", *found], found, strict=False) if level != before]


def test_its_own_config_gives_the_messages_of_the_run() -> None:
    run = run_config(DEMO, None, "recorded")
    told = [body for topic, body in messages("demo") if topic == "warning" and body["finger"] == "left"]
    assert levels(run) == [body["level"] for body in told]
    used = [body["utilisation"] for topic, body in messages("demo") if topic.startswith("slip.")]
    assert run.largest is not None
    assert run.largest.utilisation == max(value for value in used if value is not None)
    assert run.fault == ""


def test_times_count_from_the_first_event() -> None:
    run = run_config(GRIPS, None, "recorded")
    assert run.spans["left"][0].begin_s == 0.0
    assert max(span.end_s for span in run.spans["left"]) == run.end_s == pytest.approx(5.24, abs=0.02)


def test_another_config_changes_what_is_reported(config_file: Write) -> None:
    text = config_file("demo", "a.toml", ("mu = 0.55", "mu = 0.8")).read_text()
    recorded, other = levels(run_config(DEMO, None, "recorded")), levels(run_config(DEMO, text, "a.toml"))
    assert recorded.index("warning") < recorded.index("slipping")
    assert "warning" not in other[: other.index("slipping")], "the slip comes without a warning"


def test_the_zero_of_a_pad_stays_that_of_the_recording(config_file: Write) -> None:
    """A tare is measured, not chosen: that of another trial would read loads that are none."""
    text = config_file("import_grips", "a.toml").read_text()
    head, _, tail = text.partition("tare = [")
    without = head + tail[tail.index("\n]\n") + 3 :]
    assert run_config(GRIPS, without, "a.toml").spans == run_config(GRIPS, None, "recorded").spans
    other = text.replace("16456.3", "12456.3").replace("37526.9", "31526.9")
    assert run_config(GRIPS, other, "a.toml").spans == run_config(GRIPS, None, "recorded").spans


def test_a_config_without_a_stream_of_the_recording_is_refused(config_file: Write) -> None:
    text = config_file("import_grips", "a.toml", ("finger.left", "finger.thumb")).read_text()
    with pytest.raises(
        RecordingError, match=r"must have the link 'left\.pad' of an event, got .*thumb\.pad \(a\.toml\)"
    ):
        run_config(GRIPS, text, "a.toml")


def test_a_config_with_faults_is_refused(config_file: Write) -> None:
    text = config_file("demo", "a.toml", ("mu = 0.55", "mu = -1.0")).read_text()
    with pytest.raises(ConfigError, match=r"a\.toml"):
        run_config(DEMO, text, "a.toml")


def test_a_recording_that_was_cut_off_is_used_as_far_as_it_goes(tmp_path: Path) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(GRIPS.read_bytes()[: GRIPS.stat().st_size * 3 // 4])
    run = run_config(cut, None, "recorded")
    assert run.fault.startswith(f"{cut}: ")


def test_a_level_does_not_hold_where_entries_are_lost(tmp_path: Path) -> None:
    run = run_config(lossy(DEMO, tmp_path), None, "recorded")
    assert "lost" in run.fault
    for spans in run.spans.values():
        (lost,) = [span for span in spans if span.reasons == (NOT_RECORDED,)]
        assert (lost.level, lost.begin_s, lost.end_s) == (
            "unknown",
            pytest.approx(1.0, abs=0.02),
            pytest.approx(2.0, abs=0.1),
        )
        assert not [span for span in spans if span is not lost and span.begin_s < 1.98 and span.end_s > 1.02]


def ticks(path: Path, times_s: range) -> Path:
    file = RecordingFile(path, config_text="", boot="b", wall_minus_monotonic_ns=0)
    for n, t_s in enumerate(times_s):
        file.event(n, t_s * 1_000_000_000, Tick(n))
    file.finish(len(times_s))
    return path


def test_the_length_of_a_recording_is_that_of_its_events(tmp_path: Path) -> None:
    assert outline(open_recording(ticks(tmp_path / "a.mcap", range(7, 11)))) == (7.0, 10.0)
    assert outline(open_recording(ticks(tmp_path / "b.mcap", range(0)))) == (0.0, 0.0)
