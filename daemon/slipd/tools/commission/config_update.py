"""Put what was found into the config: only these values change, and the file before is kept beside it."""

from __future__ import annotations

import json
import shutil
import stat
import tomllib
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

from slipd import config
from slipd.config import Finger, Pad, Wrench
from slipd.config.config_file import key_lines, lines_of, marked_keys
from slipd.io.replaced_file import replace_file
from slipd.tools.commission.touches import Findings

PREVIOUS = ".previous"
"""Ending of the name of the config before the last change."""

SAME_NOISE = 1.5
"""A noise that agrees with the config within this factor is kept: half a second of readings is no better."""

SWAPPED = ("port", "sensor", "hardware_id")
"""Keys that name a device; they change hands when the fingers are swapped."""


Values = dict[str, object]
"""Value of each key of a table."""


def changes(rig: config.Config, results: Mapping[str, Findings]) -> dict[tuple[str, ...], str]:
    """Return, as TOML, the value of every key that changes, or that is confirmed and still marked MEASURE."""
    found: dict[tuple[str, str], Values] = defaultdict(dict)
    for name, result in results.items():
        finger = rig.finger[name]
        for kind, other in result.streams.items():
            found[name, kind] |= _identity(finger, rig.finger[other], kind)
            if other not in results:  # its sensor is on the finger whose tables have this one
                found[other, kind] |= _identity(rig.finger[other], finger, kind)
        if finger.wrench is not None:
            found[name, "wrench"] |= _wrench_values(finger.wrench, result)
        if finger.pad is not None:
            found[name, "pad"] |= _pad_values(finger.pad, result)
    stated = {name: finger.model_dump() for name, finger in rig.finger.items()}
    marked = marked_keys(rig.text)
    return {
        ("finger", name, kind, key): _toml(value)
        for (name, kind), values in found.items()
        for key, value in values.items()
        if ("finger", name, kind, key) in marked or value != stated[name][kind][key]
    }


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


def _wrench_values(sensor: Wrench, result: Findings) -> Values:
    values: Values = {}
    if (mount := result.mount) is not None:
        values["sign"] = mount.sign
        values["pad_from_sensor"] = {"xyz_m": list(mount.xyz_m), "quat_xyzw": list(mount.quat_xyzw)}
    if (noise := result.noise) is not None:
        values["force_std_n"] = _noise(sensor.force_std_n, noise.force_std_n)
        values["torque_std_nm"] = _noise(sensor.torque_std_nm, noise.torque_std_nm)
    return values


def _pad_values(pad: Pad, result: Findings) -> Values:
    values: Values = {} if result.symmetry is None else asdict(result.symmetry)
    if result.axes is not None:
        values["axis_scale"] = [sign * abs(each) for sign, each in zip(result.axes, pad.axis_scale, strict=True)]
    if pad.threshold == 0.0 and result.noise is not None and result.noise.threshold is not None:
        values["threshold"] = _noise(pad.threshold, result.noise.threshold)
    return values


def _noise(stated: float, measured: float) -> float:
    """Return a noise; the stated one is kept where the measured one agrees with it."""
    agrees = stated / SAME_NOISE <= measured <= stated * SAME_NOISE
    return stated if agrees else float(f"{measured:.2g}")


def _identity(finger: Finger, other: Finger, kind: str) -> Values:
    """Return the keys that name the device of a sensor of a finger, which is in the tables of another."""
    mine, its = getattr(finger, kind), getattr(other, kind)
    return {} if mine is None or its is None else {key: getattr(its, key) for key in SWAPPED}


def _toml(value: object) -> str:
    """Return a value as TOML, which writes all but tables as JSON does."""
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{key} = {_toml(each)}' for key, each in value.items())} }}"
    return json.dumps(value)


def with_value(text: str, path: tuple[str, ...], value: str, comment: str) -> str:
    """Return a config with one key set, while the rest stays: tomllib does not write.

    The key is replaced where it is. A missing key is added below the header of its table.

    Args:
        text: The config, valid TOML.
        path: Tables and name of the key.
        value: Its new value, as TOML, of one line or several.
        comment: Where the value comes from; it replaces the comment behind the old value.

    Raises:
        ValueError: The table has no header line, so that the key cannot be placed.
    """
    lines = lines_of(text)
    first, after, name = _place(lines, text, path)
    end = "\r" if any(line.endswith("\r") for line in (lines[:first] + lines[after:])[:1]) else ""
    new = [line + end for line in f"{name} = {value}  # {comment}".splitlines()]
    return "\n".join([*lines[:first], *new, *(lines[after:] or [""])])


def _place(lines: list[str], text: str, path: tuple[str, ...]) -> tuple[int, int, str]:
    """Return the first line of a key, the line after it, and the key as written; a missing key has no lines."""
    found = key_lines(text)
    header = found.get(path[:-1])
    if path in found and not lines[found[path] - 1].lstrip().startswith("["):
        first = found[path] - 1
        after = next(end for end in range(first + 1, len(lines) + 1) if _is_toml("\n".join([*lines[first:end], ""])))
        return first, after, lines[first].split("=")[0].strip()
    if header is not None and path not in found and lines[header - 1].lstrip().startswith("["):
        return header, header, path[-1]
    raise ValueError(f"must have a line [{'.'.join(path[:-1])}], to set {path[-1]} below it")


def _is_toml(text: str) -> bool:
    try:
        tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return False
    return True
