"""The server of messages for viewers, its command and its layouts."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import replays
from client_peers import PATIENCE_S, Publisher, until
from foxglove_client import FoxgloveClient
from project import ROOT
from ros_peers import plain

from slipd_client.errors import CallError, Silence
from slipd_client.messages.topics import TOPICS, TOPICS_OF_FINGERS
from slipd_client.ros.conversion import TYPES, PadFrames, pads_of, ros_messages
from slipd_client.ros.foxglove_command import ViewerServer, levels_of
from slipd_client.ros.layouts import Levels, foxglove_layout, plotjuggler_layout, plots
from slipd_client.slipctl import main
from slipd_client.subscriber import Message, Subscriber

PADS = PadFrames({"left": {"positions": [[0.0, 0, 0, 0], [0.1, 0, 0.05, 0]], "quat_xyzw": [0, 0, 0, 1]}})
NAMES = {kind.full_name: name for name, kind in TYPES.items()}

Body = dict[str, Any]


@pytest.fixture(scope="module")
def published() -> dict[str, list[Body]]:
    """Bodies of the messages of a run, by topic."""
    found: dict[str, list[Body]] = {}
    for topic, body in replays.stored_messages("demo"):
        found.setdefault(topic, []).append(body)
    return found


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    return tmp_path / "rig.toml"


@pytest.fixture
def server() -> Iterator[ViewerServer]:
    server = ViewerServer("127.0.0.1", 0, PADS)
    yield server
    server.stop()


@pytest.fixture
def client(server: ViewerServer) -> Iterator[FoxgloveClient]:
    with FoxgloveClient(f"ws://127.0.0.1:{server.port}") as client:
        yield client


def test_channels_have_the_encodings_that_viewers_read(
    server: ViewerServer, client: FoxgloveClient, published: dict[str, list[Body]]
) -> None:
    for topic, bodies in published.items():
        server.publish(topic, bodies[-1])
    messages = [each for topic in published for each in ros_messages(topic, published[topic][-1], PADS)]
    client.subscribe(*{each.topic for each in messages})
    assert {
        topic: (NAMES[each["schemaName"]], each["encoding"], each["schemaEncoding"])
        for topic, each in client.channels.items()
    } == {each.topic: (each.type, "cdr", "ros2msg") for each in messages}


def test_a_client_gets_the_last_message_with_its_own_time_and_then_every_other(
    server: ViewerServer, client: FoxgloveClient, published: dict[str, list[Body]]
) -> None:
    first, second, third = published["slip.left"][-3:]
    server.publish("slip.left", first)
    before_ns = time.time_ns()
    server.publish("slip.left", second)
    after_ns = time.time_ns()
    client.subscribe("/slipd/left/slip")
    last = client.receive()
    assert before_ns <= last.log_ns <= after_ns
    server.publish("slip.left", third)
    for found, body in ((last, second), (client.receive(), third)):
        (wanted, _) = ros_messages("slip.left", body)
        assert str(plain(found.message, NAMES[found.type])) == str(wanted.value)


def test_while_the_daemon_is_silent_a_client_sees_stale_diagnostics_and_no_last_message(
    server: ViewerServer, client: FoxgloveClient, published: dict[str, list[Body]]
) -> None:
    for topic in ("slip.left", "status"):
        server.publish(topic, published[topic][-1])
    server.silent("no message for 3 s")
    status = client.heard("status")
    assert (status["level"], status["message"]) == (1, "no message for 3 s")
    client.subscribe("/diagnostics", "/slipd/left/slip")
    stale = client.receive()
    entries = {(entry.level, entry.message) for entry in stale.message.status}
    assert (stale.topic, entries) == ("/diagnostics", {(3, "no message for 3 s")})
    server.alive()
    assert client.heard("removeStatus")["statusIds"] == [status["id"]]
    server.publish("slip.left", published["slip.left"][-1])
    assert client.receive().topic == "/slipd/left/slip"


def test_after_a_restart_of_the_daemon_nobody_gets_a_message_of_the_run_before(
    server: ViewerServer, client: FoxgloveClient, published: dict[str, list[Body]]
) -> None:
    server.silent("a silence before the first message")
    server.publish("slip.left", published["slip.left"][-2])
    server.restart()
    client.subscribe("/slipd/left/slip")
    server.publish("slip.left", published["slip.left"][-1])
    assert client.receive().message.seq == published["slip.left"][-1]["seq"]


def test_an_address_that_cannot_be_used_is_named(server: ViewerServer) -> None:
    with pytest.raises(CallError, match=rf"cannot serve viewers on 127.0.0.1:{server.port}: .*in use"):
        ViewerServer("127.0.0.1", server.port)


HEADER = {"timestamp": 1_700_000_000.5, "frame": "", "config_id": "c"}


def test_a_silence_of_the_daemon_is_reported_to_the_person_and_to_the_viewers_until_it_ends(
    publisher: Publisher, slipctl: Callable[..., subprocess.Popen[str]]
) -> None:
    process = slipctl(*("--publish", publisher.endpoint, "serve", "foxglove", "--listen", "127.0.0.1:0"), silence_s=0.3)
    url = process.stdout.readline().removeprefix("foxglove: ").strip()
    publisher.wait_for()
    publisher.send("status", 1, **HEADER)
    with FoxgloveClient(url) as client:
        client.subscribe("/diagnostics")
        why = f"no message from {publisher.endpoint} for 0.3 s. Is slipd running?"
        assert process.stderr.readline() == f"slipctl: {why}\n"
        until(lambda: client.receive().message.status[0].message == why)
        publisher.boot = "boot-2"
        publisher.send("status", 1, **HEADER)
        until(lambda: client.receive().message.status[0].message == "OK")
        client.heard("removeStatus")
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, "Traceback" in errors) == (130, False)


def test_while_nobody_watches_the_newest_of_every_topic_is_kept(publisher: Publisher) -> None:
    with Subscriber(publisher.endpoint, ("",), silence_s=0.3) as subscriber:
        publisher.wait_for()
        arriving = subscriber.follow(idle=lambda: True)
        for _ in range(2):
            assert isinstance(next(arriving), Silence)
        for topic in ("slip.left", "slip.right", "grasp"):
            publisher.send(topic, 1, level="stable")
        arrived = [each.topic for each in (next(arriving) for _ in range(3)) if isinstance(each, Message)]
        assert sorted(arrived) == ["grasp", "slip.left", "slip.right"]
        assert isinstance(next(arriving), Silence)


@pytest.mark.parametrize(
    ("text", "levels"),
    [
        ("", (0.7, 0.85)),
        ("[levels]\ncaution = 0.5", (0.5, 0.85)),
        ("[levels]\ncaution = 0.5\nwarning = 0.6", (0.5, 0.6)),
    ],
)
def test_the_levels_of_the_layouts_are_those_of_a_config(text: str, levels: tuple[float, float], rig: Path) -> None:
    rig.write_text(text)
    assert (levels_of(rig), levels_of(None)) == ((*levels, "rig.toml"), (0.7, 0.85, "slipd's defaults"))


@pytest.mark.parametrize(
    ("read", "text", "complaint"),
    [
        (levels_of, "[levels]\ncaution = true", "must be numbers"),
        (pads_of, "[grasp", "not a TOML file"),
        (pads_of, "[finger.left]", r"must have \[grasp.pads\]"),
        (pads_of, "[grasp.pads.left]\npositions = 3", r"must have \[grasp.pads\]"),
    ],
)
def test_a_config_without_what_is_needed_is_refused(
    read: Callable[[Path], object], text: str, complaint: str, rig: Path
) -> None:
    rig.write_text(text)
    with pytest.raises(CallError, match=complaint):
        read(rig)


def test_an_edited_layout_is_not_replaced(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "layouts"
    for _ in range(2):
        assert main(["serve", "foxglove", "--write-layouts", str(folder)]) == 0
    (folder / "foxglove.json").unlink()
    (folder / "plotjuggler.xml").write_text("edited")
    capsys.readouterr()
    assert main(["serve", "foxglove", "--write-layouts", str(folder)]) == 2
    assert "plotjuggler.xml: exists already with other contents, and is not replaced" in capsys.readouterr().err
    assert (folder / "plotjuggler.xml").read_text() == "edited"
    assert not (folder / "foxglove.json").exists(), "nothing is written in part"


def test_the_places_of_the_pads_are_those_of_a_config() -> None:
    found = pads_of(ROOT / "config" / "demo.toml").transforms({"stamp": {"sec": 1, "nanosec": 0}, "frame_id": ""}, 0.06)
    assert {each["child_frame_id"]: each["transform"]["translation"]["y"] for each in found} == {
        "left_pad": pytest.approx(0.03),
        "right_pad": pytest.approx(-0.03),
    }


FINGERS = ("thumb", "index")


EMPTY = {"timestamp": 1.0, "t_ns": 1, "frame": "", "rows": 1, "cols": 1}
OF_FINGERS = [f"{name}.{finger}" for name in TOPICS_OF_FINGERS for finger in FINGERS]
KNOWN = {each.topic: each.type for name in (*TOPICS, *OF_FINGERS) for each in ros_messages(name, EMPTY)}
"""Type of each ROS topic of a rig with these fingers."""


def exists(topic: str, field: str) -> bool:
    return field.partition("[")[0] in {each.name for each in TYPES[KNOWN[topic]].fields}


def test_the_foxglove_layout_shows_panels_of_topics_and_fields_that_exist() -> None:
    layout = json.loads(foxglove_layout(FINGERS, Levels()))
    panels = layout["configById"]
    shown = re.findall(r'"(?:first|second)": "([^"]+)"', json.dumps(layout["layout"]))
    assert sorted(shown) == sorted(panels)
    paths = [path for panel in panels.values() for path in panel.get("paths", ())]
    assert all(path.get("enabled", True) for path in paths)
    assert all(panel["showPlotValuesInLegend"] for name, panel in panels.items() if name.startswith("Plot!"))
    drawn = [path["value"].split(".", 1) for path in paths if path["value"].startswith("/")]
    assert len(drawn) > 10
    assert [curve for curve in drawn if not exists(*curve)] == []
    images = [panel["imageMode"]["imageTopic"] for panel in panels.values() if "imageMode" in panel]
    health = panels["DiagnosticSummary!health"]["topicToRender"]
    assert images == [f"/slipd/{finger}/image" for finger in FINGERS]
    assert {KNOWN[topic] for topic in (*images, health)} == {
        "sensor_msgs/Image",
        "diagnostic_msgs/DiagnosticArray",
    }


def test_the_plotjuggler_layout_names_series_that_exist() -> None:
    root = ET.fromstring(plotjuggler_layout(FINGERS, Levels()))
    assert (
        len(list(root.iter("plot"))) == len(plots(Levels())) == int(next(root.iter("DockSplitter")).get("count", "0"))
    )
    curves = [curve.get("name", "") for curve in root.iter("curve")]
    assert len(curves) > 10
    assert all(exists(*name.rsplit("/", 1)) for name in curves)
