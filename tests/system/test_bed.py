"""Real processes: one daemon that reads every device on every kind of line, and the emulated devices."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
from bed.rig import RIGS, Place, config_text, make_rig, plan_text
from project import MODULES
from rig_parts import PATIENCE_S, endpoints_of, first_line, part

from slipd_client.errors import NoAnswer, RequestRefused
from slipd_client.grip import GripClient

pytestmark = pytest.mark.process

KEEPS_UP_S = 30.0
"""A machine on which streams are still late after so long cannot keep up with all devices."""

POLL_S = 0.25
OK, STALE, ERROR = 0, 3, 2
BUSY = ("within 10 s", "the daemon was late by")
"""Health messages that a busy machine causes."""

Streams = dict[str, dict[str, Any]]


class Bed:
    """A daemon and its devices, each a process."""

    def __init__(self, folder: Path, places: list[Place]) -> None:
        self._folder, self.places = folder, places

    @contextmanager
    def devices(self) -> Iterator[None]:
        with part(self._folder, "bed.devices", plan_text(self.places), PYTHONPATH=MODULES) as process:
            assert [first_line(process) for _ in self.places] == [place.address for place in self.places]
            yield

    @contextmanager
    def daemon(self) -> Iterator[GripClient]:
        config = self._folder / "rig.toml"
        config.write_text(config_text(self.places))
        with (
            part(self._folder, "slipd", "run", "--config", str(config)) as process,
            GripClient(endpoints_of(process).requests) as requester,
        ):
            yield requester


@pytest.fixture(scope="module")
def bed(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Bed:
    """The rig with a number."""
    folder = tmp_path_factory.mktemp("bed")
    return Bed(folder, make_rig(folder, RIGS[request.param]))


@pytest.fixture(scope="module")
def processes(bed: Bed) -> Iterator[tuple[GripClient, ExitStack]]:
    with bed.daemon() as requester, ExitStack() as devices:
        devices.enter_context(bed.devices())
        yield requester, devices


def watch(requester: GripClient, settled: Callable[[dict[str, Any]], bool]) -> tuple[Streams, Streams]:
    """Return each stream when it settled, and the streams that did not."""
    good: Streams = {}
    bad: Streams = {}
    begin_s = time.monotonic()
    while time.monotonic() < begin_s + PATIENCE_S:
        if settled is is_well and time.monotonic() > begin_s + KEEPS_UP_S:
            settled = is_read
        with suppress(NoAnswer, RequestRefused):  # the machine is busy
            streams = requester.status()["streams"]
            good |= {name: stream for name, stream in streams.items() if name not in good and settled(stream)}
            bad = {name: stream for name, stream in streams.items() if name not in good}
            if not bad:
                break
        time.sleep(POLL_S)
    return good, bad


def is_well(stream: dict[str, Any]) -> bool:
    """Return whether readings come at their rate; a busy machine may have interrupted them for some milliseconds."""
    calm = stream["health"] == OK or any(words in stream["message"] for words in BUSY)
    return calm and stream["rate_hz"] == pytest.approx(stream["expected_hz"], rel=0.2)


def is_read(stream: dict[str, Any]) -> bool:
    """Return whether readings come as well as this machine allows: some are late or lost, and the daemon says so."""
    overloaded = any(words in stream["message"] for words in BUSY)
    return is_well(stream) or (overloaded and stream["samples"] > stream["bad"])


@pytest.fixture(scope="module")
def streams(processes: tuple[GripClient, ExitStack]) -> Streams:
    good, bad = watch(processes[0], is_well)
    return good | bad


@pytest.mark.parametrize(
    ("bed", "device", "transport"),
    [(number, *line) for number, lines in enumerate(RIGS) for line in lines],
    indirect=["bed"],
    scope="module",
)
def test_a_device_is_read_in_health(bed: Bed, streams: Streams, device: str, transport: str) -> None:
    (place,) = (place for place in bed.places if (place.device, place.transport) == (device, transport))
    stream = streams[place.stream]
    assert is_read(stream), stream
    assert stream["address"] == place.address


@pytest.mark.parametrize("bed", range(len(RIGS)), indirect=True, scope="module")
def test_L5_L6_all_devices_go_away_and_come_back(
    bed: Bed, streams: Streams, processes: tuple[GripClient, ExitStack]
) -> None:
    requester, devices = processes
    devices.close()
    _, remaining = watch(requester, lambda stream: stream["health"] in (STALE, ERROR))
    assert not remaining
    devices.enter_context(bed.devices())
    _, missing = watch(requester, is_well)
    assert not missing
