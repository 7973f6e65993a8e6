"""The emulated Bota with the words of its maker's driver, the emulated RFT with the session of the daemon."""

from __future__ import annotations

import pytest
from driving import drive
from nanoseconds import MS

from slipd.devices import bota, robotous
from slipd.tools.sim import emulated_wrenches as sim
from slipd.tools.sim.emulated_wrenches import BOOT_NS, BotaSensor, RobotousSensor


@pytest.fixture
def made() -> BotaSensor:
    return BotaSensor(1)


def listen(made: BotaSensor, begin_ns: int, end_ns: int, step_ns: int = MS) -> bytes:
    return b"".join(piece for t in range(begin_ns, end_ns, step_ns) for piece in made.advance(t))


@pytest.mark.parametrize("command", [b"c,0,1,1,4", b"f,0,0,0,1"])
def test_what_a_bota_cannot_do_is_refused(made: BotaSensor, command: bytes) -> None:
    made.advance(BOOT_NS)
    made.receive(b"C", BOOT_NS)
    assert bota.find_ack(made.receive(command, BOOT_NS)[0], command[:1].decode()) == 1


def test_a_hard_reset_boots_it_anew(made: BotaSensor) -> None:
    listen(made, 0, BOOT_NS + 10 * MS)
    made.receive(b"#", BOOT_NS + 10 * MS)
    said = listen(made, BOOT_NS + 10 * MS, 2 * BOOT_NS + 20 * MS)
    assert said.startswith(bota.BANNER)
    assert bota.Decoder().receive(said, 0)[0].device_time_ns == pytest.approx(BOOT_NS, rel=1e-4)


DRIVER = [
    (b"C\n", b"r,0,C,0\r\n"),
    (b"p?\n", b"p,0,1,0,0,MiniONE\r\nr,0,p,0\r\n"),
    (b"c,0,1,0,4\n", b"r,0,c,0\r\n"),
    (b"f,2047,0,0,1\n", b"r,0,f,0\r\n"),
    (b"s\n", b"r,0,s,0\r\n"),
    (b"R\n", b"r,0,R,0\r\n"),
]
"""What the maker's driver (bota-driver 1.1.16, ``Bota_Binary_gen0``, sinc length 2047) sends to this emulator, and the
answers with which it configured and read it; it takes 1 for the serial number SN0001 and expects 25.01 Hz."""


def test_the_makers_driver_configures_it(made: BotaSensor) -> None:
    made.advance(BOOT_NS)
    for command, answer in DRIVER:
        assert made.receive(command, BOOT_NS) == [answer]
    assert len(made.advance(BOOT_NS + 1_000_000_000)) == 25


def test_a_second_session_writes_nothing_to_its_eeprom() -> None:
    emulator = RobotousSensor(2)
    session = robotous.Session(filter_hz=100)
    drive(session, emulator, 0.1)
    assert emulator.writes == 2
    emulator.receive(session.stop(), 100 * MS)
    assert emulator.advance(150 * MS) == []
    drive(robotous.Session(filter_hz=100), emulator, 0.1, begin_ns=150 * MS)
    assert emulator.writes == 2


@pytest.mark.parametrize(("baud", "hz", "note"), [(115_200, 200, "refused rate"), (921_600, 500, "")])
def test_a_rate_that_its_line_does_not_carry_is_refused_and_it_sends_at_its_own(baud: int, hz: int, note: str) -> None:
    session = robotous.Session(output_hz=500)
    samples = drive(session, RobotousSensor(6, baud=baud), 1.0)
    assert (session.state, session.health.note.partition(":")[0]) == ("running", note)
    assert hz - 20 <= len(samples) <= hz


@pytest.mark.parametrize(("number", "arguments"), [(robotous.SET_RATE, b"\x63"), (robotous.SET_FILTER, b"\x01\x63")])
def test_what_an_rft_cannot_do_is_refused(number: int, arguments: bytes) -> None:
    emulator = RobotousSensor(4)
    (answer,) = emulator.receive(robotous.encode_command(number, arguments), 0)
    assert answer == sim.encode_response(number, b"\0\x02")
    assert emulator.writes == 0
