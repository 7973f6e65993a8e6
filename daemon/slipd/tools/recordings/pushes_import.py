"""Import measured pushes as recordings: an object on a board is a contact of known support and known weight.

The source is a ROS 1 bag as published with "MLab_EXP" (github.com/robinzhoucmu/MLab_EXP, Apache-2.0): the wrench of a
Net F/T behind a point pusher, the pose of the object by motion capture, and that of the robot. The underside of the
object is the finger: its normal force is the weight, and the friction of the board balances the push. Readings become
the messages of an external driver, so that everything from the decoder on runs as in a live run.
"""

from __future__ import annotations

import heapq
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slipd import config
from slipd.devices import external
from slipd.errors import RecordingError
from slipd.events import Bytes, Event, LinkSpec, LinkUp
from slipd.tools.recordings.imported_run import START_NS, links_of, tare_request, write_run
from slipd.tools.recordings.pushes_file import Pushes, read_pushes
from slipd.types.arrays import Array

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
    loads: Array = inside * (mass_kg * GRAVITY / inside.sum())
    return loads


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
    link = _driver(config_text, f"config for {out.name}")
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
    finger = next(iter(config.parse(config_text, "config").finger))
    begin = [(START_NS, LinkUp(link.name, link.address)), tare_request(finger, START_NS + TARE_NS, TARE_NS)]
    events = heapq.merge(begin, lifted, pushed, key=lambda timed: timed[0])
    write_run(out, config_text, events, times_ns[-1])


def _reading(link: LinkSpec, t_ns: int, force: Array, torque: Array, image: Array) -> tuple[int, Event]:
    wrench, pad = STREAMS
    both = external.encode_reading(wrench, t_ns, force_n=force, torque_nm=torque)
    return t_ns, Bytes(link.name, both + external.encode_reading(pad, t_ns, values=image))


def _driver(config_text: str, file_name: str) -> LinkSpec:
    """Return the link over which the config reads both streams."""
    settings = config.parse(config_text, file_name)
    parts = [part for finger in settings.finger.values() for part in (finger.wrench, finger.pad) if part is not None]
    ports = {part.port for part in parts if part.device == "external"}
    sensors = {part.sensor for part in parts}
    if len(ports) != 1 or sensors != set(STREAMS):
        raise RecordingError(f"{file_name}: must have the external streams {' and '.join(STREAMS)} at one address")
    return next(link for link in links_of(settings).values() if link.address in ports)


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
