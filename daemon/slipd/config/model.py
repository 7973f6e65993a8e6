"""A whole config: the tables that a file may hold, and what follows from the keys of a stream."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Any

from pydantic import BaseModel, Field, PrivateAttr

from slipd.config.gripper_tables import Arm, Grasp, GraspMotion, Gripper, ObservedObject, PadPlace, Reflex
from slipd.config.service_tables import (
    Bus,
    Continuous,
    Incidents,
    Levels,
    Rates,
    Realtime,
    Recording,
    Requests,
    Restart,
)
from slipd.config.stream_tables import Finger, Pad, Pose, Slip, Stream, Wrench
from slipd.config.value_bounds import StrictModel
from slipd.devices import DEVICES

STALE_PERIODS = 3.0
"""Periods without a reading after which a stream is stale by default, but not before ``STALE_LEAST_NS``."""

STALE_LEAST_NS = 20_000_000

TABLES: dict[str, type[BaseModel]] = {
    "finger.X": Finger,
    "finger.X.wrench": Wrench,
    "finger.X.wrench.pad_from_sensor": Pose,
    "finger.X.pad": Pad,
    "finger.X.slip": Slip,
    "gripper": Gripper,
    "grasp": Grasp,
    "grasp.pads.X": PadPlace,
    "grasp.object": ObservedObject,
    "grasp.arm": Arm,
    "grasp.motion": GraspMotion,
    "reflex": Reflex,
    "levels": Levels,
    "rates": Rates,
    "bus": Bus,
    "requests": Requests,
    "recording": Recording,
    "recording.continuous": Continuous,
    "recording.incidents": Incidents,
    "realtime": Realtime,
    "restart": Restart,
}
"""Every table of a config file with the model of its keys; ``X`` stands for the name of a finger."""

_TRANSPORTS = {"ws": "websocket", "tcp": "tcp", "udp": "udp", "ipc": "external", "unix": "local"}


class Config(StrictModel):
    """A whole config file."""

    bus: Bus = Bus()
    requests: Requests = Requests()
    levels: Levels = Levels()
    rates: Rates = Rates()
    finger: dict[str, Finger] = Field(min_length=1)
    gripper: Gripper | None = None
    grasp: Grasp | None = None
    reflex: Reflex = Reflex()
    recording: Recording = Recording()
    realtime: Realtime = Realtime()
    restart: Restart = Restart()
    _text: str = PrivateAttr(default="")

    @property
    def text(self) -> str:
        """The file as it was read."""
        return self._text

    def with_text(self, text: str) -> Config:
        """Store the text that this config was parsed from."""
        self._text = text
        return self

    @property
    def config_id(self) -> str:
        """Identifies the config in messages: the first 12 hexadecimal digits of the SHA-256 of its text."""
        return hashlib.sha256(self.text.encode()).hexdigest()[:12]

    def streams(self) -> dict[str, Stream]:
        """Return all streams by name: ``left.wrench``, ``left.pad``, ``gripper``, ``object``, ``arm``."""
        found: dict[str, Stream | None] = {}
        for name, finger in self.finger.items():
            found |= {f"{name}.wrench": finger.wrench, f"{name}.pad": finger.pad}
        found["gripper"] = self.gripper
        if self.grasp is not None:
            found |= {"object": self.grasp.object, "arm": self.grasp.arm}
        return {name: stream for name, stream in found.items() if stream is not None}


def table_model(path: Sequence[str]) -> type[BaseModel] | None:
    """Return the model of the table at a path, such as ("finger", "left", "pad"); None if there is no such table."""
    for name, model in TABLES.items():
        parts = name.split(".")
        if len(parts) == len(path) and all(part in ("X", key) for part, key in zip(parts, path, strict=True)):
            return model
    return None


def key_path(stream_name: str) -> str:
    """Return the key path of the table of a stream, such as "finger.left.pad" for ``left.pad``."""
    return {"gripper": "gripper", "object": "grasp.object", "arm": "grasp.arm"}.get(
        stream_name, f"finger.{stream_name}"
    )


def transport_of(port: str) -> str:
    """Return the transport of a port, by its address: "serial" where the address is a path."""
    scheme, separator, _ = port.partition("://")
    return _TRANSPORTS.get(scheme, "serial") if separator else "serial"


def stale_after_ns(stream: Stream) -> int:
    """Return the silence, and the age of a reading, beyond which a stream is stale for the verdict, ns."""
    if stream.stale_s is not None:
        return round(stream.stale_s * 1e9)
    return max(round(STALE_PERIODS * 1e9 / stream.rate_hz), STALE_LEAST_NS)


def axes_of(pad: Pad) -> int:
    """Return how many components a taxel of the pad measures; if the device leaves it open, as many as have a scale."""
    return DEVICES[pad.device].axes or len(pad.axis_scale)


def in_newtons(pad: Pad) -> bool:
    """Return whether a pad reads newtons, and not a unit that the config chose."""
    return pad.gain_error is not None or (
        DEVICES[pad.device].measures_newtons and set(map(abs, pad.axis_scale)) == {1.0}
    )


def device_options(stream: Stream) -> dict[str, Any]:
    """Return the options for the device's decoder or session: those of the file, and what other keys imply."""
    device = DEVICES[stream.device]
    options: dict[str, Any] = dict(stream.options)
    if isinstance(stream, Pad) and device.needs_size:
        options |= {"rows": stream.rows, "cols": stream.cols}
    if device.needs_wiring:
        options["wiring"] = transport_of(stream.port)
    if isinstance(stream, Gripper) and device.needs_tables and stream.force_table and stream.width_table:
        keys = ("force_table", "width_table", "speed_table")
        options |= {key: getattr(stream, key) for key in keys}
    return options
