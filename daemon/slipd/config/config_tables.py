"""Every table of a config file with the model of its keys; ``X`` stands for the name of a finger."""

from __future__ import annotations

from collections.abc import Sequence

from pydantic import BaseModel

from slipd.config.bus_model import Bus, Requests
from slipd.config.finger_model import Finger, Pad, Pose, Slip, Wrench
from slipd.config.gripper_model import Grasp, Gripper, ObservedObject, PadPlace, Reflex
from slipd.config.host_model import Realtime, Restart
from slipd.config.levels_model import Levels, Rates
from slipd.config.recording_model import Continuous, Incidents, Recording

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
"""Every table of a config file, in the order of the page."""


def table_model(path: Sequence[str]) -> type[BaseModel] | None:
    """Return the model of the table at a path, such as ("finger", "left", "pad"); None if there is no such table."""
    for name, model in TABLES.items():
        parts = name.split(".")
        if len(parts) == len(path) and all(part in ("X", key) for part, key in zip(parts, path, strict=True)):
            return model
    return None
