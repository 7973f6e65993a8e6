"""The Bota session with a simple sensor that boots, obeys, refuses and falls silent."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest

from slipd.devices import bota
from slipd.devices.bota import QUIET_NS, SETTLE_NS

MS = 1_000_000
S = 1_000_000_000


@dataclass
class Sensor:
    """A sensor that sends a frame every 10 ms while it runs."""

    running: bool = False
    deaf_to: str = ""
    refuses: dict[str, int] = field(default_factory=dict)
    settings: list[str] = field(default_factory=list)
    received: bytes = b""

    def respond(self, data: bytes) -> bytes:
        commands, self.received = bota.parse_commands(self.received + data)
        return b"".join(self.obey(command) for command in commands)

    def obey(self, command: str) -> bytes:
        if command[0] in self.deaf_to:
            return b""
        code = self.refuses.get(command[0], 0)
        if code == 0:
            self.settings.append(command)
            self.running = {"R": True, "C": False}.get(command[0], self.running)
        return bota.encode_ack(command[0], code)

    def speak(self, now_ns: int) -> bytes:
        return bota.encode_frame((0, 0, 1), (0, 0, 0), now_ns // 1000) if self.running else b""


@dataclass
class Bench:
    """Run session and sensor in steps of 10 ms."""

    session: bota.Session
    sensor: Sensor
    now_ns: int = 0
    written: list[bytes] = field(default_factory=list)
    states: list[str] = field(default_factory=list)
    readings: int = 0

    def start(self, banner_after_ns: int | None = None) -> None:
        self.banner_at_ns = banner_after_ns
        self.write(self.session.start(self.now_ns))

    def write(self, data: bytes) -> None:
        if data:
            self.written.append(data)
            self.deliver(self.sensor.respond(data))

    def deliver(self, data: bytes) -> None:
        if data:
            self.readings += len(self.session.receive(data, self.now_ns))
        self.note()
        due = self.session.next_deadline()
        if due is not None and due <= self.now_ns:
            self.write(self.session.on_time(self.now_ns))
        self.note()

    def note(self) -> None:
        if not self.states or self.states[-1] != self.session.state:
            self.states.append(self.session.state)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds * 100)):
            self.now_ns += 10 * MS
            if self.banner_at_ns is not None and self.now_ns >= self.banner_at_ns:
                self.banner_at_ns = None
                self.deliver(bota.encode_banner())
            self.deliver(self.sensor.speak(self.now_ns))


COMMANDS = [b"C\n", b"c,0,1,0,4\n", b"f,64,0,0,1\n", b"R\n"]


def test_a_booting_sensor_is_configured_after_its_banner_and_runs() -> None:
    bench = Bench(bota.Session(), Sensor())
    bench.start(banner_after_ns=2 * S)
    bench.run(2.4)
    assert bench.written == []
    bench.run(1)
    assert bench.written == COMMANDS
    assert bench.states == ["waiting", "configuring", "running"]
    assert bench.readings > 50


@pytest.mark.parametrize("size", [1, 3, 7])
def test_the_banner_is_found_in_any_split(size: int) -> None:
    session = bota.Session()
    session.start(0)
    banner = bota.encode_banner()
    for start in range(0, len(banner), size):
        session.receive(banner[start : start + size], 7)
    assert session.next_deadline() == 7 + SETTLE_NS


def test_options_reach_the_commands() -> None:
    bench = Bench(bota.Session(sinc_length=512, temperature_compensation=True), Sensor(running=True))
    bench.start()
    bench.run(0.1)
    assert bench.written == [b"C\n", b"c,1,1,0,4\n", b"f,512,0,0,1\n", b"R\n"]


def test_a_running_sensor_is_configured_at_once_and_its_readings_are_returned_meanwhile() -> None:
    bench = Bench(bota.Session(), Sensor(running=True, deaf_to="C"))
    bench.start()
    bench.run(1.0)
    assert bench.readings == 100
    bench.sensor.deaf_to = ""
    bench.run(2.0)
    assert bench.session.state == "running"


def test_a_silent_sensor_is_configured_after_three_seconds() -> None:
    bench = Bench(bota.Session(), Sensor())
    bench.start()
    bench.run(2.98)
    assert bench.written == []
    bench.run(0.1)
    assert bench.session.state == "running"


def test_an_unanswered_command_is_repeated_and_then_the_sequence_restarts() -> None:
    bench = Bench(bota.Session(), Sensor(running=True, deaf_to="f"))
    bench.start()
    bench.run(1.6)
    assert bench.written == [b"C\n", b"c,0,1,0,4\n", *[b"f,64,0,0,1\n"] * 3]
    assert bench.session.state == "waiting"
    bench.run(11.5)
    assert bench.session.state == "no answer to f"
    bench.sensor.deaf_to = ""
    bench.run(5)
    assert bench.written[-4:] == COMMANDS
    assert bench.session.state == "running"


NAMED = b"App Init\rname: MiniONE\r\nHW: 2\r\nS/N: 1234\r\nFW version: 1.2.3\rc,0,1,0,4\r"


@pytest.mark.parametrize("boot_s", [0.2, 5.0, 9.9])
@pytest.mark.parametrize("size", [1, 5, 1000])
def test_D1_a_reset_on_opening_and_ten_seconds_of_boot_text_are_no_fault(boot_s: float, size: int) -> None:
    session, sensor = bota.Session(), Sensor(deaf_to="C")
    bench = Bench(session, sensor)
    bench.start()
    text = b"Bootloader v2, waiting\r\n" * 4 + NAMED
    pieces = [text[at : at + size] for at in range(0, len(text), size)]
    for number in range(3):  # sent before the reset: the session sends a command that the booting sensor ignores
        bench.deliver(bota.encode_frame((0, 0, 1), (0, 0, 0), number))
    bench.run(boot_s)
    assert {state.split()[0] for state in bench.states} <= {"waiting", "configuring"}
    for piece in pieces:
        bench.deliver(piece)
    sensor.deaf_to = ""
    bench.run(1.0)
    assert session.state == "running"
    assert session.identity == "MiniONE S/N 1234"
    assert bench.written[-4:] == COMMANDS
    assert (session.health.bad, session.health.bad_bytes) == (0, 0)


def test_the_identity_is_that_of_the_last_banner_and_unknown_on_a_new_link() -> None:
    session = bota.Session()
    assert session.identity == ""
    session.start(0)
    session.receive(NAMED, 1)
    assert session.identity == "MiniONE S/N 1234"
    session.receive(NAMED[:40], 2)
    session.receive(bota.encode_banner("SensONE", 77), 3)
    assert session.identity == "SensONE S/N 77"
    session.start(4)
    assert session.identity == ""


def test_a_banner_that_has_no_name_is_forgotten() -> None:
    session = bota.Session()
    session.start(0)
    session.receive(bota.BANNER + b"\r", 1)
    for now_ns in range(2, 200):
        session.receive(b"no name here\r\n", now_ns)
        assert len(session._banner) < 1000
    session.receive(NAMED[len(bota.BANNER) :], 300)
    assert session.identity == ""


def test_a_refused_command_is_named_and_repeated_until_it_is_obeyed() -> None:
    bench = Bench(bota.Session(), Sensor(running=True, refuses={"f": 2}))
    bench.start()
    bench.run(3.5)
    assert bench.session.state == "refused f with code 2"
    assert bench.written == [b"C\n", b"c,0,1,0,4\n", *[b"f,64,0,0,1\n"] * 4]
    bench.sensor.refuses = {}
    bench.run(1.0)
    assert bench.session.state == "running"


def test_frames_replace_a_lost_answer_to_run() -> None:
    session = bota.Session()
    sensor = Sensor(running=True, deaf_to="R")
    bench = Bench(session, sensor)
    bench.start()
    bench.run(0.05)
    assert bench.written[-1] == b"R\n"
    sensor.running = True
    bench.run(0.02)
    assert session.state == "running"


def test_a_sensor_that_resets_while_running_is_configured_again() -> None:
    bench = Bench(bota.Session(), Sensor(running=True))
    bench.start()
    bench.run(0.5)
    bench.sensor.running = False
    bench.banner_at_ns = bench.now_ns + 3 * S
    bench.run(5)
    assert bench.written == COMMANDS * 2
    assert bench.states[-3:] == ["waiting", "configuring", "running"]


def test_silence_while_running_is_reported_after_a_second() -> None:
    bench = Bench(bota.Session(), Sensor(running=True))
    bench.start()
    bench.run(0.5)
    bench.sensor.running = False
    bench.run(0.9)
    assert bench.session.state == "running"
    bench.run(0.2)
    assert bench.session.state == "waiting"


@pytest.mark.parametrize("size", [1, 2, 5])
def test_answers_are_found_in_any_split_and_between_frames(size: int) -> None:
    session = bota.Session()
    frame = bota.encode_frame((0, 0, 1), (0, 0, 0), 0)
    session.start(0)
    session.receive(frame, 0)
    for now_ns, command in enumerate(COMMANDS):
        assert session.on_time(now_ns) == command
        stream = frame + bota.encode_ack(command.decode()[0]) + frame
        for start in range(0, len(stream), size):
            session.receive(stream[start : start + size], now_ns)
    assert session.state == "running"
    assert session.health.good == 9


def test_an_answer_after_the_rest_of_a_frame_is_found() -> None:
    """The read is as long as a frame and completes one."""
    session = bota.Session()
    frame, answer = bota.encode_frame((0, 0, 1), (0, 0, 0), 0), b"r,0,C,0"
    session.start(0)
    session.receive(frame, 0)
    assert session.on_time(0) == b"C\n"
    assert session.receive(frame[: len(answer)], MS) == []
    assert len(session.receive(frame[len(answer) :] + answer, MS)) == 1
    assert session.on_time(MS).startswith(b"c,")


def test_stop_sends_configure_and_ends_the_deadlines() -> None:
    session = bota.Session()
    assert session.next_deadline() is None
    session.start(5)
    assert session.next_deadline() == 5 + QUIET_NS
    assert session.stop() == b"C\n"
    assert session.next_deadline() is None
    assert session.on_time(10**12) == b""
    assert len(session.receive(bota.encode_frame((0, 0, 1), (0, 0, 0), 0), 10**12)) == 1
    session.receive(bota.encode_banner(), 10**12)
    assert session.next_deadline() is None, "a banner after the end starts nothing"
    assert session.state == "closed"


@pytest.mark.parametrize("sinc_length", [0, 63, 2048])
def test_a_sinc_length_beyond_the_sensor_is_refused(sinc_length: int) -> None:
    with pytest.raises(ValueError, match="64 to 2047"):
        bota.Session(sinc_length=sinc_length)


def test_commands_are_read_from_any_split_and_around_noise() -> None:
    stream = b"C?c,0,1,0,4f,512,0,0,1\r\nR#p?\n"
    commands, rest = [], b""
    for byte in stream:
        found, rest = bota.parse_commands(rest + bytes((byte,)))
        commands += found
    assert commands == [
        "C",
        "c,0,1,0,4",
        "f,512,0,0,1",
        "R",
        "#",
        "p",
    ]
    assert len(bota.parse_commands(b"x" * 1000)[1]) <= 64


def test_an_answer_belongs_to_its_own_letter() -> None:
    received = b"..r,0,C,0\r\nr,0,c,3"
    assert bota.find_ack(received, "C") == 0
    assert bota.find_ack(received, "c") == 3
    assert bota.find_ack(received, "R") is None
