"""A daemon that is killed while its fingers press: the next one knows the zeros, or says that it does not."""

from __future__ import annotations

import contextlib
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from rig_parts import first_line, part

from slipd import config
from slipd_client.grip import GripClient
from slipd_client.messages.typed import Slip
from slipd_client.subscriber import Subscriber

pytestmark = pytest.mark.process

PATIENCE_S = 60.0


@contextlib.contextmanager
def daemon(folder: Path) -> Iterator[tuple[str, str]]:
    """Run a daemon until the block ends, then kill it; yield its endpoints."""
    with part(folder, "slipd", "run", "--config", str(folder / "rig" / "bota_xela.toml")) as process:
        publish, requests = (first_line(process).partition(": ")[2] for _ in range(2))
        try:
            yield publish, requests
        finally:
            process.send_signal(signal.SIGKILL)
            process.wait(PATIENCE_S)


def first_verdicts(publish: str, *, seen: int = 50) -> set[tuple[str, tuple[str, ...], str | None]]:
    """Return level, reasons and origin of the zero of the first verdicts on readings that are not stale."""
    found, count, until_s = set(), 0, time.monotonic() + PATIENCE_S
    with Subscriber(publish, topics=("slip",)) as messages:
        while count < seen:
            assert time.monotonic() < until_s, found
            message = messages.receive(1.0)
            if isinstance(message, Slip) and "stale" not in message.reasons:
                found.add((str(message.level), message.reasons, message.tare_origin))
                count += 1
    return found


def test_F6_a_kill_in_a_grasp_leaves_the_zeros_or_an_unknown_level(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Bota sensors behind XELA pads under 37 N, whose taxels have offsets of thousands of counts."""
    state = tmp_path / "state"
    monkeypatch.setenv("SLIPD_STATE_DIR", str(state))
    rig = tmp_path / "rig"
    (tmp_path / "bota_xela.toml").write_text(config.shipped("bota_xela.toml").read_text(encoding="utf-8"))
    with part(tmp_path, "slipd", "emulate", str(tmp_path / "bota_xela.toml"), "--dir", str(rig)) as emulation:
        first_line(emulation)
        assert emulation.stdin is not None
        with daemon(tmp_path) as (publish, requests):
            assert first_verdicts(publish) == {("unknown", ("not_tared",), None)}, "a free gripper that nobody tared"
            with GripClient(requests, timeout_s=PATIENCE_S) as client:
                for finger in ("left", "right"):
                    client.tare(finger, "all", 0.3)
                emulation.stdin.write("press left 37 N; press right 37 N\n")
                emulation.stdin.flush()
                until_s = time.monotonic() + PATIENCE_S
                while not all(each["level"] == "stable" for each in client.status()["fingers"].values()):
                    assert time.monotonic() < until_s
                    time.sleep(0.1)
                (kept,) = state.glob("state-*.json")
                while kept.read_text().count('"measured"') < 4:
                    assert time.monotonic() < until_s, kept.read_text()
        with daemon(tmp_path) as (publish, requests):
            verdicts = first_verdicts(publish)
            assert {origin for _, _, origin in verdicts} == {"stored"}
            assert {level for level, _, _ in verdicts} <= {"stable", "unknown"}
            assert "stable" in {level for level, _, _ in verdicts}
            kept.unlink()
            with GripClient(requests, timeout_s=PATIENCE_S) as client:
                for name, stream in client.status()["streams"].items():
                    assert stream.get("tare_origin", "stored") == "stored", (name, stream["message"])
        kept.unlink(missing_ok=True)
        with daemon(tmp_path) as (publish, requests):
            assert first_verdicts(publish) == {("unknown", ("not_tared",), None)}
            with GripClient(requests, timeout_s=PATIENCE_S) as client:
                messages = [stream["message"] for stream in client.status()["streams"].values()]
                assert any(
                    "its zero is not known: tare it while nothing touches the finger" in each for each in messages
                )
