"""The emulated Net F/T with the session of the daemon."""

from __future__ import annotations

import asyncio
from dataclasses import replace

import numpy as np
import pytest
from driving import drive
from loop_waits import eventually
from nanoseconds import MS

from slipd.devices import netft
from slipd.devices.netft import netft_calibration
from slipd.devices.shared import rdt_records as rdt
from slipd.events import Bytes, Event, LinkSpec, LinkUp
from slipd.io.transport import Links
from slipd.tools.sim.emulate import emulated, run
from slipd.tools.sim.emulated_rdt import SERIAL, NetftSensor
from slipd.types.samples import WrenchSample

FORCE_N, TORQUE_NM = np.array([1.0, -2.0, -8.0]), np.array([0.01, 0.02, -0.03])


def begun(emulator: NetftSensor, calibration: str) -> netft.Session:
    """Return a session that has had its answer."""
    session = netft.Session(calibration, **emulator.options)
    session.start(0)
    asked = netft.inquiry(calibration)
    if asked:
        session.receive(emulator.inquire(asked.request), 0)
    return session


@pytest.mark.parametrize(("calibration", "identity"), [("tcp", ""), ("xml", f"S/N {SERIAL}")])
def test_the_daemons_session_calibrates_and_gets_4000_readings_a_second(calibration: str, identity: str) -> None:
    emulator = NetftSensor(1)
    emulator.feel(FORCE_N, TORQUE_NM)
    session = begun(emulator, calibration)
    samples = drive(session, emulator, 0.5, start=False)
    known = (session.state, session.identity, session.health.lost, session.health.bad)
    assert known == ("running", identity, 0, 0)
    assert 1980 <= len(samples) <= 2000
    assert np.mean([s.force_n for s in samples], axis=0) == pytest.approx(FORCE_N, abs=0.003)
    assert np.mean([s.torque_nm for s in samples], axis=0) == pytest.approx(TORQUE_NM, abs=1e-4)
    assert np.ptp([s.device_time_ns for s in samples]) == pytest.approx((len(samples) - 1) * 250_000, abs=2e5)


@pytest.mark.parametrize("page", ["", "comm.cgi?comrdtrate=7001", "comm.cgi?comrdtrate=0"])
def test_nothing_else_is_answered(page: str) -> None:
    assert NetftSensor(5).inquire(f"GET /{page} HTTP/1.0\r\n\r\n".encode()) == b""


class Locked(NetftSensor):
    """A sensor that refuses a change."""

    def inquire(self, request: bytes) -> bytes:
        return b"HTTP/1.0 401 Unauthorized\r\n\r\n" if b".cgi" in request else super().inquire(request)


@pytest.mark.parametrize(
    ("kind", "asked_hz", "rate_hz", "warning"),
    [
        (NetftSensor, 1000, 1000.0, ""),
        (NetftSensor, 300, 7000 / 23, ""),
        (Locked, 1000, 100.0, "the sensor did not take output_hz = 1000: its web page reports 100 Hz"),
    ],
)
async def test_the_output_rate_is_set_over_http_before_the_records_start(
    kind: type[NetftSensor], asked_hz: int, rate_hz: float, warning: str, unused_udp_port: int
) -> None:
    """The page is served at the port of the emulated calibration: port 80 needs the rights for it."""
    host = f"127.1.{unused_udp_port >> 8}.{unused_udp_port & 255}"  # of this case alone: its TCP port is always 49151
    sensor, address = kind(9, rate_hz=100.0), f"udp://{host}:{unused_udp_port}"
    session = netft.Session("xml", buffered=False, output_hz=asked_hz)
    inquiry = netft.inquiry("xml", output_hz=asked_hz)
    assert inquiry is not None
    samples: list[WrenchSample] = []

    def handle(event: Event) -> None:
        if isinstance(event, LinkUp):
            session.start(0)
        elif isinstance(event, Bytes):
            samples.extend(session.receive(event.data, 0))
            links.write("left.wrench", session.on_time(0))

    spec = LinkSpec("left.wrench", "udp", address, inquiry=replace(inquiry, port=netft_calibration.TCP_INQUIRY.port))
    async with emulated([("netft", sensor, address)]) as lines, asyncio.TaskGroup() as tasks:
        running = tasks.create_task(run(lines))
        async with Links(tasks, [spec], handle) as links:
            await eventually(lambda: len(samples) >= 5)
        running.cancel()
    times_ns = [sample.device_time_ns for sample in samples if sample.device_time_ns is not None]
    assert times_ns[4] - times_ns[0] == pytest.approx(4e9 / rate_hz, abs=2e9 / 7000)
    assert session.health.warning == warning


def test_a_force_beyond_the_counts_is_sent_as_the_largest() -> None:
    emulator, decoder = NetftSensor(8), netft.Decoder(**NetftSensor(8).options)
    emulator.feel(np.array([1e6, 0.0, 0.0]), np.zeros(3))
    emulator.receive(rdt.encode_request(rdt.START), 0)
    assert decoder.receive(emulator.advance(MS)[0], 0)[0].status == ("overload",)
