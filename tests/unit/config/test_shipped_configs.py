"""The files of config/ are templates: each can be run, and together they show every key."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from project import CONFIG
from pydantic import BaseModel

from slipd import cli, config
from slipd.config import (
    Arm,
    Bus,
    Config,
    Finger,
    Grasp,
    Gripper,
    Levels,
    ObservedObject,
    Pad,
    PadPlace,
    Pose,
    Rates,
    Realtime,
    Recording,
    Reflex,
    Restart,
    Slip,
    Wrench,
)

SHIPPED = sorted(CONFIG.glob("*.toml"))
INNER: dict[str, type[BaseModel]] = {
    "bus": Bus,
    "recording": Recording,
    "realtime": Realtime,
    "restart": Restart,
    "levels": Levels,
    "rates": Rates,
    "gripper": Gripper,
    "grasp": Grasp,
    "object": ObservedObject,
    "arm": Arm,
    "reflex": Reflex,
    "wrench": Wrench,
    "pad": Pad,
    "slip": Slip,
    "pad_from_sensor": Pose,
}
RETIRED = {("Slip", "armed_at")}
"""Keys that are accepted without effect; `slipd check` says so."""
shipped = pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.name)


def owner(model: type[BaseModel], key: str) -> str:
    """Return the class that defines a key; keys of all streams count once."""
    return next(above.__name__ for above in reversed(model.__mro__) if key in vars(above).get("__annotations__", {}))


def keys_of(model: type[BaseModel], table: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield every key of a file, with the class that defines it."""
    for key, value in table.items():
        yield owner(model, key), key
        if model is Config and key == "finger":
            for finger in value.values():
                yield from keys_of(Finger, finger)
        elif model is Grasp and key == "pads":
            for place in value.values():
                yield from keys_of(PadPlace, place)
        elif key in INNER:
            yield from keys_of(INNER[key], value)


@shipped
def test_check_accepts_every_shipped_file(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["check", str(path)]) == 0
    assert f"{path}: valid" in capsys.readouterr().out


@shipped
def test_a_file_begins_with_its_purpose_has_no_long_line_and_names_serial_ports_by_id(path: Path) -> None:
    lines = path.read_text(encoding="utf-8").splitlines()
    assert lines[0].startswith("# ")
    assert max(map(len, lines)) <= 128
    ports = [stream.port for stream in config.load(path).streams().values()]
    serial = [port for port in ports if config.transport_of(port) == "serial"]
    assert [port for port in serial if not port.startswith(("/dev/serial/by-id/", "virtual/"))] == []


def test_together_they_show_every_key() -> None:
    shown = {found for path in SHIPPED for found in keys_of(Config, tomllib.loads(path.read_text(encoding="utf-8")))}
    models: list[type[BaseModel]] = [Config, Finger, PadPlace, *INNER.values()]
    known = {(owner(model, key), key) for model in models for key in model.model_fields}
    assert known - shown == RETIRED | {("Stream", "package")}, "no shipped file needs another package"
