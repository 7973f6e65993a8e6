"""A real daemon is stopped while its devices go on; its own delay makes no sensor silent."""

from __future__ import annotations

import signal
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from emulation_thread import emulation
from nanoseconds import MS
from rig_parts import PATIENCE_S, endpoints_of, part, wait_for

from slipd import config
from slipd.events import Bytes, Tick
from slipd.finger.freshness import LATE_NS, LEAST_CATCH_UP_NS
from slipd.recording.reader import Recording, open_recording
from slipd.recording.replay import replay
from slipd.tools.sim.touched_devices import TouchedDevices
from slipd_client.grip import GripClient
from slipd_client.messages import decode, encode
from slipd_client.messages.codec import MESSAGE_LIMITS

pytestmark = [pytest.mark.process, pytest.mark.timeout(400)]

STALLS_MS = [5, 12, 20, 35, 60, 120, 250, 500]
RIG = """
[finger.left]
mu = 0.5

[finger.left.wrench]
device = "bota"
port = "/dev/bota"
rate_hz = 100.0
options = { sinc_length = 512 }

[finger.right]
mu = 0.5

[finger.right.wrench]
device = "optoforce"
port = "udp://192.168.1.1:49152"
rate_hz = 100.0
options = { period_ms = 10 }
"""
MISSING = {"stale", "rotation_unobserved"}
"""Reasons that mean missing readings or images."""
WELL_NS = 15 * MS
"""A device whose last reading came this shortly before the stall was not late: it sends 100 readings/s."""


def false_alarms(recording: Recording) -> list[dict[str, Any]]:
    """Return warnings of missing streams that were published before all lines were read after a stall.

    A daemon that did not catch up in time may report so, and on a loaded machine a device may be late itself.
    """
    found, heard = [], dict.fromkeys(("left.wrench", "right.wrench"))
    tick_ns = began_ns = until_ns = 0
    was_well: dict[str, bool] = {}
    for _, t_ns, topic, event in recording.entries():
        if isinstance(event, bytes):
            body = decode(event, MESSAGE_LIMITS)
            missing = topic == "warning" and MISSING.intersection(body["reasons"])
            if missing and began_ns and t_ns < until_ns and was_well[f"{body['finger']}.wrench"]:
                found.append(body)
            continue
        if tick_ns and t_ns - tick_ns > LATE_NS and not began_ns:
            began_ns, until_ns = tick_ns, t_ns + LEAST_CATCH_UP_NS
            was_well = {link: last is not None and tick_ns - last < WELL_NS for link, last in heard.items()}
        if isinstance(event, Tick):
            tick_ns = t_ns
            if not event.unread:
                began_ns = 0
        elif isinstance(event, Bytes) and event.link in heard:
            heard[event.link] = t_ns
    return found


def test_C4_P2_a_daemon_that_was_stopped_calls_no_sensor_silent_that_went_on(tmp_path: Path) -> None:
    devices = TouchedDevices(config.parse(RIG, "rig.toml"), tmp_path)
    rig, path = tmp_path / "rig.toml", tmp_path / "run.mcap"
    rig.write_text(devices.config_text(), encoding="utf-8")
    with (
        emulation(devices.devices, devices.advance),
        part(tmp_path, "slipd", "run", "--config", str(rig), "--record", str(path)) as daemon,
        GripClient(endpoints_of(daemon).requests, timeout_s=PATIENCE_S) as client,
    ):
        for finger in ("left", "right"):
            wait_for(lambda finger=finger: client.tare(finger, "wrench", 0.1, unloaded=True))
            wait_for(lambda finger=finger: client.status()["fingers"][finger]["level"] != "unknown")
        for ms in STALLS_MS:
            daemon.send_signal(signal.SIGSTOP)
            time.sleep(ms / 1000)
            daemon.send_signal(signal.SIGCONT)
            time.sleep(0.3)
    recording = open_recording(path)
    ticks = [t_ns for t_ns, event in recording.events() if isinstance(event, Tick)]
    assert sum(after - before > 100 * MS for before, after in pairwise(ticks)) >= sum(ms > 100 for ms in STALLS_MS)
    assert false_alarms(recording) == []
    published = list(recording.messages())
    assert [(topic, encode(body)) for topic, body in replay(open_recording(path))] == published
