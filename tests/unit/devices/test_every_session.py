"""What every session with a sensor keeps to: shown against the emulated device, on a line that loses data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pytest
from session_bench import STEP_NS, Bench, bench_of, nothing


@dataclass(frozen=True)
class Known:
    """What is known of one device.

    Attributes:
        asked: The requests that bring it to sending, as its maker or its users document them.
        stop: The request that stops it.
        states: The states until it runs.
        silent: The state while it does not answer at all.
        identity: What it reports of itself.
        optional: Which of the requests may go unanswered, by index.
        options: Of its session and its emulator.
    """

    asked: tuple[bytes, ...]
    stop: bytes
    states: str = "waiting, configuring, running"
    silent: str = "no answer to start"
    identity: str = ""
    optional: tuple[int, ...] = ()
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
        optional=(0, 1, 3, 4, 5),
    ),
    "tsf85": Known(
        hexes("9A 00 58 01 00", "9A 00 E3 00", "9A 00 58 01 01"), b"\x9a\0\x58\x01\0", identity="1.1.8", optional=(0, 1)
    ),
    "papillarray": Known((b"f500\n",), b"", "waiting, running", "no answer to rate"),
    "netft": Known(
        hexes("12 34 00 03 00 00 00 00"),
        *hexes("12 34 00 00 00 00 00 00"),
        states="waiting for calibration, waiting, running",
        silent="waiting for calibration",
    ),
    "optoforce": Known(
        hexes("AA 00 32 03 01 02 00 00 E2", "AB 00 12 08 00 C5"),
        *hexes("AA 00 32 03 00 02 00 00 E1"),
        silent="no answer to configuration",
        identity="S/N HEXEB123",
        optional=(1,),
    ),
    "optoforce udp": Known(
        hexes("12 34 00 82 00 00 00 01", "12 34 00 81 00 00 00 02", "12 34 00 02 00 00 00 00"),
        *hexes("12 34 00 00 00 00 00 00"),
        states="waiting, running",
        optional=(0, 1),
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


def bench(name: str) -> Bench:
    return bench_of(name.split()[0], **dict(KNOWN[name].options))


@every
@pytest.mark.parametrize("piece", [13, 1 << 20])
def test_a_session_asks_what_is_documented_until_the_device_runs_and_stops_it(name: str, piece: int) -> None:
    known, made = KNOWN[name], bench(name)
    made.piece = piece
    session = made.session
    assert (session.state, session.next_deadline(), session.identity) == ("closed", None, "")
    made.start().run_until_it_runs().run(0.05)
    assert [*dict.fromkeys(made.written)] == [*known.asked]
    assert ", ".join(made.states) == known.states
    assert session.identity == known.identity
    assert len(made.samples) == session.health.good > 0
    assert session.health.bad == session.health.bad_bytes == session.health.lost == 0
    traffic = [data for _ in range(6) for data in made.sent()]
    stop = session.stop()
    assert (stop, session.state, session.next_deadline(), session.on_time(1 << 60)) == (known.stop, "closed", None, b"")
    made.write(stop)
    before = len(made.samples)
    made.run(0.1)
    assert (len(made.samples) > before) is (known.stop == b"")
    made.now_ns += 1000 * STEP_NS
    for data in traffic:
        made.deliver(data)
    assert len(made.samples) > before, "readings are returned in every state"
    assert session.state == "closed"
    session.start(made.now_ns)
    assert (session.state, session.identity) == (known.states.split(", ")[0], "")


@every
def test_a_silent_device_is_named_asked_for_ever_and_runs_once_it_answers(name: str) -> None:
    known, made = KNOWN[name], bench(name)
    made.off = True
    made.start(25.0)
    assert (made.states[0], made.session.state) == (known.states.split(", ")[0], known.silent)
    assert set(made.written) <= {*known.asked}
    assert known.silent == "waiting for calibration" or 10 <= len(made.written) <= 80
    made.off = False
    made.run_until_it_runs()


@every
@pytest.mark.parametrize("deaf", [True, False])
def test_whichever_request_or_answer_is_lost_once_the_device_runs_in_the_end(name: str, deaf: bool) -> None:
    for lost in KNOWN[name].asked:
        made, left = bench(name), [lost]
        if deaf:
            made.heard = lambda data: b"" if data in left and not left.remove(data) else data  # type: ignore[func-returns-value] # noqa: B023
        else:
            made.told = lambda data: b"" if made.written[-1:] == left else data  # noqa: B023
        made.start(0.9)
        left.clear()
        made.run_until_it_runs().run(1.1)
        assert made.session.state == "running", (lost, made.states)
        assert made.written.count(lost) <= 4
        assert made.written[-1] == KNOWN[name].asked[-1]


@pytest.mark.parametrize("name", [name for name, known in KNOWN.items() if len(known.asked) > 1])
def test_a_device_that_ignores_a_request_runs_if_that_is_an_optional_one(name: str) -> None:
    for number, ignored in enumerate(KNOWN[name].asked):
        made = bench(name)
        made.heard = lambda data: b"" if data == ignored else data  # noqa: B023
        made.start(6.0)
        assert (made.session.state == "running") is (number in KNOWN[name].optional), number
        assert 3 <= made.written.count(ignored) <= 13 or number in KNOWN[name].optional


@every
def test_a_device_that_falls_silent_is_brought_back(name: str) -> None:
    made = bench(name).start().run_until_it_runs().run(0.1)
    asked = [*made.written]
    made.off = True
    assert (made.run(0.95).session.state, made.written) == ("running", asked)
    assert made.run(0.3).session.state != "running"
    assert made.run(3.0).written[len(asked)] == asked[0]
    made.off = False
    made.run_until_it_runs()


@every
def test_readings_of_a_device_that_runs_already_are_returned_before_it_answers(name: str) -> None:
    before, made = bench(name).start().run_until_it_runs(), bench(name)
    made.device, made.now_ns, made.device_ns = before.device, before.device_ns, before.device_ns
    made.heard = nothing
    made.write(made.session.start(made.now_ns))
    made.run(0.4)
    assert len(made.samples) > 3
    assert made.session.state in KNOWN[name].states
