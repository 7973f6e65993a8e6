"""What is special of a Bota session: it boots when the port is opened, and answers between the frames.

What it shares with all sessions: test_every_session.
"""

from __future__ import annotations

import pytest
from nanoseconds import MS
from session_bench import Bench, bench_of, nothing

from slipd.devices import bota
from slipd.devices.bota import QUIET_NS, SETTLE_NS
from slipd.tools.sim import emulated_wrenches as sim

COMMANDS = [b"C\n", b"c,0,1,0,4\n", b"f,64,0,0,1\n", b"R\n"]
NAMED = b"App Init\rname: MiniONE\r\nHW: 2\r\nS/N: 1234\r\nFW version: 1.2.3\rc,0,1,0,4\r"
FRAME = bota.encode_frame((0, 0, 1), (0, 0, 0), 0)


def booted(**options: object) -> Bench:
    """Return a bench of a sensor that runs since long, so that the port restarts nothing."""
    made = bench_of("bota", **options)
    made.device.advance(made.device_ns)
    return made.run(0.3)


def opened(made: Bench, seconds: float) -> Bench:
    """Start its session, and run."""
    made.write(made.session.start(made.now_ns))
    return made.run(seconds)


@pytest.mark.parametrize("boot_s", [0.2, 5.0, 9.9])
@pytest.mark.parametrize("size", [1, 5, 1000])
def test_D1_a_reset_on_opening_and_ten_seconds_of_boot_text_are_no_fault(boot_s: float, size: int) -> None:
    made = booted()
    made.heard = made.told = nothing
    made.write(made.session.start(made.now_ns))
    made.deliver(3 * FRAME)  # sent before the reset: the session sends a command that the booting sensor ignores
    made.run(boot_s)
    assert {state.split()[0] for state in made.states} <= {"closed", "waiting", "configuring"}
    made.piece = size
    made.deliver(b"Bootloader v2, waiting\r\n" * 4 + NAMED)
    assert made.session.next_deadline() == made.now_ns + SETTLE_NS
    made.heard = made.told = bytes
    made.run(1.0)
    assert (made.session.state, made.session.identity) == ("running", "MiniONE S/N 1234")
    assert made.written[-4:] == COMMANDS
    assert (made.session.health.bad, made.session.health.bad_bytes) == (0, 0)


def test_a_sensor_that_does_not_answer_may_still_boot_for_ten_seconds() -> None:
    made = bench_of("bota")
    made.off = True
    assert made.start().session.next_deadline() == QUIET_NS
    assert (made.run(9.9).states, made.written[:4]) == (["waiting"], [b"C\n"] * 4)
    assert made.run(2.0).session.state == "no answer to C"


def test_options_reach_the_commands_and_a_refused_one_is_named_and_repeated_until_it_is_obeyed() -> None:
    made = booted(sinc_length=512)
    made.told = lambda answer: answer.replace(b"r,0,f,0", b"r,0,f,2")
    opened(made, 3.5)
    assert made.session.state == "refused f with code 2"
    assert made.written == [b"C\n", b"c,0,1,0,4\n", *[b"f,512,0,0,1\n"] * 4]
    made.told = bytes
    assert (made.run(1.1).session.state, made.written[-1]) == ("running", b"R\n")


def test_a_sensor_that_resets_while_running_is_configured_again() -> None:
    made = opened(booted(), 0.5)
    made.device.opened(made.device_ns)
    assert made.run(1.0).written == COMMANDS * 2
    assert made.states[-2:] == ["configuring", "running"]


def test_the_identity_is_that_of_the_last_banner_and_text_without_end_is_not_kept() -> None:
    session = bota.Session()
    session.start(0)
    session.receive(NAMED[:40], 2)
    session.receive(sim.encode_banner("SensONE", 77), 3)
    assert session.identity == "SensONE S/N 77"
    session.start(4)
    session.receive(bota.BANNER + b"\r", 5)
    for now_ns in range(6, 200):
        session.receive(b"no name here\r\n", now_ns)
        assert len(session._text) < 1000
    assert session.identity == ""
    session.stop()
    session.receive(NAMED, 400)
    assert (session.state, session.next_deadline()) == ("closed", None), "a banner after the end starts nothing"


@pytest.mark.parametrize("size", [1, 2, 5])
def test_answers_are_found_in_any_split_and_between_frames(size: int) -> None:
    made = Bench(bota.Session(), None, piece=size)
    made.session.start(0)
    made.deliver(FRAME)
    for command in COMMANDS:
        assert made.session.on_time(0) == command
        made.deliver(FRAME + sim.encode_ack(command.decode()[0]) + FRAME)
    assert (made.session.state, made.session.health.good) == ("running", 9)


def test_an_answer_after_the_rest_of_a_frame_is_found() -> None:
    """The read is as long as a frame and completes one."""
    session, answer = bota.Session(), b"r,0,C,0"
    session.start(0)
    session.receive(FRAME, 0)
    session.on_time(0)
    session.receive(FRAME[: len(answer)], MS)
    assert len(session.receive(FRAME[len(answer) :] + answer, MS)) == 1
    assert session.on_time(MS).startswith(b"c,")


def test_an_answer_belongs_to_its_own_letter() -> None:
    assert [bota.find_ack(b"..r,0,C,0\r\nr,0,c,3", letter) for letter in "CcR"] == [0, 3, None]
