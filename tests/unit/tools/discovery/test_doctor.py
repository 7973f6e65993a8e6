"""``slipd doctor``: what it finds at emulated devices on real lines, and in captures of what goes wrong."""

from __future__ import annotations

import json
import random
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from emulation_thread import plugged
from nanoseconds import MS
from other_packages import Install, install

from slipd.cli import carry_out
from slipd.devices import DEVICES, external, gauges
from slipd.devices.gauges import encode_frame
from slipd.errors import SlipdError
from slipd.events import HostNotice
from slipd.tools.cli_commands import parser
from slipd.tools.discovery import doctor_command as command
from slipd.tools.discovery.examination import Capture, Finding, Piece, examine
from slipd.tools.discovery.port_probe import recognise
from slipd.tools.sim.device_line import PtyLine
from slipd.types.samples import TactileSample

__all__ = ["install"]


def doctor(port: str, name: str | None, out: Path, *arguments: str, seconds: float = 2.0) -> bool:
    device = () if name is None else ("--device", name)
    given = (port, *device, "--out", str(out), "--seconds", str(seconds), *arguments)
    return bool(carry_out(parser().parse_args(["doctor", *given])))


def written(out: Path) -> tuple[Path, str]:
    (capture,), (report,) = out.glob("*.capture"), out.glob("*.txt")
    return capture, report.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("name", "found"),
    [("bota", "reports an identity"), ("gauges", "N·m (mean"), ("robotiq_2f", "gripper not active, width ")],
)
def test_a_device_is_read_and_its_capture_gives_the_same_report_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, found: str
) -> None:
    with plugged(tmp_path, name):
        doctor(str(tmp_path / name), name, tmp_path)
    capture, report = written(tmp_path)
    assert found in report
    assert " readings/s, expected " in report
    for text in (report, capture.read_text(encoding="utf-8")):
        assert str(tmp_path) not in text, "it names no path"
    capsys.readouterr()
    assert doctor(str(capture), None, tmp_path) == ("\nwrong" not in report)
    assert capsys.readouterr().out == report


def test_another_device_is_named(tmp_path: Path) -> None:
    with plugged(tmp_path, "bota"):
        assert not doctor(str(tmp_path / "bota"), "gauges", tmp_path)
    assert "the bytes are those of the device 'bota'" in written(tmp_path)[1]


def test_a_silent_port_an_absent_one_and_one_that_is_unplugged(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    line = PtyLine(tmp_path / "line")
    assert not doctor(str(tmp_path / "line"), "bota", tmp_path, seconds=0.1)
    report = written(tmp_path)[1]
    assert "wrong  open, but no bytes arrive: is it powered?" in report
    assert "the start-up of the device got as far as: waiting" in report
    threading.Timer(0.3, line.close).start()
    assert not doctor(str(tmp_path / "line"), "gauges", tmp_path, seconds=60.0)
    assert "the line was lost: " in capsys.readouterr().out
    with pytest.raises(SlipdError, match="no such port; plug the device in"):
        doctor(str(tmp_path / "nowhere"), "bota", tmp_path)
    assert "no such port" not in caplog.text, "the error says it, once"

    @asynccontextmanager
    async def no_links(*_: Any) -> AsyncIterator[None]:
        yield

    monkeypatch.setattr(command, "Links", no_links)
    monkeypatch.setattr(command, "OPEN_S", 0.01)
    with pytest.raises(SlipdError, match="nowhere: cannot be opened"):
        doctor(str(tmp_path / "nowhere"), "gauges", tmp_path)


@pytest.mark.parametrize(
    ("changes", "error"),
    [
        ({"name": None}, "--device is missing: give the name of the device"),
        ({"name": "botta"}, "no device 'botta' is installed; `slipd devices` lists those that are"),
        ({"port": "udp://a:1"}, "PORT must be the serial line of bota, got udp://a:1"),
        ({"arguments": ("--options", "sinc_length = 3")}, "--options: sinc_length must be an integer from 64"),
        (
            {"arguments": ("--options", "sinc_length")},
            "--options must be keys and values as in a config, got 'sinc_length'",
        ),
        ({"name": "gauges", "arguments": ("--options", "wrong = 1")}, "--options: .*wrong"),
    ],
)
def test_a_wrong_call_is_refused(tmp_path: Path, changes: dict[str, Any], error: str) -> None:
    with pytest.raises(SlipdError, match=error):
        doctor(changes.get("port", "/nowhere"), changes.get("name", "bota"), tmp_path, *changes.get("arguments", ()))


def test_a_broken_device_and_a_folder_that_cannot_be_written_are_named(tmp_path: Path, install: Install) -> None:
    install("some-sensor", "mine", "broken_module:DEVICE", "1/0")
    with pytest.raises(SlipdError, match=r"'mine' of some-sensor .* cannot be used: .*ZeroDivisionError"):
        doctor("/nowhere", "mine", tmp_path)
    line = PtyLine(tmp_path / "line")
    with pytest.raises(SlipdError, match="cannot be written: No such file"):
        doctor(str(tmp_path / "line"), "gauges", tmp_path / "missing", seconds=0.01)
    line.close()


def test_what_the_host_cannot_change_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    command._Reading(DEVICES["gauges"], "/nowhere", capture("gauges", []))._handle(
        HostNotice("latency device", "16 ms")
    )
    assert capsys.readouterr().out == "16 ms\n"


def test_a_device_of_another_package_that_raises_hides_no_other_on_a_port(install: Install) -> None:
    install(
        "some-sensor",
        "mine",
        "raising_module:DEVICE",
        "from slipd.devices import Device\ndef make(): raise KeyError\n"
        "DEVICE = Device('mine', 'wrench', ('serial',), make, interface=1)",
    )
    found = recognise([(piece.t_ns, piece.data) for piece in capture("gauges", frames(10)).pieces])
    assert found.device == "gauges"


def test_a_fault_of_a_shipped_decoder_on_a_port_is_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gauges.Decoder, "receive", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        recognise([(0, b"a")])


def capture(name: str, pieces: list[tuple[int, bytes]], **changes: Any) -> Capture:
    given = [Piece(t_ns, "in", data) for t_ns, data in pieces]
    return replace(Capture(name, "slipd 0.1.0", "serial", 921_600, {}, 1.0, given), **changes)


def frames(count: int, period_ns: int = MS, bunch: int = 1, value: Callable[[int], int] = lambda n: n % 7) -> Any:
    """Frames of gauges at a period of the device, which arrive in bunches."""
    return [
        ((n // bunch + 1) * bunch * period_ns, encode_frame([value(n)] * 6, n, n * period_ns // 1000))
        for n in range(count)
    ]


def texts(found: list[Finding], level: str) -> str:
    return "; ".join(finding.text for finding in found if finding.level == level)


GOOD, NOISE = frames(200), (201 * MS, random.Random(1).randbytes(2000))
SHOWN: list[tuple[str, str, Capture]] = [
    ("look", "16 readings come together every 16.0 ms: an FTDI adapter", capture("gauges", frames(160, bunch=16))),
    (
        "look",
        "the longest pause between readings is 501 ms",
        capture("gauges", GOOD[:50] + [(t_ns + 500 * MS, data) for t_ns, data in GOOD[50:]]),
    ),
    ("look", "advances by 0.5000 s per second", capture("gauges", [(2 * t_ns, data) for t_ns, data in frames(100)])),
    ("look", "1 readings at one time", capture("gauges", frames(1))),
    ("ok", "no damaged, lost or repeated reading", capture("gauges", [(0, b"boot"), *GOOD])),
    ("look", "1 bytes after the first reading", capture("gauges", [*GOOD, (201 * MS, b"x")])),
    ("wrong", "bytes after the first reading", capture("gauges", [*GOOD, NOISE])),
    ("look", "readings are missing", capture("gauges", GOOD[:100] + GOOD[150:])),
    (
        "wrong",
        "none is a Bota frame: is the baud rate 921600 (the default is 460800)?",
        capture("bota", [NOISE]),
    ),
    ("wrong", "is the given address its address?", capture("wts", [(MS, bytes(100))], transport="tcp")),
    ("look", "every reading is the same", capture("gauges", frames(50, value=lambda _: 3))),
    (
        "wrong",
        "beyond 10000 N, is the unit or the calibration right?",
        capture("gauges", frames(50), options={"matrix": (1e6 * np.eye(6)).tolist()}),
    ),
]
"""Level, a part of the text, and the capture that shows it."""


@pytest.mark.parametrize(("level", "words", "taken"), SHOWN, ids=[words for _, words, _ in SHOWN])
def test_what_a_capture_shows_of_timing_and_damage(level: str, words: str, taken: Capture) -> None:
    assert words in texts(examine(taken), level)


def test_another_rate_is_remarked_and_a_clock_that_runs_back_is_not() -> None:
    assert "1000 readings/s, expected 500 Hz" in texts(examine(capture("gauges", frames(100)), 500.0), "look")
    assert "clock" not in texts(examine(capture("gauges", [*frames(5), (6 * MS, encode_frame([1] * 6, 5, 0))])), "ok")


def test_what_a_capture_shows_of_the_values(monkeypatch: pytest.MonkeyPatch) -> None:
    def image(values: Any, status: tuple[str, ...] = (), source: str = "") -> TactileSample:
        return TactileSample(next(times), None, np.array(values), status, source)

    def of(*samples: TactileSample) -> list[Finding]:
        def receive(decoder: gauges.Decoder, data: bytes, t_ns: int) -> list[TactileSample]:
            decoder.health.note = "read as counts"
            return list(samples)

        monkeypatch.setattr(gauges.Decoder, "receive", receive)
        return examine(capture("gauges", [(0, b"a")]))

    times = iter(range(0, 10**9, MS))
    assert "2 values per image, from 1 to 7, 1 of them never change" in texts(of(image([1, 2]), image([1, 7])), "ok")
    assert "the number of taxels changes" in texts(of(image([1]), image([1, 2])), "wrong")
    assert "some values are not finite" in texts(of(image([np.nan])), "wrong")
    pair = of(image([1], ("overload",), "0"), image([2], (), "0"), image([1], (), "1"), image([3], (), "1"))
    assert "read as counts" in texts(pair, "look")
    assert "sensor '0': status 'overload' in 1 of 2 readings" in texts(pair, "look")


UPRIGHT = {"gravity_mps2": (0.0, 0.0, 9.81), "angular_velocity_radps": (0.0, 0.5, 0.0)}


@pytest.mark.parametrize(
    ("reading", "level", "words"),
    [
        ({"force_n": (1.0, 2.0, 3.0)}, "ok", "force "),
        ({"object_pose": {"xyz_m": (0.0, 0.0, 0.1)}}, "ok", "19 readings"),
        (UPRIGHT, "ok", "gravity 9.81 m/s² in the mean, turns of up to 0.5 rad/s"),
        (UPRIGHT | {"gravity_mps2": (0.0, 0.0, 1.0)}, "wrong", "gravity 1 m/s² in the mean, turns of up to 0.5 rad/s"),
    ],
)
def test_forces_without_torques_poses_and_the_gravity_of_an_arm(reading: Any, level: str, words: str) -> None:
    pushed = [(n * MS, external.encode_reading("left", n, **reading)) for n in range(1, 20)]
    found = examine(capture("external", pushed, transport="external", baud=0))
    assert words in texts(found, level)
    assert "torque" not in texts(found, level)


NO_CAPTURE = "is not a capture of slipd doctor"


@pytest.mark.parametrize(
    ("text", "error"),
    [
        (None, "cannot be read: No such file"),
        ("", NO_CAPTURE),
        ("x", NO_CAPTURE),
        ("{}", NO_CAPTURE),
        (json.dumps({"capture": 1}), NO_CAPTURE),
        (capture("bota", []).text() + "[1]", NO_CAPTURE),
        (json.dumps({"capture": 2}), "must be a capture of format 1, got 2"),
        (capture("mine", [], package="some-sensor 1.2").text(), "needs the device 'mine' of some-sensor 1.2"),
        (
            capture("bota", [], options={"sinc_length": 3}).text(),
            "its options are not those of bota: sinc_length must be",
        ),
    ],
)
def test_a_file_that_is_no_capture_is_refused(tmp_path: Path, text: str | None, error: str) -> None:
    path = tmp_path / "a.capture"
    if text is not None:
        path.write_text(text, encoding="utf-8")
    with pytest.raises(SlipdError, match=error):
        doctor(str(path), None, tmp_path)
