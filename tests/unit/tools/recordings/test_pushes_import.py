"""Measured pushes become recordings of live runs: the weight is the normal force, the push the load."""

from __future__ import annotations

import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from project import CONFIG, DATA

from slipd.errors import RecordingError, UsageError
from slipd.recording.reader import open_recording
from slipd.recording.replay import replay
from slipd.tools.recordings.pushes_import import (
    CENTRE_M,
    GRAVITY,
    Pushes,
    bag_library,
    board_wrench,
    import_pushes,
    read_pushes,
)

MASS_KG = 0.15
SHIPPED = (CONFIG / "pushes.toml").read_text(encoding="utf-8")
ZERO = np.array([0.2, -0.1, 1.1])


def pushes(heading: float = 0.0, turned: float = 0.0, seconds: float = 1.0) -> Pushes:
    """A push of 0.4 N along the pusher's x axis, 10 mm beside the centre of mass, from 0.5 s on."""
    time_s = np.arange(0.0, seconds, 0.01)
    force = np.where(time_s < 0.5, 0.0, 0.4)
    zero = np.zeros_like(force)
    wrench = np.stack([time_s, ZERO[0] + force, ZERO[1] + zero, ZERO[2] + zero, zero, zero, zero], axis=1)
    centre = np.exp(1j * heading) * complex(CENTRE_M[0], -CENTRE_M[1])
    tip = 1j * np.exp(1j * turned) * 0.010
    still = np.ones((3, 1)) * np.array([[-centre.real, -centre.imag, heading]])
    pusher = np.ones((3, 1)) * np.array([[tip.real, tip.imag, turned]])
    few = np.array([[0.0], [seconds / 2.0], [seconds]])
    return Pushes(wrench, np.hstack([few, still]), np.hstack([few, pusher]))


@pytest.mark.parametrize("heading", [0.0, 2.0, -3.1])
@pytest.mark.parametrize("turned", [0.0, 0.4])
def test_the_board_balances_the_push_in_the_frame_of_the_underside(heading: float, turned: float) -> None:
    force, torque = board_wrench(pushes(heading, turned), MASS_KG, (0.0, 0.4))
    np.testing.assert_allclose(force[:50], [[0.0, 0.0, -MASS_KG * GRAVITY]] * 50, atol=1e-12)
    along = 0.4 * np.exp(1j * (turned - heading))
    expected = [-along.real, along.imag, -MASS_KG * GRAVITY]  # z points down, so y is reversed
    np.testing.assert_allclose(force[-1], expected, atol=1e-12)
    # Seen from above the push turns the object by −0.4 N · 10 mm, and the board resists; z points down.
    np.testing.assert_allclose(torque[-1], [0.0, 0.0, -0.004], atol=1e-12)


def test_a_run_is_replayed_from_a_tare_of_the_lifted_object(tmp_path: Path) -> None:
    np.savez_compressed(tmp_path / "run.npz", **asdict(pushes()))
    import_pushes(tmp_path / "run.npz", tmp_path / "out.mcap", SHIPPED, MASS_KG, (0.0, 0.4))
    slips = [body for topic, body in replay(open_recording(tmp_path / "out.mcap")) if topic == "slip.support"]
    assert "no_contact" in {body["level"] for body in slips if body["timestamp"] < 2.0}
    held = [body for body in slips if 2.1 < body["timestamp"] < 2.45]
    assert {body["level"] for body in held} == {"stable"}
    assert held[-1]["normal_n"] == pytest.approx(MASS_KG * GRAVITY, rel=1e-6)
    pushed = [body for body in slips if 2.6 < body["timestamp"] < 2.95][-1]
    assert pushed["tangential_n"][0] == pytest.approx(-0.4, abs=1e-5)
    assert (pushed["level"], pushed["model"]) == ("warning", "exact"), "0.4 N of 1.47 N, and the spin, at μ 0.3"


def test_a_run_of_the_repository_is_as_its_bag() -> None:
    run = read_pushes(DATA / "pushes" / "runs" / "robot_push_2.npz")
    assert (len(run.wrench), len(run.object), len(run.pusher)) == (3026, 1816, 992)
    assert run.object[-1, 1] - run.object[0, 1] == pytest.approx(0.0979, abs=1e-4)


def faulty(**parts: Any) -> dict[str, Any]:
    run = pushes()
    return {"wrench": run.wrench, "object": run.object, "pusher": run.pusher, **parts}


@pytest.mark.parametrize(
    ("parts", "error"),
    [
        (faulty(object=np.zeros((3, 3))), "object must have rows of 4 finite numbers"),
        (faulty(wrench=np.zeros(7)), "wrench must have rows of 7 finite numbers"),
        (faulty(wrench=np.zeros((1, 7))), "wrench must have rows of 7 finite numbers"),
        (faulty(pusher=np.full((3, 4), np.nan)), "pusher must have rows of 4 finite numbers"),
        (faulty(pusher=pushes().pusher[::-1]), "the times of pusher must not decrease"),
        ({"wrench": np.zeros((3, 7))}, "must be a ROS 1 bag"),
    ],
)
def test_a_faulty_file_is_refused(tmp_path: Path, parts: dict[str, Any], error: str) -> None:
    np.savez(tmp_path / "run.npz", **parts)
    with pytest.raises(RecordingError, match=error):
        read_pushes(tmp_path / "run.npz")


def test_a_zero_outside_the_run_is_refused() -> None:
    with pytest.raises(RecordingError, match=r"clear-s must be a time within the run, 0 to 0\.99 s, got 7 to 8"):
        board_wrench(pushes(), MASS_KG, (7.0, 8.0))


def write_bag(path: Path, *, with_object: bool = True) -> None:
    """Write a bag of two messages a topic."""
    writers = pytest.importorskip("rosbags.rosbag1")
    _, store = bag_library()
    kinds = store.types
    vector, quaternion = kinds["geometry_msgs/msg/Vector3"], kinds["geometry_msgs/msg/Quaternion"]
    pose, point = kinds["geometry_msgs/msg/Pose"], kinds["geometry_msgs/msg/Point"]
    header = kinds["std_msgs/msg/Header"](0, kinds["builtin_interfaces/msg/Time"](0, 0), "")
    none = kinds["Mocap/msg/marker_set"]([])
    half = np.sqrt(0.5)
    seen = [pose(point(500.0, -20.0, 40.0), quaternion(0.0, 0.0, half, half))]
    wrench = kinds["geometry_msgs/msg/Wrench"](vector(1.0, 2.0, 3.0), vector(0.1, 0.2, 0.3))
    messages = {
        "/netft_data": kinds["geometry_msgs/msg/WrenchStamped"](header, wrench),
        "/Mocap": kinds["Mocap/msg/mocap_frame"](header, 1, seen, none, []),
        "/robot_CartesianLog": kinds["robot_comm/msg/robot_CartesianLog"](
            "", "", 0.0, 470.0, 5.0, 15.0, half, 0.0, 0.0, half
        ),
        "/other": header,
    }
    if not with_object:
        del messages["/Mocap"]
    with writers.Writer(path) as bag:
        for topic, message in messages.items():
            kind = message.__msgtype__
            connection = bag.add_connection(topic, kind, typestore=store)
            for k in range(2):
                bag.write(connection, 10**9 * (100 + k), store.serialize_ros1(message, kind))


def test_a_bag_is_read(tmp_path: Path) -> None:
    write_bag(tmp_path / "run.bag")
    run = read_pushes(tmp_path / "run.bag")
    np.testing.assert_allclose(run.wrench, [[k, 1.0, 2.0, 3.0, 0.1, 0.2, 0.3] for k in (0.0, 1.0)], atol=1e-6)
    np.testing.assert_allclose(run.object, [[k, 0.5, -0.02, np.pi / 2] for k in (0.0, 1.0)], atol=1e-6)
    np.testing.assert_allclose(run.pusher, [[k, 0.47, 0.005, np.pi / 2] for k in (0.0, 1.0)], atol=1e-6)


def test_a_bag_needs_rosbags(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rosbags.interfaces", None)
    with pytest.raises(UsageError, match=r"slipd\[bags\]"):
        read_pushes(tmp_path / "run.bag")
