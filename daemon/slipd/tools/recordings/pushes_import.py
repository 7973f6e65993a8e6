"""Import measured pushes as recordings: an object on a board is a contact of known support and known weight.

The source is a ROS 1 bag as published with "MLab_EXP" (github.com/robinzhoucmu/MLab_EXP, Apache-2.0): the wrench of a
Net F/T behind a point pusher, the pose of the object by motion capture, and that of the robot. The underside of the
object is the finger: its normal force is the weight, and the friction of the board balances the push. Readings become
the messages of an external driver, so that everything from the decoder on runs as in a live run.
"""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from slipd.devices import external
from slipd.errors import RecordingError, UsageError
from slipd.events import Bytes, Event, LinkSpec
from slipd.tools.recordings.imported_run import START_NS, source_of, tare_request, write_run
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
    """Read a bag, or the compact form of one (``.npz``: the rows of each part as 32-bit numbers).

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
    except OSError as error:
        raise RecordingError(f"{source}: cannot be read: {error.strerror}") from error
    except (KeyError, ValueError, EOFError, zipfile.BadZipFile):
        raise RecordingError(f"{source}: must be a ROS 1 bag (.bag), or NPZ with {', '.join(TOPICS)}") from None
    for name, columns in (("wrench", 7), ("object", 4), ("pusher", 4)):
        part = parts[name]
        if part.ndim != 2 or part.shape[1] != columns or len(part) < 2 or not np.isfinite(part).all():
            raise RecordingError(f"{source}: {name} must have rows of {columns} finite numbers, got {part.shape}")
        if (np.diff(part[:, 0]) < 0.0).any():
            raise RecordingError(f"{source}: the times of {name} must not decrease")
    return Pushes(parts["wrench"], _tracked(parts["object"]), parts["pusher"])


def _tracked(poses: Array) -> Array:
    """Leave out the poses in which the motion capture confuses the markers: the heading jumps there."""
    heading = np.exp(1j * poses[:, 3])
    rows = 2 * (round(JUMP_S / max(float(np.median(np.diff(poses[:, 0]))), 1e-3)) // 2) + 1
    usual = median_filter(heading.real, rows) + 1j * median_filter(heading.imag, rows)
    return np.asarray(poses[np.abs(np.angle(heading * usual.conj())) < JUMP_RAD])


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


GRAVITY = 9.81
SUPPORT_M = 0.010
"""Pitch of the image of the support, m."""

SUPPORT_CELLS = 16
"""Rows and columns of the image; its middle is below the centre of mass."""

EDGES = ((0.168, 0.986, 0.0236), (0.562, -0.827, 0.033), (-0.827, -0.562, 0.033))
"""Edges of the triangular object in its frame about the centre of mass: outward normal (x, y) and distance, m.

The legs are 100 mm long. The directions are those along which the points of contact of the pusher lie."""

CENTRE_M = (0.002, 0.007)
"""Centre of mass in the frame of the markers, m: where the edges put it, 2 mm from that of the source's calibration."""

LIFTED_NS = 1_000_000_000
"""Time before the run in which the object is thought to be lifted, so that the finger can be tared, ns."""

STEP_NS = 10_000_000
TARE_NS = 300_000_000
"""Begin of the tare within that time, and its length, ns."""

STREAMS = ("support.wrench", "support.pad")
_LIFTED = range(START_NS, START_NS + LIFTED_NS, STEP_NS)


def support_loads(mass_kg: float) -> Array:
    """Return the normal force on each cell of the image, shape (cells²,), N: even over the triangle."""
    x, y = _cells()
    inside = np.all([nx * x + ny * y <= far for nx, ny, far in EDGES], axis=0)
    return np.asarray(inside * (mass_kg * GRAVITY / inside.sum()))


def board_wrench(pushes: Pushes, mass_kg: float, clear_s: tuple[float, float]) -> tuple[Array, Array]:
    """Return force and torque of the board on the object, each of shape (rows, 3), in the frame of its underside.

    The frame: origin below the centre of mass, x and y of the markers, z down. The object is slow, so friction balances
    the push at every time. The sensor reads the force on the pusher with its y axis reversed; what it reads while the
    pusher is clear is zero. The torque is that of a point contact at the tip, which the sensor's own confirms.

    Args:
        pushes: The run.
        mass_kg: Mass of the object.
        clear_s: Begin and end of a time in which the pusher is clear of the object.

    Raises:
        RecordingError: There is no reading in that time.
    """
    time_s, reading = pushes.wrench[:, 0], pushes.wrench[:, 1:4]
    force = reading - reading[_clear(time_s, clear_s)].mean(axis=0)
    push = _turned(np.stack((force[:, 0], -force[:, 1]), axis=1), _at(pushes.pusher, time_s)[:, 2])
    pose = _at(pushes.object, time_s)
    across = _in_body(push, pose[:, 2])
    lever = _in_body(_at(pushes.pusher, time_s)[:, :2] - pose[:, :2], pose[:, 2]) - CENTRE_M
    none = np.zeros(len(time_s))
    spin = lever[:, 0] * across[:, 1] - lever[:, 1] * across[:, 0]
    normal = np.full(len(time_s), mass_kg * GRAVITY)
    return -np.stack((across[:, 0], across[:, 1], normal), axis=1), -np.stack((none, none, spin), axis=1)


def import_pushes(source: Path, out: Path, config_text: str, mass_kg: float, clear_s: tuple[float, float]) -> None:
    """Write one run as the recording of a live run with this config.

    Args:
        source: Bag, or its compact form.
        out: Recording to write; an existing one is never overwritten, and a failure leaves no file.
        config_text: Config for the replay, TOML; its streams are those of the shipped pushes.toml.
        mass_kg: Mass of the object; where it is not known, μ is relative to the one that is assumed.
        clear_s: Begin and end of a time in which the pusher is clear of the object, s since the begin of the run.

    Raises:
        ConfigError: The config has faults.
        RecordingError: The source is not such a run, or the config has no such streams.
        SlipdError: ``out`` cannot be written.
    """
    finger, link = source_of(config_text, f"config for {out.name}", "external", STREAMS)
    pushes = read_pushes(source)
    force, torque = board_wrench(pushes, mass_kg, clear_s)
    since_s = pushes.wrench[:, 0] - pushes.wrench[0, 0]
    times_ns = [START_NS + LIFTED_NS + round(1e9 * time_s) for time_s in since_s.tolist()]
    image = support_loads(mass_kg)
    lifted = (
        _reading(link, t_ns, force[row] + (0.0, 0.0, mass_kg * GRAVITY), torque[row], 0.0 * image)
        for row, t_ns in zip(np.resize(_clear(since_s, clear_s), LIFTED_NS // STEP_NS), _LIFTED, strict=True)
    )
    pushed = (_reading(link, t_ns, force[row], torque[row], image) for row, t_ns in enumerate(times_ns))
    tare = tare_request(finger, START_NS + TARE_NS, TARE_NS)
    write_run(out, config_text, link, times_ns[-1], [tare], lifted, pushed)


def _reading(link: LinkSpec, t_ns: int, force: Array, torque: Array, image: Array) -> tuple[int, Event]:
    wrench, pad = STREAMS
    both = external.encode_reading(wrench, t_ns, force_n=force, torque_nm=torque)
    return t_ns, Bytes(link.name, both + external.encode_reading(pad, t_ns, values=image))


def _clear(time_s: Array, clear_s: tuple[float, float]) -> NDArray[np.intp]:
    """Return the rows in which the pusher is clear of the object."""
    clear = np.flatnonzero((time_s >= clear_s[0]) & (time_s <= clear_s[1]))
    if not len(clear):
        begin, end = clear_s
        raise RecordingError(
            f"clear-s must be a time within the run, 0 to {time_s[-1]:.2f} s, got {begin:g} to {end:g}"
        )
    return clear


def _cells() -> tuple[Array, Array]:
    """Return the centres of the cells in scan order, each of shape (cells²,), m."""
    centre = (np.arange(SUPPORT_CELLS) - (SUPPORT_CELLS - 1) / 2) * SUPPORT_M
    y, x = np.meshgrid(centre, centre, indexing="ij")
    return x.ravel(), y.ravel()


def _at(poses: Array, time_s: Array) -> Array:
    """Return x, y and heading at these times, between two poses on the straight line."""
    heading = np.unwrap(poses[:, 3])
    return np.stack([np.interp(time_s, poses[:, 0], part) for part in (poses[:, 1], poses[:, 2], heading)], axis=1)


def _turned(vectors: Array, heading: Array) -> Array:
    cos, sin, (x, y) = np.cos(heading), np.sin(heading), vectors.T
    return np.stack((cos * x - sin * y, sin * x + cos * y), axis=1)


def _in_body(vectors: Array, heading: Array) -> Array:
    """Return vectors of the plane in the frame of the underside: seen from above, its y is clockwise of its x."""
    return _turned(vectors, -heading) * (1.0, -1.0)
