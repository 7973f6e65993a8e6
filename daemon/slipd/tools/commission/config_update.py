"""Put what was found into the config: only these values change, and the file before is kept beside it."""

from __future__ import annotations

import json
import shutil
import stat
from collections.abc import Collection, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from slipd import config
from slipd.config import Pad, Wrench
from slipd.config.toml_text import marked_keys, with_value
from slipd.io.replaced_file import replace_file
from slipd.tools.commission.readings import Noise
from slipd.tools.commission.touches import Mount, Symmetry, mount_of

PREVIOUS = ".previous"
"""Ending of the name of the config before the last change."""

SAME_NOISE = 1.5
"""A noise that agrees with the config within this factor is kept: half a second of readings is no better."""

SWAPPED = ("port", "sensor", "hardware_id")
"""Keys that name a device; they change hands when the fingers are swapped."""


_Value = tuple[str, str, bool]
"""Key of a table, its value as TOML, and whether that differs from the config."""


@dataclass(frozen=True, slots=True)
class FingerResult:
    """What was found of one finger; None where nothing is to change.

    Attributes:
        mount: Mounting of its force sensor.
        symmetry: Orientation of its image.
        axes: Signs of the axes of its taxels.
        streams: By "wrench" and "pad": name of the finger whose tables the sensors of this finger are in now.
        noise: Noise of its sensors at rest.
    """

    mount: Mount | None
    symmetry: Symmetry | None
    axes: tuple[int, int, int] | None
    streams: Mapping[str, str]
    noise: Noise | None = None


def changes(rig: config.Config, results: Mapping[str, FingerResult]) -> dict[tuple[str, ...], str]:
    """Return, as TOML, the value of every key that changes, or that is confirmed and still marked MEASURE."""
    found: dict[tuple[str, ...], str] = {}
    marked = marked_keys(rig.text)
    for name, result in results.items():
        finger = rig.finger[name]
        for kind, other in result.streams.items():
            found |= _identity(rig, name, other, kind, marked)
            if other not in results:  # its sensor is on the finger whose tables have this one
                found |= _identity(rig, other, name, kind, marked)
        values: list[tuple[str, _Value]] = []
        if finger.wrench is not None:
            values += [("wrench", each) for each in _wrench_values(finger.wrench, result.mount, result.noise)]
        if finger.pad is not None:
            values += [("pad", each) for each in _pad_values(finger.pad, result)]
        for kind, (key, value, changed) in values:
            path = ("finger", name, kind, key)
            if changed or path in marked:
                found[path] = value
    return found


def fragment(found: Mapping[tuple[str, ...], str]) -> str:
    """Return the changed keys as a fragment of a config."""
    lines: list[str] = []
    for table in dict.fromkeys(path[:-1] for path in found):
        lines.append(f"[{'.'.join(table)}]")
        lines += [f"{path[-1]} = {value}" for path, value in found.items() if path[:-1] == table]
    return "\n".join(lines)


def changed_text(text: str, found: Mapping[tuple[str, ...], str]) -> str:
    """Return the text of a config with new values.

    Raises:
        ValueError: A table is not written with a header of its own, so that a key cannot be placed.
        ConfigError: The new config is not valid.
    """
    for path, value in found.items():
        text = with_value(text, path, value, "slipd commission")
    config.parse(text, "new config")
    return text


def replace_config(file: Path, text: str, *, keep: bool = True) -> Path:
    """Replace a config at once; return the path of the kept one.

    Args:
        file: The config.
        text: The new one.
        keep: Keep the present one; else the one that was kept before stays.

    Raises:
        OSError: A file cannot be written; the config is as it was.
    """
    previous = file.with_name(file.name + PREVIOUS)
    if keep:
        shutil.copy2(file, previous)
    file = file.resolve()  # a link stays one
    replace_file(file, text, mode=stat.S_IMODE(file.stat().st_mode))
    return previous


def _wrench_values(sensor: Wrench, mount: Mount | None, noise: Noise | None) -> Iterator[_Value]:
    if mount is not None:
        present = mount_of(sensor)
        yield "sign", str(mount.sign), mount.sign != present.sign
        pose = f"{{ xyz_m = {list(mount.xyz_m)}, quat_xyzw = {list(mount.quat_xyzw)} }}"
        yield "pad_from_sensor", pose, (mount.xyz_m, mount.quat_xyzw) != (present.xyz_m, present.quat_xyzw)
    if noise is not None:
        yield _noise_value("force_std_n", sensor.force_std_n, noise.force_std_n)
        yield _noise_value("torque_std_nm", sensor.torque_std_nm, noise.torque_std_nm)


def _noise_value(key: str, stated: float, measured: float) -> _Value:
    """Return a noise; the stated one is kept where the measured one agrees with it."""
    if stated / SAME_NOISE <= measured <= stated * SAME_NOISE:
        return key, str(stated), False
    return key, f"{measured:.2g}", True


def _pad_values(pad: Pad, result: FingerResult) -> Iterator[_Value]:
    wanted: dict[str, object] = {} if result.symmetry is None else asdict(result.symmetry)
    for key, value in wanted.items():
        yield key, str(value).lower(), value != getattr(pad, key)
    if result.axes is not None:
        scale = [sign * abs(each) for sign, each in zip(result.axes, pad.axis_scale, strict=True)]
        yield "axis_scale", str(scale), scale != pad.axis_scale
    if pad.threshold == 0.0 and result.noise is not None and result.noise.threshold is not None:
        yield _noise_value("threshold", pad.threshold, result.noise.threshold)


def _identity(
    rig: config.Config, name: str, other: str, kind: str, marked: Collection[tuple[str, ...]]
) -> dict[tuple[str, ...], str]:
    """Return the keys that name the device of a sensor, where they change, or are confirmed and marked MEASURE.

    Args:
        rig: The config.
        name: Finger of the sensor.
        other: Finger in whose tables it is.
        kind: "wrench" or "pad".
        marked: Keys that are marked MEASURE.
    """
    mine, its = getattr(rig.finger[name], kind), getattr(rig.finger[other], kind)
    if mine is None or its is None:
        return {}
    values = {key: (getattr(mine, key), getattr(its, key)) for key in SWAPPED}
    paths = {("finger", name, kind, key): pair for key, pair in values.items()}
    return {path: json.dumps(new) for path, (old, new) in paths.items() if old != new or path in marked}
