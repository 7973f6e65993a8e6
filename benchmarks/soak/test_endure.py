"""What ``python -m soak --only endure`` is made of: faulty lines on real pseudo-terminals, and its figures."""

from __future__ import annotations

import os
import select
from pathlib import Path
from random import Random

import pytest
from soak import faulty_gripper
from soak.endure import _growth
from soak.faulty_gripper import KINDS, FaultyLines
from soak.watched_loop import BIN_S, Lags, Watched

from slipd.tools.sim.virtual_gripper import LINES


@pytest.mark.parametrize("kind", KINDS)
def test_a_fault_spoils_its_line_and_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str) -> None:
    monkeypatch.setattr(faulty_gripper, "KINDS", (kind,))
    lines = FaultyLines(tmp_path, Random(1))
    fds = {line: os.open(tmp_path / line, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK) for line in LINES}

    def passed() -> dict[str, bytes]:
        lines.read()
        lines.write(dict.fromkeys(LINES, b"reading"))
        return {line: os.read(fd, 4096) if _readable(fd) else b"" for line, fd in fds.items()}

    assert set(passed().values()) == {b"reading"}
    lines.step(0.0)
    assert lines.faults == {kind: 1}
    spoilt = {line for line, data in passed().items() if data != b"reading"}
    assert len(spoilt) == (len(LINES) if kind == "all stalled" else 1)
    lines.step(faulty_gripper.LONGEST_S)
    for line in spoilt:
        os.close(fds[line])
        fds[line] = os.open(tmp_path / line, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    held = b"reading" if kind in ("in bursts", "all stalled") else b""
    assert all(data == (held if line in spoilt else b"") + b"reading" for line, data in passed().items())


def _readable(fd: int) -> bool:
    return bool(select.select([fd], [], [], 0.0)[0])


def test_lags_are_counted_in_bins() -> None:
    lags = Lags()
    for number in range(100):
        lags._counts[number] += 1
    assert lags.quantile_ms(0.5) == pytest.approx(50 * BIN_S * 1e3)
    assert lags.quantile_ms(1.0) == pytest.approx(100 * BIN_S * 1e3)


class _Heard:
    messages, missed = 1000, 0

    def stop(self) -> None:
        pass


@pytest.mark.parametrize(("leak", "reached"), [(0, ["yes"] * 3), (100, ["no"] * 3)])
def test_what_grows_is_found(leak: int, reached: list[str]) -> None:
    holdings = [(200_000 + n * leak, 12 + n * leak, 5 + n * leak) for n in range(180)]
    table = _growth(Watched([0.0] * 4, holdings), _Heard(), 1800.0)
    assert [row[-1] for row in table.rows] == reached
