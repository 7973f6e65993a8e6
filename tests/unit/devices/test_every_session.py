"""What every session with a sensor keeps to: shown against the emulated device, on a line that loses data."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest

from slipd.devices import DEVICES
from slipd.tools.sim.emulators import make_emulator

STEP_NS = 10_000_000


@dataclass(frozen=True)
class Known:
    """What is known of one device.

    Attributes:
        asked: The requests that bring it to sending, as its maker or its users document them.
        stop: The request that stops it.
        states: The states until it runs.
        silent: The state while it does not answer at all.
        identity: What it reports of itself.
        options: Of its session and its emulator.
    """

    asked: tuple[bytes, ...]
    stop: bytes
    states: str = "waiting, configuring, running"
    silent: str = "no answer to start"
    identity: str = ""
    options: tuple[tuple[str, Any], ...] = ()


def hexes(*texts: str) -> tuple[bytes, ...]:
    return tuple(map(bytes.fromhex, texts))


IMAGES = "waiting, configuring, waiting for images, running"
STOP_ROBOTOUS = "55 0C 00 00 00 00 00 00 00 0C AA"
KNOWN = {
    "bota": Known(
        (b"C\n", b"c,0,1,0,4\n", b"f,64,0,0,1\n", b"R\n"), b"C\n", silent="no answer to C", identity="MiniONE S/N 1"
    ),
    "robotous": Known(
        hexes(
            STOP_ROBOTOUS,
            *("55 10 00 00 00 00 00 00 00 10 AA", "55 0F 06 00 00 00 00 00 00 15 AA"),
            *("55 09 00 00 00 00 00 00 00 09 AA", "55 01 00 00 00 00 00 00 00 01 AA"),
            *("55 02 00 00 00 00 00 00 00 02 AA", "55 0B 00 00 00 00 00 00 00 0B AA"),
        ),
        *hexes(STOP_ROBOTOUS),
        silent="no answer to rate",
        identity="RFT40-SA01-D RFT-2211-0042",
    ),
    "tsf85": Known(hexes("9A 00 58 01 00", "9A 00 E3 00", "9A 00 58 01 01"), b"\x9a\0\x58\x01\0", identity="1.1.8"),
    "papillarray": Known((b"f500\n",), b"", "waiting, running", "no answer to rate"),
    "netft": Known(
        hexes("12 34 00 03 00 00 00 00"),
        *hexes("12 34 00 00 00 00 00 00"),
        states="waiting for calibration, waiting, running",
        silent="no calibration",
    ),
    "optoforce": Known(
        hexes("AA 00 32 03 01 02 00 00 E2", "AB 00 12 08 00 C5"),
        *hexes("AA 00 32 03 00 02 00 00 E1"),
        silent="no answer to configuration",
        identity="S/N HEXEB123",
    ),
    "optoforce udp": Known(
        hexes("12 34 00 82 00 00 00 01", "12 34 00 81 00 00 00 02", "12 34 00 02 00 00 00 00"),
        *hexes("12 34 00 00 00 00 00 00"),
        states="waiting, running",
        options=(("wiring", "udp"),),
    ),
    "dsacon32": Known(
        hexes(
            *("AA AA AA 01 00 00", "AA AA AA 02 00 00", "AA AA AA 0B 01 00 00 CB FB", "AA AA AA 0B 01 00 01 EA EB"),
            *("AA AA AA 03 03 00 01 00 00 2F 6A", "AA AA AA 03 03 00 81 1E 00 2C 76"),
        ),
        *hexes("AA AA AA 03 03 00 01 00 00 2F 6A"),
        states=IMAGES,
        silent="no answer to controller",
        identity="S/N 1234",
    ),
    "wts": Known(
        hexes(
            *("AA AA AA 50 00 00 DB 87", "AA AA AA 30 00 00 CA CF"),
            *("AA AA AA 22 00 00 0E 76", "AA AA AA 21 03 00 00 0A 00 DA B5"),
        ),
        *hexes("AA AA AA 22 00 00 0E 76"),
        states=IMAGES,
        silent="no answer to system information",
        identity="S/N 4711",
    ),
}
every = pytest.mark.parametrize("name", KNOWN)


class Bench:
    """A session and its device, in steps of 10 ms; ``loses`` decides about each piece that either sends."""

    def __init__(self, name: str, device: Any = None) -> None:
        self.device_of = DEVICES[name.split()[0]]
        options = dict(KNOWN[name].options)
        self.device: Any = device or make_emulator(self.device_of.name, 3, **options)
        assert self.device_of.session is not None
        self.session = self.device_of.session(**self.device.options | options)
        self.now_ns, self.device_ns, self.samples = 0, 0, 0
        self.off = False  # the device has no power
        self.written: list[bytes] = []
        self.states: list[str] = []
        self.loses: Callable[[bytes, bool], bool] = lambda data, to_device: False
        self.piece = 1 << 20

    def start(self) -> None:
        self.device.opened(self.device_ns)
        self.write(self.session.start(self.now_ns))

    def write(self, data: bytes) -> None:
        self.note()
        if not data:
            return
        self.written.append(data)
        for answer in [] if self.off or self.loses(data, True) else self.device.receive(data, self.device_ns):
            self.deliver(answer)

    def deliver(self, data: bytes) -> None:
        if not self.loses(data, False):
            for at in range(0, len(data), self.piece):
                self.samples += len(self.session.receive(data[at : at + self.piece], self.now_ns))
        self.note()

    def note(self) -> None:
        if self.session.state not in self.states[-1:]:
            self.states.append(self.session.state)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds * 100)):
            self.now_ns += STEP_NS
            for data in [] if self.off else self.sent():
                self.deliver(data)
            for _ in range(9):
                due_ns = self.session.next_deadline()
                if due_ns is None or due_ns > self.now_ns:
                    break
                self.write(self.session.on_time(self.now_ns))
            else:
                pytest.fail("it never stops asking")

    def sent(self) -> list[bytes]:
        """Return what the device sends in the next step, and its answer to the inquiry that goes before."""
        self.device_ns += STEP_NS
        make, answers = self.device_of.inquiry, list[bytes]()
        if make is not None and (inquiry := make()) is not None and self.session.state.endswith("calibration"):
            answers.append(self.device.inquire(inquiry.request))
        return answers + list(self.device.advance(self.device_ns))

    def run_until(self, state: str, seconds: float = 20.0) -> None:
        while self.session.state != state:
            seconds -= 0.05
            assert seconds > 0, self.states
            self.run(0.05)


def running(name: str) -> Bench:
    bench = Bench(name)
    bench.start()
    bench.run_until("running")
    return bench


@every
@pytest.mark.parametrize("piece", [13, 1 << 20])
def test_a_session_asks_what_is_documented_until_the_device_runs_and_stops_it(name: str, piece: int) -> None:
    known, bench = KNOWN[name], Bench(name)
    bench.piece = piece
    session = bench.session
    assert (session.state, session.next_deadline(), session.identity) == ("closed", None, "")
    bench.start()
    bench.run_until("running")
    bench.run(0.05)
    assert [*dict.fromkeys(bench.written)] == [*known.asked]
    assert ", ".join(bench.states) == known.states
    assert session.identity == known.identity
    assert bench.samples == session.health.good > 0
    assert session.health.bad == session.health.bad_bytes == session.health.lost == 0
    assert (bench.device_of.rates_hz[0] <= bench.device.rate_hz <= bench.device_of.rates_hz[1]) is True
    traffic = [data for _ in range(6) for data in bench.sent()]
    stop = session.stop()
    assert (stop, session.state, session.next_deadline(), session.on_time(1 << 60)) == (known.stop, "closed", None, b"")
    bench.write(stop)
    before = bench.samples
    bench.run(0.1)
    assert (bench.samples > before) is (known.stop == b"")
    bench.now_ns += 1000 * STEP_NS
    for data in traffic:
        bench.deliver(data)
    assert bench.samples > before, "readings are returned in every state"
    assert session.state == "closed"


@every
def test_a_silent_device_is_named_asked_for_ever_and_runs_once_it_answers(name: str) -> None:
    known, bench = KNOWN[name], Bench(name)
    bench.off = True
    bench.start()
    assert bench.states == [known.states.split(", ")[0]]
    bench.run(25.0)
    assert bench.session.state == known.silent
    assert set(bench.written) <= {*known.asked}
    assert known.silent == "no calibration" or 10 <= len(bench.written) <= 80
    bench.off = False
    bench.run_until("running")


@every
def test_whichever_request_or_answer_is_lost_once_the_device_runs_in_the_end(name: str) -> None:
    for lost in range(len(KNOWN[name].asked)):
        for deaf in (True, False):
            bench, left = Bench(name), [KNOWN[name].asked[lost]]

            def lose(data: bytes, to_device: bool, left: list[bytes] = left, deaf: bool = deaf) -> bool:
                if to_device and deaf and data in left:
                    left.remove(data)
                    return True
                return not to_device and not deaf and bool(bench.written) and bench.written[-1] in left  # noqa: B023

            bench.loses = lose
            bench.start()
            bench.run(0.9)
            left.clear()
            bench.run_until("running")
            bench.run(1.1)
            assert bench.session.state == "running", (lost, deaf, bench.states)
            order = [request for request in bench.written if request == KNOWN[name].asked[lost]]
            assert len(order) <= 4
            assert bench.written[-1] == KNOWN[name].asked[-1]


@every
def test_a_device_that_falls_silent_is_brought_back(name: str) -> None:
    bench = running(name)
    bench.run(0.1)
    asked = [*bench.written]
    bench.off = True
    bench.run(0.95)
    assert (bench.session.state, bench.written) == ("running", asked)
    bench.run(0.3)
    assert bench.session.state != "running"
    bench.run(3.0)
    assert bench.written[len(asked)] == asked[0]
    bench.off = False
    bench.run_until("running")


@every
def test_readings_of_a_device_that_runs_already_are_returned_before_it_answers(name: str) -> None:
    before = running(name)
    bench = Bench(name, before.device)
    bench.now_ns = bench.device_ns = before.device_ns
    bench.loses = lambda data, to_device: to_device
    bench.write(bench.session.start(bench.now_ns))
    bench.run(0.4)
    assert bench.samples > 3
    assert bench.session.state in KNOWN[name].states


@every
def test_a_new_link_forgets_the_identity_and_a_partial_frame(name: str) -> None:
    bench = running(name)
    whole = next(data for _ in range(99) for data in bench.sent())
    bench.session.receive(whole[:-5], bench.now_ns)
    before = bench.session.health.bad_bytes
    bench.session.start(bench.now_ns)
    assert bench.session.identity == ""
    assert bench.session.health.bad_bytes > before or name == "netft", "whose records are forgotten at their start"
    assert bench.session.state == KNOWN[name].states.split(", ")[0]
