import pytest

from slipd.devices import bota
from slipd.tools.sim.emulated_bota import BOOT_NS, BotaSensor

MS = 1_000_000


@pytest.fixture
def made():
    return BotaSensor(1)


def listen(made, begin_ns, end_ns, step_ns=MS):
    return b"".join(piece for t in range(begin_ns, end_ns, step_ns) for piece in made.advance(t))


@pytest.mark.parametrize("command", [b"c,0,1,1,4", b"f,0,0,0,1"])
def test_what_it_cannot_do_is_refused(made, command):
    made.advance(BOOT_NS)
    made.receive(b"C", BOOT_NS)
    assert bota.find_ack(made.receive(command, BOOT_NS)[0], command[:1].decode()) == 1


def test_a_hard_reset_boots_it_anew(made):
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


def test_the_makers_driver_configures_it(made):
    made.advance(BOOT_NS)
    for command, answer in DRIVER:
        assert made.receive(command, BOOT_NS) == [answer]
    assert len(made.advance(BOOT_NS + 1_000_000_000)) == 25
