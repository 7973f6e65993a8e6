"""Read measured pushes: ROS 1 bags of "MLab_EXP" (github.com/robinzhoucmu/MLab_EXP), or their compact form."""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import median_filter

from slipd.errors import RecordingError, UsageError
from slipd.types.arrays import Array

JUMP_S, JUMP_RAD = 1.5, 0.5
"""A heading that is so far from the median of this time is a confusion of markers; the object turns by 0.3 rad/s."""

TOPICS = {"wrench": "/netft_data", "object": "/Mocap", "pusher": "/robot_CartesianLog"}


@dataclass(frozen=True, slots=True, eq=False)
class Pushes:
    """One run; times in s since its begin, of receipt, because the clocks of the header stamps are hours apart.

    Attributes:
        wrench: Time, and force and torque of the sensor, shape (rows, 7), N and N·m.
        object: Time, position x and y of the markers' frame, heading of its x axis, shape (rows, 4), m, rad.
        pusher: Time, position x and y of its tip, heading, shape (rows, 4), m, rad.
    """

    wrench: Array
    object: Array
    pusher: Array


def read_pushes(source: Path) -> Pushes:
    """Read a bag, or the compact form of one (``.npz``, see `write_compact`).

    Raises:
        RecordingError: The file cannot be read as such.
        UsageError: A bag needs the package rosbags.
    """
    try:
        if source.suffix == ".bag":
            reader, store = bag_library()
            parts = _bag_parts(source, reader, store)
        else:
            with source.open("rb") as opened, np.load(opened) as file:
                parts = {name: file[name].astype(np.float64) for name in TOPICS}
    except (OSError, KeyError, ValueError, zipfile.BadZipFile) as error:
        raise RecordingError(f"{source}: cannot be read as pushes: {error}") from error
    for name, columns in (("wrench", 7), ("object", 4), ("pusher", 4)):
        part = parts[name]
        if part.ndim != 2 or part.shape[1] != columns or len(part) < 2 or not np.isfinite(part).all():
            raise RecordingError(f"{source}: {name} must have rows of {columns} finite numbers, got {part.shape}")
        if (np.diff(part[:, 0]) < 0.0).any():
            raise RecordingError(f"{source}: the times of {name} must not decrease")
    return Pushes(parts["wrench"], _tracked(parts["object"]), parts["pusher"])


def write_compact(pushes: Pushes, out: Path) -> None:
    """Write the compact form: the same rows as 32-bit numbers."""
    np.savez_compressed(out, **{name: getattr(pushes, name).astype(np.float32) for name in TOPICS})


def _tracked(poses: Array) -> Array:
    """Leave out the poses in which the motion capture confuses the markers: the heading jumps there."""
    heading = np.exp(1j * poses[:, 3])
    rows = 2 * (round(JUMP_S / max(float(np.median(np.diff(poses[:, 0]))), 1e-3)) // 2) + 1
    usual = median_filter(heading.real, rows) + 1j * median_filter(heading.imag, rows)
    tracked: Array = poses[np.abs(np.angle(heading * usual.conj())) < JUMP_RAD]
    return tracked


def _bag_parts(source: Path, reader: Any, store: Any) -> dict[str, Array]:
    rows: dict[str, list[list[float]]] = {topic: [] for topic in TOPICS.values()}
    try:
        with reader(source) as bag:
            wanted = [each for each in bag.connections if each.topic in rows]
            for connection, t_ns, raw in bag.messages(connections=wanted):
                message = store.deserialize_ros1(raw, connection.msgtype)
                rows[connection.topic].append([t_ns * 1e-9, *_ROWS[connection.topic](message)])
    except Exception as error:  # rosbags raises many kinds on damaged bytes
        raise RecordingError(f"{source}: cannot be read as pushes: {error}") from error
    if empty := [topic for topic, found in rows.items() if not found]:
        raise RecordingError(f"{source}: must have the topics {', '.join(TOPICS.values())}, lacks {', '.join(empty)}")
    parts = {name: np.array(rows[topic]) for name, topic in TOPICS.items()}
    start_s = parts["wrench"][0, 0]
    for part in parts.values():
        part[:, 0] -= start_s
    return parts


def bag_library() -> tuple[Any, Any]:
    """Return the reader of bags and the types of these bags' messages, whose own definitions rosbags cannot parse.

    Raises:
        UsageError: rosbags is not installed.
    """
    try:
        from rosbags.interfaces import Nodetype
        from rosbags.rosbag1 import Reader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise UsageError("a bag needs the package rosbags: pip install 'slipd[bags]'") from error
    store: Any = get_typestore(Stores.ROS1_NOETIC)

    def several(name: str) -> Any:
        return Nodetype.SEQUENCE, ((Nodetype.NAME, name), 0)

    markers = "Mocap/msg/marker_set"
    frame: list[tuple[str, Any]] = [
        ("header", (Nodetype.NAME, "std_msgs/msg/Header")),
        ("number", (Nodetype.BASE, ("int64", 0))),
        ("body_poses", several("geometry_msgs/msg/Pose")),
        ("uid_markers", (Nodetype.NAME, markers)),
        ("id_marker_sets", several(markers)),
    ]
    texts = [(name, (Nodetype.BASE, ("string", 0))) for name in ("date", "time")]
    numbers = [(name, (Nodetype.BASE, ("float64", 0))) for name in ("timeStamp", "x", "y", "z", "q0", "qx", "qy", "qz")]
    store.register(
        {
            markers: ([], [("markers", several("geometry_msgs/msg/Point"))]),
            "Mocap/msg/mocap_frame": ([], frame),
            "robot_comm/msg/robot_CartesianLog": ([], texts + numbers),
        }
    )
    return Reader, store


def _wrench_row(message: Any) -> list[float]:
    force, torque = message.wrench.force, message.wrench.torque
    return [force.x, force.y, force.z, torque.x, torque.y, torque.z]


def _object_row(message: Any) -> list[float]:
    pose = message.body_poses[0]
    q = pose.orientation
    x_of_x, x_of_y = 1.0 - 2.0 * (q.y**2 + q.z**2), 2.0 * (q.x * q.y + q.w * q.z)
    return [pose.position.x * 1e-3, pose.position.y * 1e-3, float(np.arctan2(x_of_y, x_of_x))]


def _pusher_row(message: Any) -> list[float]:
    return [message.x * 1e-3, message.y * 1e-3, float(2.0 * np.arctan2(message.qz, message.q0))]


_ROWS = {TOPICS["wrench"]: _wrench_row, TOPICS["object"]: _object_row, TOPICS["pusher"]: _pusher_row}
