"""Find mass and centre of mass of a finger from a recording in which it was held still in several poses.

During the recording, the program that moves the arm sends the apparent gravity in the pad frame (``gravity.set``), and
nothing touches the finger. The readings are decoded again and transformed to the pad frame, but neither tared nor
compensated: no engine runs.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from slipd.config import Config, Wrench, device_options
from slipd.devices import DEVICES
from slipd.errors import RecordingError, UsageError
from slipd.events import Bytes, LinkDown, LinkUp, Request
from slipd.recording.reader import Recording, open_recording
from slipd.signals.gravity import FRESH_NS, STANDARD_GRAVITY_MPS2, gravity_fault
from slipd.signals.mounting import mounting_matrix
from slipd.signals.tare import MIN_READINGS, Average, most_std
from slipd.tools.commission.weight_identification import Identification, identify
from slipd.types.arrays import Array
from slipd.types.samples import UNTRUSTED_WORDS, WrenchSample
from slipd_client.messages.fields import TRIPLE

POSE_TOLERANCE_MPS2 = 0.5
"""A pose ends when gravity has changed by this much since its start, m/s²: 3° of tilt."""

REST_NS = 200_000_000
"""Shortest pose, ns: a rotation slow enough to stay within the tolerance for so long does not outrun its messages."""

SUSPECT_SHARE = 0.05
"""A force residual above this share of the weight is suspect, and so is a torque residual above the weight on a lever
of ``SUSPECT_LEVER_M``."""

SUSPECT_LEVER_M = 0.001


def identify_command(path: Path, finger: str, *, as_json: bool) -> None:
    """Print mass and centre of mass of a finger; errors are those of `identify_recording`."""
    found = identify_recording(path, finger)
    if not as_json:
        print(identification_text(found, finger))
        return
    values = {name: np.asarray(value).tolist() for name, value in dataclasses.asdict(found).items()}
    print(json.dumps({"finger": finger} | values))


def identify_recording(path: Path, finger: str) -> Identification:
    """Identify the mass beyond the force sensor of a finger.

    Args:
        path: The recording; if its end is missing, the rest is used.
        finger: Name of the finger.

    Raises:
        ConfigError: The recorded config has faults (for this version of slipd).
        UsageError: It has no such sensor.
        RecordingError: The file cannot be read, or its poses do not determine the mass.
    """
    recording = open_recording(path)
    settings = recording.settings()
    wanted = settings.finger.get(finger)
    if wanted is None or wanted.wrench is None:
        known = ", ".join(name for name, other in settings.finger.items() if other.wrench is not None) or "none"
        raise UsageError(f"{path}: --finger must be a finger with a force sensor, got {finger!r}; known: {known}")
    poses, unused = _poses(_timed(recording, settings, finger, wanted.wrench), wanted.wrench)
    try:
        return identify(poses[:, :3], poses[:, 3:6], poses[:, 6:])
    except ValueError as error:
        more = f" ({unused} more were too short or not still)" if unused else ""
        damage = f"; the recording could not be read to its end: {recording.fault}" if recording.fault else ""
        raise RecordingError(f"{path}: finger {finger}: {error}{more}{damage}") from None


def identification_text(found: Identification, finger: str) -> str:
    """Return the result as a text for people, with the lines for the config."""
    lines = [
        f"finger {finger}, condition {found.condition:.1f}",
        *found.lines(),
        f"reading without weight ({_listed(found.bias_force_n, 3)}) N, ({_listed(found.bias_torque_nm, 5)}) N·m",
    ]
    weight_n = found.mass_kg * STANDARD_GRAVITY_MPS2
    if found.residual_n > SUSPECT_SHARE * weight_n or found.residual_nm > SUSPECT_LEVER_M * weight_n:
        lines.append("the residual is large: was the finger touched, or is pad_from_sensor or an orientation wrong?")
    lines += [
        "",
        f"[finger.{finger}.wrench]",
        f"mass_kg = {found.mass_kg:.5f}",
        f"com_m = [{_listed(found.com_m, 5)}]",
    ]
    return "\n".join(lines)


@dataclass(slots=True)
class _Rest:
    """A time of constant gravity: average of the readings in the sensor frame, each with the gravity of its time."""

    gravity: Array
    first_ns: int
    last_ns: int = 0
    average: Average = field(default_factory=lambda: Average((9,)))


def _listed(values: Array, digits: int) -> str:
    return ", ".join(f"{round(value, digits) + 0.0:.{digits}f}" for value in values.tolist())


def _timed(
    recording: Recording, settings: Config, finger: str, wrench: Wrench
) -> Iterator[tuple[int, Array | WrenchSample]]:
    """Yield the gravity vectors and the readings of the finger, each with its time."""
    device = DEVICES[wrench.device]
    session = None if device.session is None else device.session(**device_options(wrench))
    decoder = session or device.decoder(**device_options(wrench))
    link = next(name for name, stream in settings.streams().items() if stream.port == wrench.port)
    for t_ns, event in recording.events():
        match event:
            case Request(body={"op": "gravity.set", "finger": name, "gravity_mps2": gravity}):
                if name == finger and TRIPLE.fits(gravity) and gravity_fault(gravity) is None:
                    yield t_ns, np.array(gravity, dtype=np.float64)
            case Bytes(name, data) if name == link:
                for sample in decoder.receive(data, t_ns):
                    if isinstance(sample, WrenchSample) and sample.source == wrench.sensor:
                        yield sample.t_ns, sample
            case LinkUp(name) if name == link and session is not None:
                session.start(t_ns)
            case LinkDown(name) if name == link and session is not None:
                session.stop()


def _poses(timed: Iterator[tuple[int, Array | WrenchSample]], wrench: Wrench) -> tuple[Array, int]:
    """Return mean wrench (pad frame) and gravity of each still pose, shape (poses, 9), and the number of others."""
    still = most_std(np.repeat((wrench.force_std_n, wrench.torque_std_nm), 3))
    matrix = mounting_matrix(wrench.pad_from_sensor.xyz_m, wrench.pad_from_sensor.quat_xyzw, wrench.sign)
    rests = [rest for rest in _rests(timed) if rest.average.count >= MIN_READINGS]
    means = [
        np.concatenate((matrix @ rest.average.mean[:6], rest.average.mean[6:]))
        for rest in rests
        if rest.last_ns - rest.first_ns >= REST_NS and (rest.average.std[:6] <= still).all()
    ]
    return np.reshape(means, (-1, 9)), len(rests) - len(means)


def _rests(timed: Iterator[tuple[int, Array | WrenchSample]]) -> list[_Rest]:
    """Return the times of known, constant gravity; untrusted readings are left out."""
    rests: list[_Rest] = []
    gravity: Array | None = None
    set_ns = 0
    for t_ns, item in timed:
        if isinstance(item, np.ndarray):
            gravity, set_ns = item, t_ns
            continue
        if gravity is None or t_ns - set_ns > FRESH_NS:
            continue
        if UNTRUSTED_WORDS.isdisjoint(item.status) and item.torque_nm is not None:
            if not rests or math.dist(gravity, rests[-1].gravity) > POSE_TOLERANCE_MPS2:
                rests.append(_Rest(gravity, t_ns))
            rests[-1].last_ns = t_ns
            rests[-1].average.add(np.concatenate((item.force_n, item.torque_nm, gravity)))
    return rests
