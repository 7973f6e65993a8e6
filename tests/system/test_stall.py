"""A real daemon is stopped while real devices continue or stop too; its own delay makes no sensor silent."""

from __future__ import annotations

import signal
import subprocess
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from bed.rig import config_text, make_rig, plan_text
from project import MODULES
from rig_parts import endpoints_of, first_line, part, wait_for

from slipd.events import Bytes, Tick
from slipd.finger.freshness import LATE_NS, LEAST_CATCH_UP_NS
from slipd.recording.entry_walk import Published
from slipd.recording.reader import Recording, open_recording
from slipd.recording.replay import replay
from slipd_client.errors import ClientError
from slipd_client.grip import GripClient
from slipd_client.messages import decode, encode
from slipd_client.messages.codec import MESSAGE_LIMITS
from slipd_client.messages.typed import Slip
from slipd_client.subscriber import Subscriber

pytestmark = [pytest.mark.process, pytest.mark.timeout(400)]

Process = subprocess.Popen[str]
MS = 1_000_000
PATIENCE_S = 180.0
STALLS_MS = [5, 12, 20, 35, 60, 120, 250, 500]
LINES = {"f00x": [("bota", "serial"), ("pvdf", "serial")], "f01x": [("optoforce", "udp"), ("wts", "serial")]}
FRICTION = "\n[finger.{}]\nmu = 0.5\n"
MISSING = {"stale", "rotation_unobserved"}
"""Reasons that mean missing readings or images."""
WELL_NS = 5 * MS
"""A device whose last reading came this shortly before the stall was not late: it sends over 800 readings/s."""


class Bed:
    """A daemon, one process with the devices of each finger, and the verdicts on both fingers.

    Attributes:
        daemon: Process of the daemon.
        devices: Process of the devices of each finger.
    """

    def __init__(self, daemon: Process, devices: dict[str, Process], verdicts: Subscriber) -> None:
        self.daemon, self.devices = daemon, devices
        self._verdicts = verdicts

    def until(self, finger: str, *, known: bool) -> None:
        """Wait until a finger has a level, or is stale."""
        until_s, message = time.monotonic() + PATIENCE_S, None
        while not (
            isinstance(message, Slip)
            and message.finger == finger
            and (message.level != "unknown" if known else message.reasons == ("stale",))
        ):
            assert time.monotonic() < until_s, message
            message = self._verdicts.receive(0.5)


def tared(client: GripClient, pads: GripClient) -> bool:
    """Tare each finger with a zero that is not known yet, unless it refuses; return whether every zero is known.

    A pad that reads a slight pressure forbids to tare the force sensor, but not while the pad is being tared itself. So
    the pad's tare is the longer one.
    """
    for finger in (finger for finger in LINES if not known(client, finger)):
        with ThreadPoolExecutor() as threads:
            threads.submit(pads.tare, finger, "pad", 1.0, unloaded=True)
            time.sleep(0.3)
            with suppress(ClientError):
                client.tare(finger, "wrench", 0.1, unloaded=True)
    return all(known(client, finger) for finger in LINES)


def known(client: GripClient, finger: str) -> bool:
    streams = client.status()["streams"]
    return all(stream["tare_origin"] is not None for name, stream in streams.items() if name.startswith(finger))


@contextmanager
def bed_in(folder: Path) -> Iterator[Bed]:
    """Two fingers on ptys and UDP; the run is recorded in ``run.mcap``."""
    places = make_rig(folder, [line for lines in LINES.values() for line in lines])
    settings = folder / "rig.toml"
    settings.write_text(config_text(places) + "".join(FRICTION.format(finger) for finger in LINES))
    with ExitStack() as stack:
        devices = {}
        for finger in LINES:
            own = [place for place in places if place.stream.startswith(finger)]
            devices[finger] = stack.enter_context(part(folder, "bed.devices", plan_text(own), PYTHONPATH=MODULES))
            assert [first_line(devices[finger]) for _ in own] == [place.address for place in own]
        record = ("--record", str(folder / "run.mcap"))
        daemon = stack.enter_context(part(folder, "slipd", "run", "--config", str(settings), *record))
        ends = endpoints_of(daemon)
        clients = [stack.enter_context(GripClient(ends.requests, timeout_s=PATIENCE_S)) for _ in range(2)]
        wait_for(lambda: tared(*clients), PATIENCE_S)
        yield Bed(daemon, devices, stack.enter_context(Subscriber(ends.publish, ("slip",))))


def false_alarms(recording: Recording) -> list[dict[str, Any]]:
    """Return warnings of missing streams that were published before all lines were read after a stall.

    A daemon that did not catch up in time may report so, and on a loaded machine a device may be late itself.
    """
    found, heard = [], dict.fromkeys(f"{finger}.wrench" for finger in LINES)
    tick_ns = began_ns = until_ns = 0
    was_well: dict[str, bool] = {}
    for entry in recording.entries():
        if isinstance(entry, Published):
            body = decode(entry.payload, MESSAGE_LIMITS)
            missing = entry.topic == "warning" and MISSING.intersection(body["reasons"])
            if missing and began_ns and entry.t_ns < until_ns and was_well[f"{body['finger']}.wrench"]:
                found.append(body)
            continue
        t_ns, event = entry.t_ns, entry.event
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
    with bed_in(tmp_path) as bed:
        for finger in LINES:
            bed.until(finger, known=True)
        for ms in STALLS_MS:
            bed.daemon.send_signal(signal.SIGSTOP)
            time.sleep(ms / 1000)
            bed.daemon.send_signal(signal.SIGCONT)
            time.sleep(0.3)
    recording = open_recording(tmp_path / "run.mcap")
    ticks = [t_ns for t_ns, event in recording.events() if isinstance(event, Tick)]
    assert sum(after - before > 100 * MS for before, after in pairwise(ticks)) >= sum(ms > 100 for ms in STALLS_MS)
    assert false_alarms(recording) == []
    published = list(recording.messages())
    replayed = [(topic, encode(body)) for topic, body in replay(open_recording(tmp_path / "run.mcap"))]
    assert replayed == published


def test_C4_F1_devices_that_stopped_meanwhile_are_stale_once_the_daemon_runs_again(tmp_path: Path) -> None:
    with bed_in(tmp_path) as bed:
        for finger in LINES:
            bed.until(finger, known=True)
        bed.daemon.send_signal(signal.SIGSTOP)
        time.sleep(0.1)
        bed.devices["f01x"].send_signal(signal.SIGSTOP)
        time.sleep(0.1)
        bed.daemon.send_signal(signal.SIGCONT)
        bed.until("f01x", known=False)
        bed.until("f00x", known=True)
