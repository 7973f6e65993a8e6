"""The relay between the daemon and a program on a TCP port of this machine, with real sockets."""

from __future__ import annotations

import signal
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import zmq

from slipd_client.messages import decode, encode
from slipd_client.slipctl import main
from slipd_client.viewers.relay import MOST_SUBSCRIPTIONS

if TYPE_CHECKING:
    from conftest import Publisher

PATIENCE_MS = 20_000

Start = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture
def listener() -> Iterator[zmq.Socket[bytes]]:
    """Subscribes to everything, like PlotJuggler."""
    with zmq.Context() as context, context.socket(zmq.SUB) as socket:
        socket.setsockopt(zmq.LINGER, 0)
        socket.setsockopt(zmq.RCVTIMEO, PATIENCE_MS)
        socket.setsockopt(zmq.SUBSCRIBE, b"")
        yield socket


def start(publisher: Publisher, slipctl: Start, listener: zmq.Socket[bytes], *options: str) -> subprocess.Popen[str]:
    """Start a relay, and return when the listener receives from it."""
    process = slipctl("--publish", publisher.endpoint, "relay", "--listen", "tcp://127.0.0.1:*", *options)
    assert process.stdout is not None
    address = process.stdout.readline().removeprefix("relay: ").strip()
    assert address.startswith("tcp://127.0.0.1:")
    listener.connect(address)
    publisher.wait_for_subscriber()
    listener.setsockopt(zmq.RCVTIMEO, 50)
    for seq in range(400):
        publisher.send("status", seq, timestamp=1.0)
        try:
            listener.recv_multipart()
        except zmq.Again:
            continue
        break
    listener.setsockopt(zmq.RCVTIMEO, PATIENCE_MS)
    return process


def following(listener: zmq.Socket[bytes]) -> list[bytes]:
    """Return the next message that is no sign of life."""
    while (frames := listener.recv_multipart())[0] == b"status":
        pass
    return frames


def test_messages_cross_it_byte_for_byte(publisher: Publisher, slipctl: Start, listener: zmq.Socket[bytes]) -> None:
    process = start(publisher, slipctl, listener)
    payload = encode({"utilisation": 0.5, "mu": None, "seq": 7})
    publisher.send_frames(b"slip.left", payload)
    assert following(listener) == [b"slip.left", payload]
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=PATIENCE_MS / 1000)
    assert (process.returncode, errors) == (0, "")


def test_a_third_frame_carries_the_time_as_text(
    publisher: Publisher, slipctl: Start, listener: zmq.Socket[bytes]
) -> None:
    start(publisher, slipctl, listener, "--time-frame")
    publisher.send_frames(b"slip.left", encode({"v": 99}))  # of another version: it is left out
    publisher.send("slip.left", 1, timestamp=1_795_353_269.471519)
    topic, payload, seconds = following(listener)
    assert (topic, seconds) == (b"slip.left", b"1795353269.471519")
    assert decode(payload)["timestamp"] == 1_795_353_269.471519


def test_Z8_a_program_that_subscribes_without_end_is_disconnected_and_another_loses_nothing(
    publisher: Publisher, slipctl: Start, listener: zmq.Socket[bytes]
) -> None:
    start(publisher, slipctl, listener)
    address = listener.getsockopt_string(zmq.LAST_ENDPOINT)
    with zmq.Context() as context, context.socket(zmq.XSUB) as flood:
        flood.setsockopt(zmq.LINGER, 0)
        flood.setsockopt(zmq.SNDHWM, 0)
        flood.setsockopt(zmq.RECONNECT_IVL, -1)
        flood.monitor(monitored := "inproc://flood", zmq.EVENT_DISCONNECTED)
        flood.connect(address)
        for number in range(MOST_SUBSCRIPTIONS + 1):
            flood.send(b"\x01%d" % number)
        with context.socket(zmq.PAIR) as ended:
            ended.connect(monitored)
            for seq in range(400, 400 + PATIENCE_MS // 20):  # the relay looks after each message
                publisher.send("slip.left", seq, timestamp=1.0)
                assert following(listener)[0] == b"slip.left"
                if ended.poll(20):
                    return
    pytest.fail("the program was not disconnected")


@pytest.mark.parametrize(
    ("listen", "complaint"),
    [
        ("tcp://0.0.0.0:9872", "must be an address of this machine only, e.g. tcp://127.0.0.1:9872"),
        ("tcp://192.168.1.7:9872", "over a network, subscribe to the daemon's own endpoint, with keys"),
        ("tcp://[::]:9872", "must be an address of this machine only"),
        ("tcp://1.2.3:9872", "must name an IP address"),
        ("ipc:///tmp/x", "must be of the form tcp://127.0.0.1:9872, got 'ipc:///tmp/x'"),
    ],
)
def test_an_address_beyond_this_machine_is_refused(
    publish: str, listen: str, complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        main(["--publish", publish, "relay", "--listen", listen])
    assert end.value.code == 2
    assert complaint in capsys.readouterr().err


def test_without_an_endpoint_it_relays_the_default_one(
    slipctl: Start, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLIPD_RUNTIME_DIR", str(tmp_path))
    process = slipctl("relay", "--listen", "tcp://127.0.0.1:*")
    assert process.stdout is not None
    assert process.stdout.readline().startswith("relay: tcp://127.0.0.1:")


def test_a_port_in_use_is_named(publish: str, capsys: pytest.CaptureFixture[str]) -> None:
    with zmq.Context() as context, context.socket(zmq.PUB) as other:
        port = other.bind_to_random_port("tcp://127.0.0.1")
        with pytest.raises(SystemExit):
            main(["--publish", publish, "relay", "--listen", f"tcp://127.0.0.1:{port}"])
    assert f"cannot publish on tcp://127.0.0.1:{port}: Address already in use" in capsys.readouterr().err
