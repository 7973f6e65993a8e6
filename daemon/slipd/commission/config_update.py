"""Put what was found into the config: only these values change, and the file before is kept beside it."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from slipd import config
from slipd.commission.touches import Mount, Symmetry, mount_of
from slipd.config import Pad, Wrench
from slipd.config.toml_edit import with_value

PREVIOUS = ".previous"
"""Ending of the name of the config before the last change."""

SWAPPED = ("port", "sensor", "hardware_id")
"""Keys that name a device; they change hands when the fingers are swapped."""


@dataclass(frozen=True, slots=True)
class FingerResult:
    """What was found of one finger; None where nothing is to change.

    Attributes:
        mount: Mounting of its force sensor.
        symmetry: Orientation of its image.
        axes: Signs of the axes of its taxels.
        streams: By "wrench" and "pad": name of the finger whose tables the sensors of this finger are in now.
    """

    mount: Mount | None
    symmetry: Symmetry | None
    axes: tuple[int, int, int] | None
    streams: Mapping[str, str]


def changes(rig: config.Config, results: Mapping[str, FingerResult]) -> dict[tuple[str, ...], str]:
    """Return the new value of every key that changes, as TOML."""
    found: dict[tuple[str, ...], str] = {}
    for name, result in results.items():
        finger = rig.finger[name]
        for kind, other in result.streams.items():
            found |= _identity(rig, name, other, kind)
            if other not in results:  # its sensor is on the finger whose tables have this one
                found |= _identity(rig, other, name, kind)
        if finger.wrench is not None and result.mount is not None:
            found |= _of_table(name, "wrench", _mount_values(finger.wrench, result.mount))
        if finger.pad is not None:
            found |= _of_table(name, "pad", _pad_values(finger.pad, result.symmetry, result.axes))
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
    with _beside(file) as new:
        new.write_text(text, encoding="utf-8")
        shutil.copymode(file, new)
        new.replace(file)
    return previous


@contextlib.contextmanager
def _beside(file: Path) -> Iterator[Path]:
    """Create a file in the same folder; remove it if it is still there at the end."""
    handle, name = tempfile.mkstemp(dir=file.parent, prefix=f".{file.name}.")
    os.close(handle)
    try:
        yield Path(name)
    finally:
        Path(name).unlink(missing_ok=True)


def _of_table(finger: str, kind: str, values: Mapping[str, str]) -> dict[tuple[str, ...], str]:
    """Return values of the keys of one table, by their paths."""
    return {("finger", finger, kind, key): value for key, value in values.items()}


def _mount_values(sensor: Wrench, mount: Mount) -> dict[str, str]:
    """Return the keys that differ from a mounting."""
    present, values = mount_of(sensor), {}
    if mount.sign != present.sign:
        values["sign"] = str(mount.sign)
    if (mount.xyz_m, mount.quat_xyzw) != (present.xyz_m, present.quat_xyzw):
        pose = f"{{ xyz_m = {list(mount.xyz_m)}, quat_xyzw = {list(mount.quat_xyzw)} }}"
        values["pad_from_sensor"] = pose
    return values


def _pad_values(pad: Pad, symmetry: Symmetry | None, axes: tuple[int, int, int] | None) -> dict[str, str]:
    """Return the keys that differ from the orientation of an image and the signs of its axes."""
    wanted: dict[str, object] = {} if symmetry is None else asdict(symmetry)
    values = {key: str(value).lower() for key, value in wanted.items() if value != getattr(pad, key)}
    if axes is not None:
        scale = [sign * abs(each) for sign, each in zip(axes, pad.axis_scale, strict=True)]
        if scale != pad.axis_scale:
            values["axis_scale"] = str(scale)
    return values


def _identity(rig: config.Config, name: str, other: str, kind: str) -> dict[tuple[str, ...], str]:
    """Return the keys that name a device, of a sensor that is in the tables of another finger."""
    mine, its = getattr(rig.finger[name], kind), getattr(rig.finger[other], kind)
    if mine is None or its is None or name == other:
        return {}
    values = {key: (getattr(mine, key), getattr(its, key)) for key in SWAPPED}
    return {("finger", name, kind, key): f'"{new}"' for key, (old, new) in values.items() if old != new}
