import os
import select

import pytest

from slipd.tools.sim.pseudo_terminal import PseudoTerminal


@pytest.fixture
def port(tmp_path):
    made = PseudoTerminal(tmp_path / "left-pad")
    yield made
    made.close()


def note(port):
    poll = select.poll()
    poll.register(port.fd, select.POLLIN)
    return port.update(dict(poll.poll(0)).get(port.fd, 0))


@pytest.fixture
def other(port):
    fd = os.open(port.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    yield fd
    os.close(fd)


def test_every_byte_passes_both_ways_unchanged(port, other):
    note(port)
    everything = bytes(range(256))
    port.write(everything)
    assert os.read(other, 1024) == everything
    os.write(other, everything)
    assert port.read() == everything


def test_it_notices_being_opened_and_left(port):
    assert not note(port)
    for _ in range(2):
        fd = os.open(port.path, os.O_RDWR | os.O_NOCTTY)
        assert note(port)
        assert not note(port)
        os.close(fd)
        assert not note(port)
        assert not port.open


def test_a_slow_reader_loses_bytes_and_blocks_nobody(port, other):
    note(port)
    written = 0
    while not port.dropped:
        port.write(b"x" * 1000)
        written += 1000
        assert written < 10_000_000
    received = 0
    for _ in range(10_000):
        try:
            received += len(os.read(other, 65_536))
        except BlockingIOError:
            break
    assert received == written - port.dropped


def test_the_link_replaces_an_old_one_and_goes_with_the_port(tmp_path):
    link = tmp_path / "gripper"
    link.symlink_to("/dev/pts/gone")
    port = PseudoTerminal(link)
    assert str(link.readlink()).startswith("/dev/pts/")
    assert link.exists()
    port.close()
    assert not link.is_symlink()


def test_a_file_in_its_place_is_not_replaced(tmp_path):
    (tmp_path / "gripper").write_text("precious")
    with pytest.raises(FileExistsError):
        PseudoTerminal(tmp_path / "gripper")
    assert (tmp_path / "gripper").read_text() == "precious"
